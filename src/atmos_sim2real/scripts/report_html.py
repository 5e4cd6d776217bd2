#!/usr/bin/python3
"""Draws figures/*.png and report.html (one self-contained page) from report.json and plots.json of a folder."""
import base64
import html
import json
import multiprocessing
import os
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402 (the backend must be chosen first)
import numpy as np  # noqa: E402

NOMINAL, FITTED, NEUTRAL = "#c2410c", "#1d6fb8", "#6b7280"
plt.rcParams.update({
    "figure.dpi": 120, "font.size": 9, "font.family": "DejaVu Sans", "axes.spines.top": False,
    "axes.spines.right": False, "axes.grid": True, "grid.color": "#e5e7eb", "grid.linewidth": 0.7,
    "axes.edgecolor": "#9ca3af", "axes.titlesize": 9.5, "axes.titleweight": "bold", "axes.titlelocation": "left",
    "legend.frameon": False, "axes.axisbelow": True})

HEADLINES = {
    "consistent": ("Nothing is missing", "#15803d",
                   "The nominal model explains these recordings down to their own noise."),
    "explained": ("The mismatch is explained", "#1d6fb8", "The effects below account for it."),
    "partly_explained": ("The mismatch is partly explained", "#b45309",
                         "The effects below are there, and more remains than noise alone leaves."),
    "unexplained": ("There is a mismatch without a name", "#b91c1c",
                    "Something acts on the robot that no known effect describes.")}
THRUSTER_KINDS = ("thrust_scale", "thruster_efficiency", "thruster_weak_since", "thruster_dead", "thruster_stuck_open",
                  "thruster_leak", "thruster_leak_since")  # that change how strongly a thruster pushes


def numbers(values):
    return np.array([np.nan if v is None else v for v in values], dtype=float)


def parameter(effect, name):
    return effect["parameters"][name]["value"]


def draw_prediction(report, plots):
    """Error of each 5 s window as it grows from its start, and its size at 1, 5 and 10 s."""
    recordings = plots["predicted"]
    if not recordings or not any(r["nominal"]["time_s"] for r in recordings):
        return None
    same = not report["effects"]
    figure, axes = plt.subplots(1, 3, figsize=(9.6, 2.7), gridspec_kw={"width_ratios": [2.3, 2.3, 1.3]})
    shown = recordings[0]
    for axis, key, scale, title, least in ((axes[0], "position_m", 1e3, "Position error [mm]", 0.1),
                                           (axes[1], "yaw_rad", 180.0 / np.pi, "Yaw error [deg]", 0.01)):
        for model, color in (("nominal", NOMINAL), ("fitted", FITTED)):
            if same and model == "fitted":
                continue
            axis.plot(numbers(shown[model]["time_s"]), scale * numbers(shown[model][key]), color=color, lw=1.1,
                      label=model)
        axis.set_title(f"{title}, {shown['name']}")
        axis.set_xlabel("time since the first pose [s]")
        axis.set_yscale("log")
        axis.set_ylim(least, 5.0 * axis.get_ylim()[1])
        axis.set_xlim(left=0)
    axes[0].legend(loc="upper right", ncol=2)
    horizons = sorted([report["fit"]] + report["fit"]["other_horizons"], key=lambda h: h["horizon_s"])
    horizons = [h for h in horizons if h["nominal"]["position_rms_m"] is not None]
    bars = [("nominal", NOMINAL), ("fitted", FITTED), ("noise_floor", "#d1d5db")]
    for offset, (model, color) in enumerate(bars):
        axes[2].bar(np.arange(len(horizons)) + 0.27 * (offset - 1),
                    [1e3 * h[model]["position_rms_m"] for h in horizons], 0.25, color=color,
                    label=model.replace("_", " "))
    axes[2].set_xticks(range(len(horizons)), [f"{h['horizon_s']:g} s" for h in horizons])
    axes[2].set_yscale("log")
    axes[2].grid(axis="x", visible=False)
    axes[2].set_title("RMS at the end [mm]")
    axes[2].legend(fontsize=7, loc="upper left", borderaxespad=0.1)
    bottom, top = axes[2].get_ylim()
    axes[2].set_ylim(bottom, top * 4.0)
    return figure


