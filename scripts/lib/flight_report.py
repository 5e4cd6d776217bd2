"""What recorded flights show: metrics as a table and summary.json, the paper's figures as PNG, PDF and SVG, and report.html,
one page that needs no other file. What a recording does not hold is said there, not drawn.

As a library: everything of flight_bag and flight_metrics that a test measures a flight with.
"""
import argparse
import base64
import functools
import gc
import html
import itertools
import json
import math
import os
import sys

import yaml

import figure_style as style
import flight_figures
import stl_figure
from flight_bag import ReportError, default_vehicle, load_flight, load_vehicle, read  # noqa: F401
from flight_metrics import (flight_metrics, separation, setpoint_metrics, stl_metrics,  # noqa: F401
                            trajectory_metrics, vehicle_forces)
from run_configuration import configuration_html, configuration_lines


class Vehicles:
    """The vehicle of each robot: of the file given, else of the recorded configuration, else the default one."""

    def __init__(self, recording, path=None):
        self._recording, self._path = recording, path
        self.source = path or ("the recorded configuration" if recording.file("/nmpc/vehicle") else
                               "config/vehicle/atmos.yaml (none is recorded)")

    def of(self, robot):
        recorded = None if self._path else (self._recording.file(f"/{robot}/nmpc/vehicle") or
                                            self._recording.file("/nmpc/vehicle"))
        return recorded["vehicle"] if recorded else load_vehicle(self._path or default_vehicle())


def floor_of(recording, model_path):
    """The floor that a diagnosis found (model.yaml), else the one the recorded scenario had; None when neither is known."""
    if model_path:
        folder = os.path.dirname(os.path.abspath(model_path))
        with open(model_path) as file:
            effects = yaml.safe_load(file)["effects"]
        floor = flight_figures.floor_of(effects, lambda name: _text(os.path.join(folder, name)))
        return {**floor, "name": "as diagnosed"} if floor else None
    scenario = recording.file("/scenario")
    if not scenario:
        return None
    by_name = {os.path.basename(entry.path): entry.content for entry in recording.configuration.files}
    floor = flight_figures.floor_of(scenario.get("effects"), lambda name: by_name[os.path.basename(name)])
    return {**floor, "name": "as simulated"} if floor else None


def _text(path):
    with open(path) as file:
        return file.read()


def summarise(recording, vehicles):
    """Everything measured: of each robot, of each pair, of the specification."""
    pairs = []
    for first, second in itertools.combinations(recording.robots, 2):
        time, distance = separation(recording.robots[first], recording.robots[second])
        if time.size:
            pairs.append({"robots": [first, second], "least_distance_m": float(distance.min()),
                          "at_s": float(time[distance.argmin()])})
    return {"bags": recording.paths,
            "robots": {name: flight_metrics(flight, vehicles.of(name)) for name, flight in recording.robots.items()},
            "separation": pairs, "stl": stl_metrics(recording.stl) if recording.stl else None}


def _flat(summary):
    """What one robot alone was measured stands at the top of summary.json."""
    rest = {key: value for key, value in summary.items() if key != "robots"}
    return {**next(iter(summary["robots"].values())), **rest} if len(summary["robots"]) == 1 else summary


# ---------------------------------------------------------------- figures

def draw_all(recording, vehicles, floor, folder, formats=style.FORMATS):
    """Writes every figure there is data for. Returns ([(section, title, path without ending)], [(section, title, reason)])."""
    os.makedirs(folder, exist_ok=True)
    drawn, missing = [], []

    def add(section, title, name, draw, reason):
        if reason:
            missing.append((section, title, reason))
            return
        with style.plt.rc_context(style.STYLE):
            style.write(draw(), folder, name, formats)
        drawn.append((section, title, os.path.join(folder, name)))

    if recording.stl or len(recording.robots) == 1:
        add("specification", "Planned and executed robustness", "stl", lambda: stl_figure.draw(recording),
            None if recording.stl else "no /stl/plan and /stl/monitor in the recording")
    if len(recording.robots) > 1:
        add("fleet", "Distance between robots", "separation", lambda: stl_figure.draw_separation(recording), None)
    for robot, flight in recording.robots.items():
        view = flight_figures.View(flight, vehicles.of(robot), floor)
        prefix = "" if len(recording.robots) == 1 else robot + "_"
        for name, (title, draw, why_not) in flight_figures.FIGURES.items():
            add(robot, title, prefix + name, functools.partial(draw, view), why_not(view))
    return drawn, missing


# ---------------------------------------------------------------- words

def _number(value, digits, scale=1.0):
    return "–" if value is None else f"{scale * value:.{digits}f}"


