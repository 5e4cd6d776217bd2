"""Sums scores up: rows for scripts/bench and a table per kind and size."""
import math
import statistics

from . import scoring


def share(values):
    values = list(values)
    return (sum(map(bool, values)) / len(values), len(values)) if values else (None, 0)


def wilson(p, n):
    """95 % interval of a share."""
    if not n:
        return None
    z = 1.96
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    return [max(0.0, middle - half), min(1.0, middle + half)]


def share_row(name, values):
    p, n = share(values)
    return None if n == 0 else {"name": "blind/" + name, "unit": "share", "value": p, "interval": wilson(p, n), "n": n}


def median_row(name, unit, values):
    values = sorted(v for v in values if v is not None and not math.isnan(v))
    if not values:
        return None
    return {"name": "blind/" + name, "unit": unit, "median": statistics.median(values),
            "p99": values[min(len(values) - 1, int(0.99 * len(values)))], "max": values[-1], "n": len(values)}


def visible(result):
    """Whether an effect is at least twice what the same flight without it states as the smallest detectable; for kinds of
    which nothing is stated: in the upper two thirds of its range."""
    multiple = result["score"]["multiple"]
    return multiple >= scoring.VISIBLE if multiple is not None else result["truth"]["stratum"] >= 1 / 3


def rows(results):
    out = [share_row("failed", ["failure" in r for r in results])] + method_rows(results, "", lambda r: r["score"])
    out += [median_row("diagnosis_wall", "s", [r["wall_s"] for r in results if "wall_s" in r]),
            median_row("diagnosis_cpu", "s", [r["cpu_s"] for r in results if "cpu_s" in r]),
            median_row("diagnosis_memory", "MiB", [r["memory_mib"] for r in results if "memory_mib" in r])]
    for name in sorted({name for r in results for name in r.get("baselines", {})}):
        with_it = [r for r in results if name in r.get("baselines", {})]
        out += method_rows(with_it, f"baseline_{name}/", lambda r: r["baselines"][name])
    return [row for row in out if row]


def method_rows(results, prefix, score_of):
    """The rows of one method; `score_of` a result gives its score."""
    results = [r for r in results if "score" in r]
    by = lambda family: [score_of(r) for r in results if r["family"] == family]
    single, multi, outside = by("single"), by("multi"), by("outside")
    null = by("null") + ([r["twin"] for r in results if "twin" in r] if not prefix else [])
    large = [score_of(r) for r in results if r["family"] == "single" and visible(r)]
    small = [score_of(r) for r in results if r["family"] == "single" and not visible(r)]
    with_size = [r for r in results if r["family"] == "single" and visible(r) and r["score"]["multiple"] is not None]
    without = [r for r in results if r["family"] == "single" and visible(r) and r["score"]["multiple"] is None]
    of = lambda name: prefix + name
    return [
        share_row(of("false_alarm"), [s["detected"] for s in null]),
        share_row(of("false_name"), [bool(s["claims"]) for s in null]),
        share_row(of("detection"), [score_of(r)["detected"] for r in with_size]),
        share_row(of("detection_without_stated_size"), [score_of(r)["detected"] for r in without]),
        share_row(of("right_name_first"), [s["right_first"] for s in large]),
        share_row(of("right_name_first_or_listed"), [s["listed"] for s in large]),
        share_row(of("extra_name"), [bool(s["extra"]) for s in large]),
        share_row(of("wrong_name_when_small"), [bool(s["claims"]) and not s["right_first"] for s in small]),
        share_row(of("right_thruster"), [x for s in single + multi for x in s["thruster_right"]]),
        share_row(of("onset_within_1s"), [x <= 1.0 for s in single + multi for x in s["onset_errors"]]),
        median_row(of("onset_error"), "s", [x for s in single + multi for x in s["onset_errors"] if math.isfinite(x)]),
        median_row(of("parameter_error"), "share", [p["relative_error"] for s in large for p in s["parameters"]]),
        share_row(of("interval_coverage"),
                  [abs(z) <= 1.96 for s in large for p in s["parameters"] for z in p["scores"]]),
        median_row(of("heldout_gain_ratio"), "share", [s["gain_ratio"] for s in large if "gain_ratio" in s]),
        share_row(of("heldout_gain_ratio_above_0.95"), [s["gain_ratio"] >= 0.95 for s in large if "gain_ratio" in s]),
        share_row(of("multi_all_named"), [s["all_named"] for s in multi]),
        share_row(of("multi_all_visible_named"), [s["all_named"] for s in multi if not s["invisible"]]) if not prefix else None,
        share_row(of("multi_right_name_first"), [s["right_first"] for s in multi]),
        share_row(of("multi_extra_name"), [bool(s["extra"]) for s in multi]),
        median_row(of("multi_heldout_gain_ratio"), "share", [s["gain_ratio"] for s in multi if "gain_ratio" in s]),
        share_row(of("outside_no_wrong_name"), [not s["wrong_name"] for s in outside]),
        share_row(of("outside_detection"), [s["detected"] for s in outside]),
        share_row(of("outside_formula"), [s["formula"] for s in outside]),
    ]