def innovation_size(series):
    """Middle of each bin [s since the first pose], and how large the innovations are there beside their own noise."""
    rms = np.sqrt(np.nanmean([numbers(v) ** 2 for v in series["axes"].values()], axis=0))
    return series["bin_s"] * (np.arange(len(rms)) + 0.5), rms


def draw_time(report, plots):
    """Where in time the recordings disagree with the nominal model, and what is left."""
    flights = plots["flights"]
    figure, axes = plt.subplots(len(flights), 1, figsize=(9.6, 0.8 + 1.5 * len(flights)), squeeze=False)
    for axis, flight in zip(axes[:, 0], flights):
        for model, color in (("nominal", NOMINAL), ("fitted", FITTED)):
            time, rms = innovation_size(flight[model])
            if model == "fitted" or report["effects"]:
                axis.plot(time, rms, color=color, lw=1.3, label=model)
        axis.axhline(1.0, color=NEUTRAL, lw=0.9, ls="--", label="noise alone")
        axis.set_title(f"Mismatch in time, {flight['name']} (innovation over its own noise)")
        axis.set_xlim(0, time[-1])
        axis.set_ylim(0, 1.25 * axis.get_ylim()[1])
    axes[0, 0].legend(ncol=3, loc="upper right")
    axes[-1, 0].set_xlabel("time since the first pose [s]")
    return figure


def draw_mismatch(figure, axis, plots):
    """The paths, coloured by how badly the nominal model predicts there."""
    flown = [(flight, *innovation_size(flight["nominal"])) for flight in plots["flights"]]
    most = max(2.0, np.nanpercentile(np.concatenate([rms for _, _, rms in flown]), 98))
    for flight, time, rms in flown:
        known = ~np.isnan(rms)
        shown = axis.scatter(flight["x_m"], flight["y_m"], s=7, cmap="inferno_r", vmin=0, vmax=most, zorder=2,
                             c=np.interp(numbers(flight["time_s"]), time[known], rms[known]))
    figure.colorbar(shown, ax=axis, label="innovation over its own noise", shrink=0.9)
    axis.set_title("Mismatch of the nominal model along the way")
    axis.set_aspect("equal", adjustable="datalim")
    axis.set_xlabel("x [m]")
    axis.set_ylabel("y [m]")


def draw_floor(report, plots):
    """Where on the floor the mismatch lies, and the maps that were found, under the paths that were flown."""
    if report["verdict"] == "consistent":
        return None
    maps = [e for e in report["effects"] if e["kind"] in ("floor_unevenness", "airflow", "friction_patch", "tether")]
    figure, axes = plt.subplots(1, 1 + len(maps), figsize=(4.8 * (1 + len(maps)), 3.9), squeeze=False)
    draw_mismatch(figure, axes[0, 0], plots)
    for axis, effect in zip(axes[0, 1:], maps):
        if effect["kind"] in ("floor_unevenness", "airflow"):
            origin, spacing = parameter(effect, "origin_m"), parameter(effect, "spacing_m")
            uneven = effect["kind"] == "floor_unevenness"
            first = np.array(parameter(effect, "height_m" if uneven else "force_x_n"))
            x = origin[0] + spacing * np.arange(first.shape[1])
            y = origin[1] + spacing * np.arange(first.shape[0])
        if effect["kind"] == "floor_unevenness":
            height = 1e3 * (first - first.mean())
            filled = axis.contourf(x, y, height, 14, cmap="RdBu_r", vmin=-np.abs(height).max(),
                                   vmax=np.abs(height).max())
            figure.colorbar(filled, ax=axis, label="height [mm]", shrink=0.9)
            axis.set_title("Height of the floor")
        elif effect["kind"] == "airflow":
            axis.quiver(x, y, first, np.array(parameter(effect, "force_y_n")), color=FITTED, zorder=3)
            axis.set_title("Force of moving air")
        elif effect["kind"] == "friction_patch":
            axis.add_patch(plt.Circle((parameter(effect, "center_x_m"), parameter(effect, "center_y_m")),
                                      parameter(effect, "radius_m"), color=NOMINAL, alpha=0.35))
            axis.set_title("Patch that rubs")
        else:
            anchor = parameter(effect, "anchor_x_m"), parameter(effect, "anchor_y_m")
            axis.plot(*anchor, marker="X", ms=10, color=NOMINAL, ls="", label="anchor")
            axis.add_patch(plt.Circle(anchor, parameter(effect, "slack_m"), fill=False, ls="--", color=NOMINAL,
                                      label="taut beyond"))
            axis.legend(loc="best")
            axis.set_title("Where the tether is tied")
        for flight in plots["flights"]:
            axis.plot(flight["x_m"], flight["y_m"], color="#111827", lw=0.7, alpha=0.6)
        axis.set_aspect("equal", adjustable="datalim" if effect["kind"] == "tether" else "box")
        axis.set_xlabel("x [m]")
        axis.set_ylabel("y [m]")
        axis.grid(False)
    return figure