SETPOINT_COLUMNS = [  # heading, unit, value of (set-point, row)
    ("x", "m", lambda s, r: f"{s.x:.2f}"), ("y", "m", lambda s, r: f"{s.y:.2f}"),
    ("yaw", "deg", lambda s, r: f"{math.degrees(s.yaw):.1f}"),
    ("settling", "s", lambda s, r: "never" if r["settling_s"] is None else f"{r['settling_s']:.2f}"),
    ("overshoot", "%", lambda s, r: _number(r["overshoot_ratio"], 2, 100.0)),
    ("steady error", "mm", lambda s, r: _number(r["steady_position_error_m"], 2, 1e3)),
    ("steady yaw", "deg", lambda s, r: _number(r["steady_yaw_error_rad"], 3, 180.0 / math.pi)),
    ("steady RMS", "mm", lambda s, r: _number(r["steady_position_rms_m"], 2, 1e3)),
    ("impulse", "N s", lambda s, r: _number(r["impulse_n_s"], 2)),
    ("gas", "g", lambda s, r: _number(r["gas_kg"], 1, 1e3)),
]


GAS_FROM = {"measured": "as recorded", "open time": "open time at 3.5 g/s"}


def setpoint_table(flight, row):
    """Heading, units and one line per set-point, as text cells."""
    lines = [[str(number)] + [value(s, r) for _, _, value in SETPOINT_COLUMNS]
             for number, (s, r) in enumerate(zip(flight.setpoints, row["setpoints"]), 1)]
    return [["#"] + [name for name, _, _ in SETPOINT_COLUMNS], [""] + [f"[{unit}]" for _, unit, _ in SETPOINT_COLUMNS]] + lines


def totals(row):
    """(what, value) of a robot's whole flight."""
    result = []
    for number, track in enumerate(row["trajectories"], 1):
        name = f"trajectory {number}, {track['duration_s']:.1f} s from {track['start_s']:.1f} s"
        result += [(f"{name}: error RMS, max [mm]", f"{1e3 * track['position_rms_m']:.1f}, {1e3 * track['position_max_m']:.1f}"),
                   (f"{name}: yaw error RMS, max [deg]",
                    f"{math.degrees(track['yaw_rms_rad']):.2f}, {math.degrees(track['yaw_max_rad']):.2f}")]
    if row["impulse_n_s"] is not None:
        histogram = row["duty_histogram"]
        bins = zip(histogram["edges"], histogram["edges"][1:], histogram["share"])
        result += [("impulse asked for [N s]", f"{row['impulse_n_s']:.2f}"),
                   ("thrusters open, all together [s]", f"{sum(row['open_s']):.2f}"),
                   ("commands to a thruster: closed [%]", f"{100 * histogram['closed']:.1f}")]
        result += [(f"commands to a thruster: duty {low:.1f} to {high:.1f} [%]", f"{100 * share:.1f}") for low, high, share in bins]
    if row["gas_kg"] is not None:
        result.append((f"gas [g], {GAS_FROM[row['gas_from']]}", f"{1e3 * row['gas_kg']:.1f}"))
    if row["solve_ms"]:
        solve = row["solve_ms"]
        result += [("NMPC solve time: median, p99, max [ms]", f"{solve['median']:.2f}, {solve['p99']:.2f}, {solve['max']:.2f}"),
                   ("deadline misses", f"{row['deadline_misses']} of {row['solves']}")]
    return result


def common_lines(summary):
    """(what, value) of all robots together."""
    result = [(f"least distance of {' and '.join(p['robots'])}", f"{p['least_distance_m']:.3f} m at {p['at_s']:.1f} s")
              for p in summary["separation"]]
    if summary["stl"]:
        stl = summary["stl"]
        decided = "" if stl["decided"] else ", not decided"
        result += [(f"robustness of {stl['specification']}", f"planned {stl['planned_robustness_m']:.3f} m, "
                    f"executed {stl['executed_robustness_m']:.3f} m ({stl['verdict']}{decided})")]
        result += [(clause["formula"], f"planned {clause['planned_m']:.3f} m, executed {clause['executed_m']:.3f} m "
                    f"({clause['verdict']})") for clause in stl["clauses"]]
    if summary.get("realtime_factor") is not None:
        result.append(("real-time factor", f"{summary['realtime_factor']:.1f}"))
    return result


def print_table(recording, summary):
    for robot, row in summary["robots"].items():
        flight = recording.robots[robot]
        if len(recording.robots) > 1:
            print(f"--- {robot}")
        if row["setpoints"]:
            for cells in setpoint_table(flight, row):
                print(f"{cells[0]:>3}" + "".join(f"{cell:>13}" if i > 2 else f"{cell:>9}" for i, cell in enumerate(cells[1:])))
        for what, value in totals(row):
            print(f"{what}: {value}")
    for what, value in common_lines(summary):
        print(f"{what}: {value}")


