"""Scores reports against hidden truths (docs/blind.md says how each figure is defined)."""
import csv
import math
import statistics

from . import hidden

# The value at which an effect is absent, where it is not 0.
NEUTRAL = {("mass_error", "factor"): 1.0, ("inertia_error", "factor"): 1.0, ("thrust_scale", "factor"): 1.0,
           ("thruster_efficiency", "factor"): 1.0}
# Parameters that are one quantity: errors are those of the vector.
VECTORS = {"floor_tilt": ("slope_x", "slope_y"), "com_offset": ("x_m", "y_m"), "marker_offset": ("x_m", "y_m")}
# Parameters that say how large an effect is; others (where, which, when) are not judged in percent.
SIZES = {"floor_tilt": ["slope_x"], "tether": ["stiffness_n_m"], "floor_vibration": ["amplitude_n", "frequency_hz"],
         "viscous_drag": ["linear_n_s_m", "angular_n_m_s"], "quadratic_drag": ["coefficient_n_s2_m2"],
         "coulomb_friction": ["coefficient"], "friction_patch": ["coefficient"], "mass_error": ["factor"],
         "inertia_error": ["factor"], "com_offset": ["x_m"], "mass_depletion": ["kg_per_open_second"],
         "slosh": ["mass_kg", "frequency_hz"], "clock_skew": ["ratio"], "thrust_scale": ["factor"],
         "thruster_efficiency": ["factor"], "thruster_leak": ["fraction"], "thruster_misalignment": ["angle_rad"],
         "supply_coupling": ["fraction_per_open_thruster"], "supply_droop": ["loss_per_s", "recovery_s"],
         "pressure_decay": ["fraction_per_kg"], "valve_delay": ["open_s", "close_s"],
         "thrust_rise": ["time_constant_s"], "command_delay": ["delay_s"], "mocap_latency": ["delay_s"],
         "marker_offset": ["x_m"], "yaw_misalignment": ["angle_rad"]}
# Documented sets that pose and command cannot separate: the tool may claim any of a set (docs/effects.md).
SAME = ({"command_delay", "mocap_latency"},)
THRUSTER_KINDS = ("thruster_efficiency", "thruster_dead", "thruster_leak", "thruster_misalignment")
BEARING_M, BEARINGS = 0.15, [math.radians(a) for a in (90, 210, 330)]  # from the geometric centre (docs/effects.md)
STATED_PATCH_M = 0.3  # radius of the patch of which a report states the smallest coefficient
VISIBLE = 2.0  # times the stated smallest size: from there on an effect counts as missed
YAW_ARM = 0.15  # m: turns an error of yaw into one of position, at a bearing


def same_name(claimed, true):
    return claimed == true or any(claimed in group and true in group for group in SAME)


def claims_of(report):
    """The report's effects, the one with the largest gain first."""
    claims = []
    for effect in report["effects"]:
        parameters = effect["parameters"]
        claims.append({"kind": effect["kind"], "gain": effect["evidence"]["log_likelihood_gain"] or 0.0,
                       "thruster": parameters.get("thruster", {}).get("value"),
                       "parameters": {k: (v["value"], v["std"]) for k, v in parameters.items()},
                       "indistinguishable_from": effect["indistinguishable_from"]})
    return sorted(claims, key=lambda claim: -claim["gain"])


def matches(claim, effect):
    """Whether a claim names a true effect, the thruster aside."""
    return same_name(claim["kind"], effect["kind"])


def parameter_errors(claim, effect):
    """[(relative error of the size, error / stated deviation or None)] of a rightly named effect."""
    out = []
    true, kind = effect["parameters"], effect["kind"]
    for name in SIZES.get(kind, []):
        neutral = NEUTRAL.get((kind, name), 0.0)
        names = VECTORS.get(kind) or (name,)
        if not all(n in claim["parameters"] for n in names):
            continue
        size = math.sqrt(sum((true[n] - neutral) ** 2 for n in names))
        error = math.sqrt(sum((claim["parameters"][n][0] - true[n]) ** 2 for n in names))
        scores = [(claim["parameters"][n][0] - true[n]) / claim["parameters"][n][1]
                  for n in names if claim["parameters"][n][1]]
        out.append({"parameter": name, "relative_error": error / size, "scores": scores})
    return out