def draw_thrusters(report, plots):
    """Thrust of each valve open alone, as the vehicle file and as the fitted model have it."""
    if not any(e["kind"] in THRUSTER_KINDS for e in report["effects"]):
        return None
    thrusters = plots["thrusters"]
    at = np.arange(len(thrusters))
    figure, axis = plt.subplots(figsize=(max(6.5, 0.6 * len(thrusters)), 2.6))
    axis.bar(at - 0.2, [t["nominal_n"] for t in thrusters], 0.38, color="#d1d5db", label="vehicle file")
    changed = [abs(t["fitted_n"] - t["nominal_n"]) > 1e-9 or t["fitted_shut_n"] > 0.0 for t in thrusters]
    axis.bar(at + 0.2, [t["fitted_n"] for t in thrusters], 0.38, label="fitted",
             color=[NOMINAL if c else FITTED for c in changed])
    shut = [t["fitted_shut_n"] for t in thrusters]
    axis.bar(at + 0.2, shut, 0.38, color="none", edgecolor="#111827", hatch="////", lw=0)
    for x, thruster in zip(at, thrusters):
        if thruster["fitted_n"] == 0.0:
            axis.text(x + 0.2, 0.03, "dead", ha="center", va="bottom", color=NOMINAL, fontsize=8)
    axis.set_xticks(at, [str(t["number"]) for t in thrusters])
    axis.set_xlabel("thruster")
    axis.grid(axis="x", visible=False)
    axis.set_title("Thrust of each valve alone at the end of the flight [N]")
    axis.set_ylim(0, 1.35 * max(max(t["nominal_n"], t["fitted_n"]) for t in thrusters))
    legend = [("vehicle file", {"color": "#d1d5db"}), ("fitted", {"color": FITTED}), ("fitted, differs", {"color": NOMINAL})]
    if any(shut):
        legend.append(("while told to be shut", {"facecolor": "none", "edgecolor": "#111827", "hatch": "////", "lw": 0}))
    axis.legend(handles=[plt.Rectangle((0, 0), 1, 1, **style) for _, style in legend],
                labels=[label for label, _ in legend], ncol=len(legend), loc="upper right", fontsize=8, columnspacing=1.0)
    return figure


def quantity(value, unit, std=None):
    """A number with its standard deviation, as a person reads it; tables are summarised."""
    if isinstance(value, str):
        return f"{html.escape(value)} {html.escape(unit)}"
    if isinstance(value, dict):
        return ", ".join(f"{html.escape(k)} = {quantity(v['value'], v['unit'], (std or {}).get(k))}"
                         for k, v in value.items())
    if isinstance(value, list):
        if value and isinstance(value[0], list):
            return f"{len(value)} × {len(value[0])} values, {html.escape(unit)}"
        if value and isinstance(value[0], dict):
            return f"{len(value)} events"
        return f"({', '.join(f'{v:.4g}' for v in value)}) {html.escape(unit)}"
    unit = "" if unit == "1" else " " + html.escape(unit)
    text = f"{value:.3f}" if abs(value) > 1e5 else f"{value:.4g}"
    return f"{text}{unit}" if std is None else f"{text} ± {std:.2g}{unit}"