BINS = ((0, 1), (1, 2), (2, 5), (5, 20), (20, math.inf))


def cell(values, percent=True):
    p, n = share(values)
    return "" if n == 0 else (f"{100 * p:.0f} %" if percent else f"{p:.2f}")


def middle(values, unit=100.0, digits=1):
    values = [v for v in values if v is not None]
    return f"{unit * statistics.median(values):.{digits}f}" if values else ""


def table_line(label, size, scores):
    errors = [p["relative_error"] for s in scores for p in s["parameters"]]
    covered = [abs(z) <= 1.96 for s in scores for p in s["parameters"] for z in p["scores"]]
    onset = [x for s in scores for x in s["onset_errors"]]
    finite = [x for x in onset if math.isfinite(x)]
    return (f"| {label} | {size} | {len(scores)} | {cell(s['detected'] for s in scores)} | "
            f"{cell(s['right_first'] for s in scores)} | {cell(bool(s['extra']) for s in scores)} | "
            f"{cell(x for s in scores for x in s['thruster_right'])} | {middle(finite, 1.0, 2)} | {middle(errors)} | "
            f"{cell(covered)} | {middle([s.get('gain_ratio') for s in scores], 1.0, 2)} |")


def markdown(results):
    """The table per kind and size, and a list of what needs a look."""
    lines = ["| kind | size / stated smallest | runs | detected | right name first | extra name | right thruster | "
             "onset error, median s | parameter error, median % | 95 % interval covers | gain / oracle's |",
             "|" + "---|" * 11]
    single = [r for r in results if r["family"] == "single" and "score" in r]
    for label in sorted({r["truth"]["label"] for r in single}):
        own = [r for r in single if r["truth"]["label"] == label]
        for low, high in BINS:
            scores = [r["score"] for r in own if r["score"]["multiple"] is not None
                      and low <= r["score"]["multiple"] < high]
            if scores:
                lines.append(table_line(label, f"{low}–{high:g}" if high < math.inf else f"≥ {low}", scores))
        without = [r for r in own if r["score"]["multiple"] is None]
        for third in range(3):
            scores = [r["score"] for r in without if int(3 * r["truth"]["stratum"]) == third]
            if scores:
                lines.append(table_line(label, f"none stated; {('small', 'medium', 'large')[third]}", scores))
    lines += ["", "| law outside the vocabulary | runs | detected | wrong name | formula given |", "|---|---|---|---|---|"]
    outside = [r for r in results if r["family"] == "outside" and "score" in r]
    for label in sorted({r["truth"]["label"] for r in outside}):
        scores = [r["score"] for r in outside if r["truth"]["label"] == label]
        lines.append(f"| {label} | {len(scores)} | {cell(s['detected'] for s in scores)} | "
                     f"{cell(s['wrong_name'] for s in scores)} | {cell(s['formula'] for s in scores)} |")
    lines += ["", "| run that needs a look | truth | claims |", "|---|---|---|"]
    for r in results:
        if "failure" in r:
            lines.append(f"| {r['family']}_{r['index']:04d} | {r['truth']['label']} | {r['failure']} |")
            continue
        if r.get("twin", {}).get("detected"):
            lines.append(f"| {r['family']}_{r['index']:04d}, twin | nothing | {r['twin']['claims'] or 'unexplained'} |")
        if not r["score"]["good"]:
            claims = ", ".join(kind + (f" [{thruster}]" if thruster else "") for kind, thruster, _ in r["score"]["claims"])
            lines.append(f"| {r['family']}_{r['index']:04d} | {r['truth']['label']} | {r['score']['verdict']}: {claims} |")
    return "\n".join(lines) + "\n"