def onset_errors(claim, effect, flight_start):
    """Errors of times [s]; an event that was not found counts as infinite."""
    if effect["kind"] == "thruster_dead" and claim["kind"] == "thruster_dead":
        true, found = effect["parameters"]["since_s"], claim["parameters"]["since_s"][0]
        return [abs(max(true, flight_start) - max(found, flight_start))]
    if effect["kind"] == "external_impulse" and claim["kind"] == "external_impulse":
        found = [event["time_s"] for event in claim["parameters"]["events"][0]]
        return [min([abs(event["time_s"] - t) for t in found] or [math.inf])
                for event in effect["parameters"]["events"]]
    return []


def rubbed(x, y, radius, shown):
    """Metres that bearings go inside a circle, along rows with x, y and yaw."""
    total, before = 0.0, {}
    for row in shown:
        for angle in BEARINGS:
            at = row["x"] + BEARING_M * math.cos(row["yaw"] + angle), row["y"] + BEARING_M * math.sin(row["yaw"] + angle)
            if math.hypot(at[0] - x, at[1] - y) < radius:
                total += math.dist(before.get(angle, at), at)
            before[angle] = at
    return total


def scatter(points):
    """Root mean square distance of points from their mean."""
    return math.sqrt(statistics.pvariance(p[0] for p in points) + statistics.pvariance(p[1] for p in points))


def pull(tether, row):
    """Force of a tether at a place, its damping aside [N]."""
    away = row["x"] - tether["anchor_x_m"], row["y"] - tether["anchor_y_m"]
    length = math.hypot(*away)
    tension = tether["stiffness_n_m"] * max(0.0, length - tether["slack_m"])
    return [-tension * a / length for a in away]