CSS = """
:root { --ink: #111827; --soft: #6b7280; --line: #e5e7eb; --accent: #1f6fb4; }
body { font: 15px/1.5 system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; color: var(--ink); max-width: 1120px; margin: 2rem auto;
  padding: 0 1.2rem; }
h1 { font-size: 1.6rem; margin: 0; } h2 { font-size: 1.2rem; margin: 2.2rem 0 .6rem; border-bottom: 2px solid var(--line); padding-bottom: .25rem; }
p.sub { color: var(--soft); margin: .2rem 0 0; }
table { border-collapse: collapse; margin: .6rem 0; } td, th { padding: .22rem .7rem; text-align: right; border-bottom: 1px solid var(--line); }
th { font-weight: 600; } tr.unit td { color: var(--soft); font-size: .85em; } table.words td, table.words th { text-align: left; vertical-align: top; }
figure { margin: 1.2rem 0; } figure img { max-width: 100%; height: auto; } figcaption { color: var(--soft); font-size: .9em; }
div.scroll { overflow-x: auto; } code { font-size: .88em; } td code { word-break: break-all; } details summary { cursor: pointer; color: var(--accent); }
pre { background: #f9fafb; border: 1px solid var(--line); padding: .7rem; overflow-x: auto; font-size: .82em; }
@media print { body { margin: 0; max-width: none; } figure { break-inside: avoid; } }
"""


def _words_table(rows):
    body = "".join(f"<tr><td>{html.escape(what)}</td><td>{html.escape(value)}</td></tr>" for what, value in rows)
    return f'<div class="scroll"><table class="words">{body}</table></div>'


def _cells_table(lines):
    row = lambda cells, tag, mark: f"<tr{mark}>" + "".join(f"<{tag}>{html.escape(c)}</{tag}>" for c in cells) + "</tr>"
    body = row(lines[0], "th", "") + row(lines[1], "td", ' class="unit"') + "".join(row(line, "td", "") for line in lines[2:])
    return f'<div class="scroll"><table>{body}</table></div>'


def _image(path):
    with open(path + ".svg", "rb") as file:
        return "data:image/svg+xml;base64," + base64.b64encode(file.read()).decode()


def write_page(path, recording, summary, drawn, missing, vehicle_source):
    """report.html: tables, figures, what was running, and what the recording does not hold."""
    first = next(iter(recording.robots.values()))
    title = ", ".join(os.path.basename(p) for p in recording.paths)
    parts = [f"<h1>{html.escape(title)}</h1>",
             f'<p class="sub">{html.escape(", ".join(recording.robots))} · {first.end:.1f} s · motion from '
             f"{html.escape(first.motion_source)} · vehicle from {html.escape(vehicle_source)}</p>"]
    common = common_lines(summary)
    if common:
        parts += ["<h2>Flight</h2>", _words_table(common)]

    def figures_of(section):
        return [f'<figure><img alt="{html.escape(title)}" src="{_image(path)}"><figcaption>{html.escape(title)}</figcaption></figure>'
                for owner, title, path in drawn if owner == section]

    parts += figures_of("specification") + figures_of("fleet")
    for robot, row in summary["robots"].items():
        parts.append(f"<h2>{html.escape(robot)}</h2>")
        if row["setpoints"]:
            parts.append(_cells_table(setpoint_table(recording.robots[robot], row)))
        parts.append(_words_table(totals(row)))
        parts += figures_of(robot)
    if missing:
        parts += ["<h2>Not in this recording</h2>",
                  _words_table([(title if len(recording.robots) == 1 else f"{section}: {title}", reason)
                                for section, title, reason in missing])]
    parts += ["<h2>What was running</h2>", configuration_html(recording.configuration)]
    with open(path, "w") as file:
        file.write(f'<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" '
                   f'content="width=device-width"><title>{html.escape(title)}</title><style>{CSS}</style></head><body>'
                   + "\n".join(parts) + "</body></html>\n")


def main():
    parser = argparse.ArgumentParser(prog="scripts/figures", description="Metrics and the paper's figures of a recorded flight.")
    parser.add_argument("bags", nargs="+", metavar="BAG", help="recording; split files and the robots of one flight together")
    parser.add_argument("--out", default="out/figures", help="folder for summary.json, report.html and figures/ (default: %(default)s)")
    parser.add_argument("--vehicle", help="vehicle file (default: the recorded one)")
    parser.add_argument("--model", help="model.yaml of a diagnosis, for the floor map")
    parser.add_argument("--scenario", default="", help="name to report")
    parser.add_argument("--controller", default="", help="name to report")
    parser.add_argument("--sim-summary", help="what the simulator reported, for the real-time factor")
    args = parser.parse_args()
    gc.disable()  # a hundred thousand small objects, none in a cycle: looking for cycles took a fifth of the time
    try:
        recording = read(args.bags)
        vehicles = Vehicles(recording, args.vehicle)
        summary = summarise(recording, vehicles)
        summary["realtime_factor"] = json.loads(_text(args.sim_summary))["realtime_factor"] if args.sim_summary else None
        os.makedirs(args.out, exist_ok=True)
        with open(os.path.join(args.out, "summary.json"), "w") as file:
            json.dump({"scenario": args.scenario, "controller": args.controller, **_flat(summary)}, file, indent=1)
        drawn, missing = draw_all(recording, vehicles, floor_of(recording, args.model), os.path.join(args.out, "figures"))
        write_page(os.path.join(args.out, "report.html"), recording, summary, drawn, missing, vehicles.source)
    except (ReportError, OSError, ValueError, KeyError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print_table(recording, summary)
    for line in configuration_lines(recording.configuration, files=False):
        print(line)
    for section, title, reason in missing:
        print(f"not drawn: {section}: {title}: {reason}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