def placebo(check):
    parts = []
    if check["wrong_thruster_nats"] is not None:
        parts.append(f"on the wrong thruster (at best {check['wrong_thruster']}) {check['wrong_thruster_nats']:.0f} nats")
    if check["shuffled_commands_nats"] is not None:
        parts.append(f"with the commands in random order {check['shuffled_commands_nats']:.0f} nats")
    if not parts:
        return ""
    return (f"<p><b>Placebo:</b> {', '.join(parts)}, where it is claimed {check['as_claimed_nats']:.0f} "
            "(each in its best strength, all else held).</p>")


def effect_card(effect):
    evidence = effect["evidence"]
    rows = "".join(f"<tr><td>{html.escape(name)}</td><td>{quantity(p['value'], p['unit'], p['std'])}</td></tr>"
                   for name, p in effect["parameters"].items())
    sure = (f"{evidence['log_likelihood_gain']:.0f} nats of likelihood, "
            f"{evidence['heldout_log_likelihood_gain']:.0f} on blocks left out of the fit; kept in "
            f"{100 * evidence['inclusion']:.0f} % of resamples")
    also = placebo(effect["placebo"])
    if effect["indistinguishable_from"]:
        also += "<p><b>Could also be:</b> " + html.escape("; ".join(effect["indistinguishable_from"])) + "</p>"
    if effect["next_experiment"]:
        also += f"<p><b>Fly next:</b> {html.escape(effect['next_experiment'])}</p>"
    statement = effect["statement"][0].upper() + effect["statement"][1:] + "."
    return (f"<div class=card><h3>{html.escape(statement)}</h3><p class=kind>{html.escape(effect['kind'])}</p>"
            f"<table>{rows}</table><p><b>How sure:</b> {sure}.</p>{also}</div>")


def error_table(report):
    horizons = sorted([report["fit"]] + report["fit"]["other_horizons"], key=lambda h: h["horizon_s"])
    rows = ""
    for h in horizons:
        if h["nominal"]["position_rms_m"] is None:
            continue
        cells = "".join(f"<td>{1e3 * h[m]['position_rms_m']:.3g} mm</td>"
                        f"<td>{180 / np.pi * h[m]['yaw_rms_rad']:.3g}°</td>"
                        f"<td>{h[m]['position_fit_percent']:.1f} %</td>"
                        for m in ("nominal", "fitted", "noise_floor"))
        rows += f"<tr><td>{h['horizon_s']:g} s</td><td>{h['windows']}</td>{cells}</tr>"
    return ("<table class=grid><tr><th rowspan=2>horizon</th><th rowspan=2>windows</th><th colspan=3>nominal</th>"
            "<th colspan=3>fitted</th><th colspan=3>noise alone</th></tr><tr>"
            + "<th>position</th><th>yaw</th><th>fit</th>" * 3 + f"</tr>{rows}</table>")


def simulator_check(report):
    """The same in the simulator: model.yaml loaded as it is, the recorded commands flown again."""
    check = report.get("ode_check", {})
    if not check.get("windows"):
        return ""
    on = ("recordings that the fit has not seen" if check["on"] == "held-out"
          else "the recordings that were fitted (there are no held-out ones)")
    rows = "".join(f"<tr><td>{model}</td><td>{1e3 * check[model]['position_rms_m']:.3g} mm</td>"
                   f"<td>{180 / np.pi * check[model]['yaw_rms_rad']:.3g}°</td></tr>" for model in ("nominal", "fitted"))
    floor = report["fit"]["noise_floor"]
    if floor["position_rms_m"] is not None:
        rows += (f"<tr><td>noise alone</td><td>{1e3 * floor['position_rms_m']:.3g} mm</td>"
                 f"<td>{180 / np.pi * floor['yaw_rms_rad']:.3g}°</td></tr>")
    return (f"<h2>In the simulator</h2><p>The ODE simulator loaded model.yaml and flew the recorded commands of {on}, "
            f"{check['windows']} windows of {check['horizon_s']:g} s: what it is off by at their ends. It never lies further "
            f"than {1e3 * check['largest_difference_m']:.2g} mm from this report's own prediction.</p>"
            f"<table class=grid><tr><th>model</th><th>position</th><th>yaw</th></tr>{rows}</table>")


