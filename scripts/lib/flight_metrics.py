"""What a flight was worth, in numbers: set-points, trajectories, solver, valves and gas, distance of robots, specification."""
import math

import numpy as np

from flight_bag import ReportError, SetPoint, thrusters_of, load_vehicle, wrap

SETTLED_POSITION_M = 0.05
SETTLED_YAW_RAD = math.radians(5.0)
STEADY_WINDOW_S = 5.0
# A step smaller than this on an axis is not a commanded one: its overshoot has no meaning.
COMMANDED_STEP_M = 1e-3
COMMANDED_STEP_RAD = math.radians(0.1)
KG_PER_OPEN_SECOND = 0.0035  # one open thruster (paper, "Actuation Modules")
DUTY_EDGES = np.array([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
CLOSED = 0.005  # a duty below opens no valve
VERDICTS = ("open", "satisfied", "violated")  # StlClause.msg


def windows(flight):
    """(set-point, one before it, end of its window) in order; before the first stands the measured start."""
    motion = flight.motion
    first = int(np.argmin(np.abs(motion.time)))
    before = SetPoint(0.0, motion.x[first], motion.y[first], motion.yaw[first])
    ends = [s.time for s in flight.setpoints[1:]] + [flight.end + 1e-6]
    # A trajectory takes the place of the set-point it starts in.
    starts = [t.time[0] for t in flight.trajectories]
    ends = [min([end] + [t for t in starts if s.time < t < end]) for s, end in zip(flight.setpoints, ends)]
    for setpoint, end in zip(flight.setpoints, ends):
        yield setpoint, before, end
        before = setpoint


def _overshoot(travel, step, threshold):
    """Greatest travel beyond the target, as a share of the step; 0 on an axis that is not commanded."""
    return max(0.0, float(np.max(travel * math.copysign(1.0, step) - abs(step)))) / abs(step) \
        if abs(step) > threshold else 0.0


def vehicle_forces(path):
    """Thrust of each valve of a vehicle file, N."""
    return forces_of(load_vehicle(path))


def forces_of(vehicle):
    return np.array([t["force_n"] for t in thrusters_of(vehicle)])


def _open_time(flight, begin, end):
    """Commanded open time of each thruster in [begin, end), s."""
    inside = (flight.command_time >= begin - 1e-6) & (flight.command_time < end - 1e-6)
    if not inside.any():
        return np.zeros(flight.duty.shape[1])
    return (np.abs(flight.duty[inside]) * flight.command_period[inside, None]).sum(axis=0)


def _gas(flight, begin, end):
    """(kg used in [begin, end), where that is from)."""
    if len(flight.air):
        used = np.interp([begin, min(end, flight.end)], flight.air[:, 0], flight.air[:, 1])
        return float(used[1] - used[0]), "measured"
    if flight.duty.size == 0 or flight.duty.min() < 0.0:
        return None, None
    return KG_PER_OPEN_SECOND * float(_open_time(flight, begin, end).sum()), "open time"


def setpoint_metrics(flight, forces_n):
    """One dictionary per set-point, keys as in summary.json.

    forces_n: thrust of each valve. Settling: from the step until the robot stays within 5 cm and 5 deg (null: never).
    Overshoot: on commanded axes, over the step. Steady error: norm of the mean error over the last 5 s before the next
    set-point; steady RMS: of the position error over the same time. Impulse: commanded open time times nominal thrust.
    """
    motion, result = flight.motion, []
    for setpoint, before, end in windows(flight):
        inside = (motion.time >= setpoint.time) & (motion.time < end)
        t = motion.time[inside]
        if t.size == 0:
            raise ReportError(f"{flight.bag}: no motion recorded for the set-point at {setpoint.time:.1f} s")
        ex, ey = motion.x[inside] - setpoint.x, motion.y[inside] - setpoint.y
        eyaw = wrap(motion.yaw[inside] - setpoint.yaw)
        distance = np.hypot(ex, ey)

        outside = np.flatnonzero((distance > SETTLED_POSITION_M) | (np.abs(eyaw) > SETTLED_YAW_RAD))
        if outside.size == 0:
            settling = 0.0
        elif outside[-1] + 1 < t.size:
            settling = float(t[outside[-1] + 1] - setpoint.time)
        else:
            settling = None

        step_x, step_y = setpoint.x - before.x, setpoint.y - before.y
        step_yaw = float(wrap(setpoint.yaw - before.yaw))
        overshoot = max(_overshoot(ex + step_x, step_x, COMMANDED_STEP_M),
                        _overshoot(ey + step_y, step_y, COMMANDED_STEP_M),
                        _overshoot(eyaw + step_yaw, step_yaw, COMMANDED_STEP_RAD))

        last = t >= min(end, flight.end) - STEADY_WINDOW_S
        flown = flight.duty.size > 0
        result.append({
            "settling_s": settling,
            "overshoot_ratio": overshoot,
            "steady_position_error_m": float(math.hypot(ex[last].mean(), ey[last].mean())),
            "steady_yaw_error_rad": float(abs(eyaw[last].mean())),
            "steady_position_rms_m": float(np.sqrt(np.mean(distance[last] ** 2))),
            "impulse_n_s": float((_open_time(flight, setpoint.time, end) * forces_n).sum()) if flown else None,
            "gas_kg": _gas(flight, setpoint.time, end)[0],
        })
    return result


def trajectory_metrics(flight):
    """One dictionary per trajectory: distance and yaw between robot and reference at the same time, while it lasts."""
    result = []
    for trajectory in flight.trajectories:
        motion = flight.motion
        inside = (motion.time >= trajectory.time[0]) & (motion.time <= trajectory.time[-1])
        t = motion.time[inside]
        if t.size == 0:
            continue
        distance = np.hypot(motion.x[inside] - np.interp(t, trajectory.time, trajectory.x),
                            motion.y[inside] - np.interp(t, trajectory.time, trajectory.y))
        yaw = wrap(motion.yaw[inside] - np.interp(t, trajectory.time, trajectory.yaw))
        result.append({"start_s": float(trajectory.time[0]), "duration_s": float(trajectory.time[-1] - trajectory.time[0]),
                       "position_rms_m": float(np.sqrt(np.mean(distance ** 2))), "position_max_m": float(distance.max()),
                       "yaw_rms_rad": float(np.sqrt(np.mean(yaw ** 2))), "yaw_max_rad": float(np.abs(yaw).max())})
    return result


def solve_metrics(flight):
    """Solve times [ms] and deadline misses: commands more than one period after the stamp of their odometry."""
    if flight.solve_s.size == 0:
        return {"solve_ms": None, "solves": 0, "deadline_misses": None}
    ms = 1e3 * flight.solve_s
    return {"solve_ms": {"median": float(np.median(ms)), "p99": float(np.percentile(ms, 99)), "max": float(ms.max())},
            "solves": int(ms.size), "deadline_misses": flight.deadline_misses}


def duty_shares(flight):
    """thrusters x (closed, then one per bin of DUTY_EDGES): share of the commands."""
    duty = np.abs(flight.duty)
    closed = (duty <= CLOSED).mean(axis=0)
    bins = [((duty > max(low, CLOSED)) & (duty <= high)).mean(axis=0) for low, high in zip(DUTY_EDGES, DUTY_EDGES[1:])]
    return np.column_stack([closed] + bins)


def valve_metrics(flight, forces_n):
    """Impulse, open time, gas and the distribution of the duties over the whole flight; None without commands."""
    if flight.duty.size == 0:
        return {"impulse_n_s": None, "open_s": None, "gas_kg": None, "gas_from": None, "duty_histogram": None}
    open_time = _open_time(flight, -np.inf, np.inf)
    gas, source = _gas(flight, flight.command_time[0], flight.end)
    shares = duty_shares(flight)
    return {"impulse_n_s": float((open_time * forces_n).sum()), "open_s": [float(t) for t in open_time],
            "gas_kg": gas, "gas_from": source,
            "duty_histogram": {"edges": DUTY_EDGES.tolist(), "closed": float(shares[:, 0].mean()),
                               "share": shares[:, 1:].mean(axis=0).tolist()}}


def flight_metrics(flight, vehicle):
    """Everything that is measured of one robot; keys as in summary.json."""
    forces = forces_of(vehicle)
    if flight.duty.size and len(forces) != flight.duty.shape[1]:
        raise ReportError(f"{flight.bag}: {flight.duty.shape[1]} duties, but the vehicle has {len(forces)} thrusters")
    return {"setpoints": setpoint_metrics(flight, forces), "trajectories": trajectory_metrics(flight),
            **valve_metrics(flight, forces), **solve_metrics(flight)}


def separation(first, second):
    """(times s since the start of `first`, distance of the centres) over the time both are recorded."""
    shift = second.start - first.start
    t = first.motion.time
    other = second.motion.time + shift
    t = t[(t >= other[0]) & (t <= other[-1])]
    at = lambda values, times: np.interp(t, times, values)
    return t, np.hypot(at(first.motion.x, first.motion.time) - at(second.motion.x, other),
                       at(first.motion.y, first.motion.time) - at(second.motion.y, other))


def stl_metrics(stl):
    """What was planned under the specification and what came of it."""
    last = stl.monitor[-1]
    return {"specification": stl.plan.specification, "planned_robustness_m": stl.plan.robustness,
            "executed_robustness_m": last.robustness_low, "decided": last.robustness_low == last.robustness_high,
            "verdict": VERDICTS[last.verdict], "replans": stl.plan.replans,
            "clauses": [{"formula": c.formula, "planned_m": c.planned_robustness, "executed_m": c.robustness_low,
                         "verdict": VERDICTS[c.verdict]} for c in last.clauses]}


# ---------------------------------------------------------------- what the motion says of thrust and floor

GRAVITY = 9.81


class Impulses:
    """Per PWM period: the impulse that was measured, the one asked for, and the share of it that open neighbours take.

    Pulses begin together, so that thrusters i and j are open at once for min(u_i, u_j) of the period; by the paper's law a
    thruster loses a fraction c for each other open one. World frame, N s.
    """

    def __init__(self, flight, vehicle):
        motion, thrusters = flight.motion, thrusters_of(vehicle)
        direction = np.array([t["direction"][:2] for t in thrusters], dtype=float)
        direction /= np.maximum(np.linalg.norm(direction, axis=1), 1e-9)[:, None]
        force = forces_of(vehicle)[:, None] * direction
        begin = flight.command_time
        inside = (begin >= motion.time[0]) & (begin + flight.command_period <= motion.time[-1])
        duty, period = flight.duty[inside], flight.command_period[inside]
        self.begin, self.period = begin[inside], period
        both = np.minimum(np.abs(duty)[:, :, None], np.abs(duty)[:, None, :])
        overlap = both.sum(axis=2) - np.abs(duty)  # of thruster i with all others, in periods
        # A pulse acts while the robot turns: yaw in the middle of it.
        half = self.begin[:, None] + 0.5 * np.abs(duty) * period[:, None]
        yaw = np.interp(half, motion.time, motion.yaw)
        turned = np.stack([np.cos(yaw) * force[:, 0] - np.sin(yaw) * force[:, 1],
                           np.sin(yaw) * force[:, 0] + np.cos(yaw) * force[:, 1]], axis=-1)
        self.asked = (duty[:, :, None] * turned).sum(axis=1) * period[:, None]
        self.taken = (np.sign(duty)[:, :, None] * overlap[:, :, None] * turned).sum(axis=1) * period[:, None]
        weight = np.abs(duty).sum(axis=1)
        self.others = np.divide(overlap.sum(axis=1), weight, out=np.zeros(len(weight)), where=weight > 0)
        change = lambda values: np.interp(self.begin + period, motion.time, values) - np.interp(self.begin, motion.time, values)
        self.measured = vehicle["mass_kg"] * np.column_stack([change(motion.vx), change(motion.vy)])
        middle = self.begin + 0.5 * period
        self.place = np.column_stack([np.interp(middle, motion.time, motion.x), np.interp(middle, motion.time, motion.y)])
        self.mass = vehicle["mass_kg"]


def strong_periods(impulses):
    """Which periods ask for so much that floor and valve delays weigh little."""
    size = np.linalg.norm(impulses.asked, axis=1)
    return size > 0.2 * size.max(initial=0.0)


def coupling(impulses):
    """(c, its standard deviation): loss of thrust per further open thruster, by least squares over the periods with much thrust,
    together with a constant push; None when too few of them have two thrusters open at once."""
    strong = strong_periods(impulses)
    asked, taken, measured = impulses.asked[strong], impulses.taken[strong], impulses.measured[strong]
    if (np.linalg.norm(taken, axis=1) > 0.2 * np.linalg.norm(asked, axis=1)).sum() < 20:
        return None
    push = impulses.period[strong][:, None]
    zeros = np.zeros_like(push)
    matrix = np.vstack([np.hstack([asked[:, :1], -taken[:, :1], push, zeros]),
                        np.hstack([asked[:, 1:], -taken[:, 1:], zeros, push])])
    target = np.concatenate([measured[:, 0], measured[:, 1]])
    solution, _, rank, _ = np.linalg.lstsq(matrix, target, rcond=None)
    if rank < 4 or solution[0] <= 0.0:
        return None
    scatter = np.var(target - matrix @ solution)
    covariance = scatter * np.linalg.inv(matrix.T @ matrix)
    return float(solution[1] / solution[0]), float(math.sqrt(covariance[1, 1]) / solution[0])


def floor_push(impulses, loss, cell_m=0.15, least_s=1.0):
    """Rows of place x, y [m] and push x, y [m/s^2]: mean acceleration that the thrusters do not explain, per cell of the floor
    in which the robot was for at least `least_s`."""
    rest = impulses.measured - impulses.asked + loss * impulses.taken
    cells = np.floor(impulses.place / cell_m).astype(int)
    rows = []
    for cell in np.unique(cells, axis=0):
        inside = (cells == cell).all(axis=1)
        time = impulses.period[inside].sum()
        if time >= least_s:
            rows.append((*impulses.place[inside].mean(axis=0), *(rest[inside].sum(axis=0) / time / impulses.mass)))
    return np.array(rows).reshape(-1, 4)