def size_in_stated_terms(effect, parameter, flight_end, shown):
    """Size of a true effect in the terms in which a report states the smallest detectable one (docs/diagnosis.md)."""
    kind, true = effect["kind"], effect["parameters"]
    if kind == "thruster_dead":
        return min(flight_end - true["since_s"], flight_end - hidden.FIRST_START)
    if kind == "external_impulse":
        return max(math.hypot(event["impulse_x_n_s"], event["impulse_y_n_s"]) for event in true["events"])
    if kind == "floor_vibration":  # stated at 1 Hz; what poses show of a force falls with the frequency squared
        return true["amplitude_n"] / max(1.0, true["frequency_hz"]) ** 2
    if kind == "floor_unevenness":
        return statistics.pstdev([value for row in true["height_m"] for value in row])
    if kind == "airflow":
        return math.sqrt(statistics.fmean(value ** 2 for name in ("force_x_n", "force_y_n") for row in true[name]
                                          for value in row))
    if kind == "tether":  # stated of one that is always taut: of which stiffness would such a one pull as differently?
        return scatter([pull(true, row) for row in shown]) / scatter([(row["x"], row["y"]) for row in shown])
    if kind == "friction_patch":  # stated of one where the robot was half-way; evidence grows with the way that is rubbed
        half_way = shown[len(shown) // 2]
        stated = rubbed(half_way["x"], half_way["y"], STATED_PATCH_M, shown)
        return true["coefficient"] * math.sqrt(
            rubbed(true["center_x_m"], true["center_y_m"], true["radius_m"], shown) / stated)
    neutral = NEUTRAL.get((kind, parameter), 0.0)
    return math.sqrt(sum((true[n] - neutral) ** 2 for n in VECTORS.get(kind) or (parameter,)))


def stated_multiple(effect, stated_sizes, duration, shown):
    """Size of an effect in multiples of what a report states as the smallest detectable; None where it states none. `shown`: rows
    with x, y and yaw of the flight."""
    stated = stated_sizes.get(effect["kind"])
    if not stated or not stated["value"]:
        return None
    return size_in_stated_terms(effect, stated["parameter"], hidden.FIRST_START + duration, shown) / abs(stated["value"])


def score_null(report):
    """What a recording with nothing wrong gave."""
    return {"verdict": report["verdict"], "p_value": report["mismatch"]["p_value"],
            "claims": [(c["kind"], c["thruster"], c["gain"]) for c in claims_of(report)],
            "detected": report["verdict"] != "consistent", "stated": report["mismatch"]["smallest_detectable"]}


def read_table(path):
    with open(path) as table:
        return [{k: float(v) for k, v in row.items()} for row in csv.DictReader(table)]


def interpolated(table, stamp, low=0):
    """x, y, yaw of the shown motion at a stamp; rows ascend in stamp."""
    high = len(table) - 1
    if not table[0]["stamp"] <= stamp <= table[-1]["stamp"]:
        return None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if table[middle]["stamp"] <= stamp else (low, middle)
    a, b = table[low], table[high]
    u = (stamp - a["stamp"]) / (b["stamp"] - a["stamp"])
    return [a[k] + u * (b[k] - a[k]) for k in ("x", "y", "yaw")]


def prediction_error(predicted, shown):
    """Root mean square at the windows' ends, yaw counted at a bearing's distance [m]; infinite where a model runs away."""
    errors = []
    for row, after in zip(predicted, predicted[1:] + [None]):
        if after is not None and after["window_start"] == row["window_start"]:
            continue
        at = interpolated(shown, row["stamp"])
        if at is None:
            continue
        if not all(math.isfinite(row[k]) for k in ("x", "y", "yaw")):
            return math.inf
        turn = math.remainder(row["yaw"] - at[2], 2 * math.pi)
        errors.append(math.hypot(row["x"] - at[0], row["y"] - at[1], YAW_ARM * turn))
    return math.hypot(*errors) / math.sqrt(len(errors)) if errors else None


def score(truth, report, errors, flight_start, shown):
    """All that is counted of one run. `errors`: prediction errors on the second flight of nominal, fitted, oracle; `shown`: rows
    with x and y of the diagnosed flight."""
    claims = claims_of(report)
    real = [c for c in claims if c["kind"] != "unmodelled"]
    result = {"verdict": report["verdict"], "p_value": report["mismatch"]["p_value"],
              "claims": [(c["kind"], c["thruster"], c["gain"]) for c in claims],
              "detected": report["verdict"] != "consistent", "errors": errors}
    effects = truth["effects"]
    family = truth["family"]
    if family == "outside":
        result["wrong_name"] = any(c["kind"] not in truth["accepted"] for c in real)
        result["formula"] = any(c["kind"] == "unmodelled" for c in claims)
    elif effects:
        first = claims[0] if claims else None
        result["right_first"] = first is not None and any(matches(first, e) for e in effects)
        result["listed"] = result["right_first"] or (
            first is not None and any(e["kind"] in text for e in effects for text in first["indistinguishable_from"]))
        unnamed = [e for e in effects if not any(matches(c, e) for c in claims)]
        result["all_named"] = not unnamed
        stated = report["mismatch"]["smallest_detectable"]
        multiples = [stated_multiple(e, stated, truth["duration_s"], shown) for e in unnamed] if stated else []
        result["invisible"] = [e["kind"] for e, size in zip(unnamed, multiples) if size is not None and size < VISIBLE]
        result["extra"] = [c["kind"] for c in claims if not any(matches(c, e) for e in effects)]
        thruster, onset, parameters = [], [], []
        for effect in effects:
            named = [c for c in claims if matches(c, effect)]
            if not named:
                continue
            own = effect["parameters"].get("thruster")
            if own is not None:
                thruster.append(any(c["thruster"] == own for c in named))
                named = [c for c in named if c["thruster"] == own]
            for claim in named[:1]:
                onset += onset_errors(claim, effect, flight_start)
                parameters += parameter_errors(claim, effect)
        result.update(thruster_right=thruster, onset_errors=onset, parameters=parameters)
    if errors and errors.get("oracle") is not None and errors["nominal"] - errors["oracle"] > 0.1 * errors["nominal"]:
        result["gain_ratio"] = (errors["nominal"] - errors["fitted"]) / (errors["nominal"] - errors["oracle"])
    result["good"] = is_good(family, result)
    return result


def is_good(family, result):
    """Whether a run needs no second look."""
    if family == "null":
        return not result["detected"]
    if family == "outside":
        return not result["wrong_name"]
    return bool(result["all_named"] and not result["extra"] and all(result["thruster_right"]))