def lies(place):
    """One answer to where, with the share of the mismatch and the one it would have if it were spread evenly."""
    share, even = f"{100 * (place['share'] or 0):.0f} % of the mismatch", f"{100 * (place['even_share'] or 0):.0f} %"
    beside = f"{share}; {even} if all axes had the same" if place["what"] == "axis" else f"{share} in {even} of the time"
    return f"{html.escape(place['statement'])} ({beside})"


def first_sentence(report):
    fit, places = report["fit"], report["mismatch"]["where"]
    parts = []
    if places:
        parts.append(f"Where: {lies(places[0])}.")
    nominal, fitted = fit["nominal"]["position_rms_m"], fit["fitted"]["position_rms_m"]
    if nominal is not None and report["effects"]:
        data = "recordings it has not seen" if fit["on"] == "held-out" else "blocks left out of the fit"
        if fit["on"] != "held-out" and any(e["kind"] == "external_impulse" for e in report["effects"]):
            data += " (pushes as fitted, as nothing else knows of them)"
        parts.append(f"Over {fit['horizon_s']:g} s on {data} the prediction error falls from {1e3 * nominal:.3g} mm "
                     f"to {1e3 * fitted:.3g} mm; noise alone gives "
                     f"{1e3 * fit['noise_floor']['position_rms_m']:.3g} mm.")
    return " ".join(parts)


STYLE = """
body{font:15px/1.5 'DejaVu Sans',system-ui,sans-serif;color:#111827;max-width:1000px;margin:0 auto;padding:24px}
h1{margin:0 0 4px;font-size:28px} h2{font-size:18px;margin:28px 0 8px;border-bottom:1px solid #e5e7eb}
h3{margin:0;font-size:16px} .lead{font-size:16px;margin:4px 0} .kind{color:#6b7280;margin:0 0 6px;font-size:13px}
.card{border:1px solid #e5e7eb;border-left:4px solid #1d6fb8;border-radius:6px;padding:12px 16px;margin:10px 0}
.card p{margin:6px 0} table{border-collapse:collapse;font-size:13px} td,th{padding:2px 12px 2px 0;text-align:left}
.grid th,.grid td{border-bottom:1px solid #e5e7eb;padding:3px 10px;text-align:right}
.words th,.words td{text-align:left} img{max-width:100%;margin:6px 0}
.small{color:#6b7280;font-size:13px}
"""


def page(report, figures):
    title, color, lead = HEADLINES[report["verdict"]]
    mismatch = report["mismatch"]

    def image(name):
        return f"<img alt='{name}' src='data:image/png;base64,{figures[name]}'>" if name in figures else ""

    body = [f"<h1 style='color:{color}'>{title}</h1><p class=lead>{lead} {first_sentence(report)}</p>",
            f"<p class=small>Probability that the nominal model's noise looks like this: "
            f"{'%.2g' % mismatch['p_value'] if mismatch['p_value'] > 0 else 'below 1e-300'}. Recordings: {html.escape(', '.join(r['name'] for r in report['recordings']))}."
            "</p>"]
    if report["effects"]:
        body.append("<h2>What is missing from the simulation</h2>" + "".join(map(effect_card, report["effects"])))
    if report["verdict"] in ("partly_explained", "unexplained"):
        rest = report["unexplained"]
        body.append(f"<h2>What has no name</h2><p>A slow acceleration of "
                    f"{1e3 * (rest['acceleration_rms_m_s2'] or 0):.3g} mm/s² (RMS) remains. It "
                    f"lies in {html.escape(rest['where'] or 'all axes')}.</p>")
    if "prediction" in figures:
        models = "The nominal model" if not report["effects"] else "Nominal against fitted model"
        on = "held-out recordings" if report["fit"]["on"] == "held-out" else "blocks left out of the fit"
        body.append(f"<h2>Before and after</h2><p>{models}, predicting open loop on the recorded commands, on {on}. "
                    f"Every line starts anew each 5 s.</p>{image('prediction')}{error_table(report)}")
    body.append(simulator_check(report))
    body.append(f"<h2>Where</h2>{image('floor')}{image('thrusters')}{image('time')}")
    if mismatch["where"]:
        axes = ", ".join(f"{name} {100 * (share or 0):.0f} %" for name, share in mismatch["axes"].items())
        body.append("<p>Most concentrated first:</p><ul>" + "".join(f"<li>{lies(p)}</li>" for p in mismatch["where"][:5])
                    + f"<li>by axis: {axes}</li></ul>")
    if report["rivals"]:
        rows = "".join(f"<tr><td>{html.escape(r['statement'])}</td>"
                       f"<td>{'instead of ' + r['instead_of'] if r['instead_of'] else 'in addition'}</td>"
                       f"<td>{r['evidence_gain']:.0f}"
                       f"{' against %.0f' % r['evidence_gain_of_claim'] if r['instead_of'] else ''}</td></tr>"
                       for r in report["rivals"][:8] if r["evidence_gain"] is not None)
        body.append("<h2>What else was tried</h2><table class='grid words'><tr><th>candidate</th><th>tried</th>"
                    f"<th>evidence [nats]</th></tr>{rows}</table>")
    if mismatch["smallest_detectable"]:
        rows = "".join(f"<tr><td>{html.escape(kind)}</td><td>{html.escape(s['parameter'])}</td>"
                       f"<td>{quantity(s['value'], s['unit'])}</td></tr>"
                       for kind, s in sorted(mismatch["smallest_detectable"].items()) if s["value"] is not None)
        body.append("<h2>Smallest sizes these recordings would have shown</h2>"
                    f"<table class='grid words'><tr><th>kind</th><th>parameter</th><th>size</th></tr>{rows}</table>")
    warnings = [f"<li>{html.escape(r['name'])}: {html.escape(w)}</li>" for r in report["recordings"]
                for w in r["warnings"]]
    if warnings:
        body.append("<h2>What was wrong with the data</h2><ul>" + "".join(warnings) + "</ul>")
    return (f"<!doctype html><html lang=en><meta charset=utf-8><title>Diagnosis: {title}</title>"
            f"<style>{STYLE}</style><body>{''.join(body)}</body></html>\n")


FIGURES = {"prediction": draw_prediction, "time": draw_time, "floor": draw_floor, "thrusters": draw_thrusters}


def drawn(name, report, plots, folder):
    """Writes one figure; its PNG in base64, None where there is nothing to show."""
    path = os.path.join(folder, "figures", name + ".png")
    if os.path.exists(path):
        os.remove(path)  # of an earlier diagnosis into the same folder
    figure = FIGURES[name](report, plots)
    if figure is None:
        return None
    figure.tight_layout()
    figure.savefig(path)
    with open(path, "rb") as image:
        return base64.b64encode(image.read()).decode()


def main():
    folder = sys.argv[1]
    if not sys.stdin.readline():
        return  # whoever started this has nothing to draw
    with open(os.path.join(folder, "report.json")) as source:
        report = json.load(source)
    with open(os.path.join(folder, "plots.json")) as source:
        plots = json.load(source)
    os.makedirs(os.path.join(folder, "figures"), exist_ok=True)
    with multiprocessing.get_context("fork").Pool(2) as pool:
        images = pool.starmap(drawn, [(name, report, plots, folder) for name in FIGURES])
    figures = {name: image for name, image in zip(FIGURES, images) if image}
    with open(os.path.join(folder, "report.html"), "w") as out:
        out.write(page(report, figures))


if __name__ == "__main__":
    main()
