"""What a recorded flight shows: metrics of set-point flights, and figures laid out like the paper's.

As a library: load_flight(), setpoint_metrics(), solve_metrics() and the draw_* functions, each of which takes a Flight.
As a program: writes summary.json and figures/*.png of one bag and prints the table.
"""
import argparse
import json
import math
import os
import sys
from dataclasses import dataclass

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
import rosbag  # noqa: E402
import yaml  # noqa: E402

SETTLED_POSITION_M = 0.05
SETTLED_YAW_RAD = math.radians(5.0)
STEADY_WINDOW_S = 5.0
# A step smaller than this on an axis is not a commanded one: its overshoot has no meaning.
COMMANDED_STEP_M = 1e-3
COMMANDED_STEP_RAD = math.radians(0.1)

# NmpcStatus.msg
MODE_WAITING = 4
SOLVER_NOT_RUN = 8


class ReportError(Exception):
    """The bag cannot be reported on; the text says why."""


@dataclass
class Motion:
    """Planar motion of base_link: time [s since the start of the flight], pose and velocity in the world frame."""
    time: np.ndarray
    x: np.ndarray
    y: np.ndarray
    yaw: np.ndarray  # unwrapped, rad
    vx: np.ndarray
    vy: np.ndarray
    yaw_rate: np.ndarray


@dataclass
class SetPoint:
    time: float
    x: float
    y: float
    yaw: float


@dataclass
class Trajectory:
    """A trajectory while it is in force: time [s since the start of the flight], pose in the world frame."""
    time: np.ndarray
    x: np.ndarray
    y: np.ndarray
    yaw: np.ndarray  # unwrapped, rad


@dataclass
class Flight:
    """One recorded flight. Times are seconds since `start` (ROS time of the first set-point)."""
    bag: str
    start: float
    end: float
    setpoints: list
    trajectories: list
    motion: Motion          # of sim/truth where recorded, else of odometry
    motion_source: str
    command_time: np.ndarray
    command_period: np.ndarray
    duty: np.ndarray        # commands x thrusters
    solve_time: np.ndarray  # of the statuses in which the solver ran, s since start
    solve_s: np.ndarray
    deadline_misses: int
    wrench: np.ndarray       # rows of time, force x, force y [N], torque z [N m]; no rows: not at this level
    disturbance: np.ndarray  # rows of time, d_v x, y [m/s^2, world], d_w z [rad/s^2]; no rows: no observer


def yaw_of(q):
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))


def wrap(angle):
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def _messages_by_name(bag, names, robot):
    """Messages of the robot's topics, keyed by the topic's name relative to the robot's namespace."""
    topics = {f"/{robot}/{name}": name for name in names}
    found = {name: [] for name in names}
    for topic, message, _ in bag.read_messages(topics=list(topics)):
        found[topics[topic]].append(message)
    return found


def _robot_of(bag):
    """Namespace of the recording's robot: where thruster_command is."""
    for topic, info in bag.get_type_and_topic_info().topics.items():
        if topic.endswith("/thruster_command") and info.msg_type == "atmos_msgs/ThrusterCommand":
            return topic[1:-len("/thruster_command")]
    raise ReportError("no thruster_command in the bag")


def _motion(messages, start):
    rows = np.array([(m.header.stamp.to_sec() - start, m.pose.pose.position.x, m.pose.pose.position.y,
                      yaw_of(m.pose.pose.orientation), m.twist.twist.linear.x, m.twist.twist.linear.y,
                      m.twist.twist.angular.z) for m in messages])
    t, x, y, yaw, u, v, yaw_rate = rows.T
    c, s = np.cos(yaw), np.sin(yaw)
    return Motion(t, x, y, np.unwrap(yaw), c * u - s * v, s * u + c * v, yaw_rate)


def _trajectory(message, start):
    begin = message.header.stamp.to_sec() - start
    rows = np.array([(begin + point.time_from_start.to_sec(), point.transforms[0].translation.x,
                      point.transforms[0].translation.y, yaw_of(point.transforms[0].rotation))
                     for point in message.points])
    return Trajectory(rows[:, 0], rows[:, 1], rows[:, 2], np.unwrap(rows[:, 3]))


def _next_start(time, setpoints, end):
    """When what started at `time` is replaced by a set-point, or the flight ends."""
    return min([s.time for s in setpoints if s.time > time] + [end])


def _until(trajectory, end):
    inside = trajectory.time <= end + 1e-6
    return Trajectory(*(values[inside] for values in (trajectory.time, trajectory.x, trajectory.y, trajectory.yaw)))


def load_flight(path, robot=None):
    """Reads a bag. Raises ReportError when a needed topic is missing."""
    try:
        bag = rosbag.Bag(path)
    except (OSError, rosbag.ROSBagException) as error:
        raise ReportError(f"{path}: {error}") from error
    with bag:
        names = ("setpoint", "trajectory", "sim/truth", "odometry", "thruster_command", "nmpc/status", "nmpc/wrench", "disturbance")
        found = _messages_by_name(bag, names, robot or _robot_of(bag))
    for name in ("setpoint", "thruster_command"):
        if not found[name]:
            raise ReportError(f"{path}: no {name} in the bag")
    source = "sim/truth" if found["sim/truth"] else "odometry"
    if not found[source]:
        raise ReportError(f"{path}: neither sim/truth nor odometry in the bag")

    by_stamp = {m.header.stamp.to_sec(): m.pose for m in found["setpoint"]}
    start = min(by_stamp)
    motion = _motion(found[source], start)
    end = float(motion.time[-1])
    setpoints = [SetPoint(stamp - start, p.position.x, p.position.y, yaw_of(p.orientation))
                 for stamp, p in sorted(by_stamp.items()) if stamp - start < end]

    trajectories = {m.header.stamp.to_sec(): _trajectory(m, start) for m in found["trajectory"]}
    commands = found["thruster_command"]
    solved = [m for m in found["nmpc/status"] if m.mode != MODE_WAITING and m.solver != SOLVER_NOT_RUN]
    return Flight(
        bag=path, start=start, end=end, setpoints=setpoints,
        trajectories=[_until(trajectories[stamp], _next_start(stamp - start, setpoints, end))
                      for stamp in sorted(trajectories) if stamp - start < end],
        motion=motion, motion_source=source,
        command_time=np.array([m.header.stamp.to_sec() - start for m in commands]),
        command_period=np.array([m.period for m in commands]),
        duty=np.array([m.duty for m in commands]),
        solve_time=np.array([m.header.stamp.to_sec() - start for m in solved]),
        solve_s=np.array([m.solve_time for m in solved]),
        deadline_misses=max((m.deadline_misses for m in found["nmpc/status"]), default=0),
        wrench=np.array([(m.header.stamp.to_sec() - start, m.wrench.force.x, m.wrench.force.y, m.wrench.torque.z)
                         for m in found["nmpc/wrench"]]).reshape(-1, 4),
        disturbance=np.array([(m.header.stamp.to_sec() - start, m.linear_acceleration.x, m.linear_acceleration.y,
                               m.angular_acceleration.z) for m in found["disturbance"]]).reshape(-1, 4))


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
        commanded = (flight.command_time >= setpoint.time - 1e-6) & (flight.command_time < end - 1e-6)
        open_time = np.abs(flight.duty[commanded]) * flight.command_period[commanded, None]
        result.append({
            "settling_s": settling,
            "overshoot_ratio": overshoot,
            "steady_position_error_m": float(math.hypot(ex[last].mean(), ey[last].mean())),
            "steady_yaw_error_rad": float(abs(eyaw[last].mean())),
            "steady_position_rms_m": float(np.sqrt(np.mean(distance[last] ** 2))),
            "impulse_n_s": float((open_time * forces_n).sum()),
        })
    return result


def trajectory_metrics(flight):
    """One dictionary per trajectory: distance and yaw between robot and reference at the same time, while it lasts."""
    result = []
    for trajectory in flight.trajectories:
        motion = flight.motion
        inside = (motion.time >= trajectory.time[0]) & (motion.time <= trajectory.time[-1])
        t = motion.time[inside]
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
        return {"solve_ms": None, "deadline_misses": None}
    ms = 1e3 * flight.solve_s
    return {"solve_ms": {"median": float(np.median(ms)), "p99": float(np.percentile(ms, 99)), "max": float(ms.max())},
            "deadline_misses": flight.deadline_misses}


def vehicle_forces(path):
    with open(path) as file:
        vehicle = yaml.safe_load(file)["vehicle"]
    return np.array([t["force_n"] for t in vehicle.get("propellers") or vehicle["thrusters"]])


# ---------------------------------------------------------------- figures

BLUE, ORANGE, GREEN, GREY = "#1f6fb4", "#e07b1a", "#2a9d57", "#6b7280"
STYLE = {
    "font.size": 10, "axes.titlesize": 11, "axes.labelsize": 10, "axes.spines.top": False, "axes.spines.right": False,
    "axes.grid": True, "axes.axisbelow": True, "grid.color": "#e5e7eb", "grid.linewidth": 0.8, "axes.edgecolor": "#9ca3af",
    "xtick.color": "#374151", "ytick.color": "#374151", "axes.labelcolor": "#111827", "legend.frameon": False,
    "lines.linewidth": 1.6, "figure.dpi": 130, "savefig.bbox": "tight",
}


def reference_curve(flight, value):
    """Step curve of one coordinate of the set-points."""
    times, values = [], []
    for setpoint, _, end in windows(flight):
        times += [setpoint.time, min(end, flight.end)]
        values += [value(setpoint)] * 2
    return times, values


def continuous_yaw(flight):
    """Set-point yaws on the same branch as the measured, unwrapped yaw."""
    result = {}
    for setpoint, _, end in windows(flight):
        at_end = flight.motion.yaw[np.searchsorted(flight.motion.time, min(end, flight.end)) - 1]
        result[setpoint.time] = at_end + float(wrap(setpoint.yaw - at_end))
    return result


def _coordinate(flight, trajectory, label):
    """What belongs to an axis of draw_states; yaw on the branch of the measured one."""
    if label.startswith("yaw"):
        at_start = flight.motion.yaw[np.searchsorted(flight.motion.time, trajectory.time[0])]
        return np.degrees(trajectory.yaw + 2.0 * np.pi * np.round((at_start - trajectory.yaw[0]) / (2.0 * np.pi)))
    return trajectory.x if label.startswith("x") else trajectory.y


def mark_steps(axes, flight):
    for setpoint in flight.setpoints[1:]:
        axes.axvline(setpoint.time, color="#d1d5db", linewidth=0.9, zorder=0)
    axes.set_xlim(0, flight.end)


def draw_states(flight):
    """States against references: x, y, yaw in the left column, their rates in the right one."""
    motion, yaw = flight.motion, continuous_yaw(flight)
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(3, 2, figsize=(11, 6.6), sharex=True, constrained_layout=True)
        degrees = np.degrees
        rows = [("x [m]", motion.x, lambda s: s.x, "$v_x$ [m/s]", motion.vx),
                ("y [m]", motion.y, lambda s: s.y, "$v_y$ [m/s]", motion.vy),
                ("yaw [deg]", degrees(motion.yaw), lambda s: degrees(yaw[s.time]), "yaw rate [deg/s]",
                 degrees(motion.yaw_rate))]
        for (left, right), (label, values, reference, rate_label, rates) in zip(axes, rows):
            left.plot(*reference_curve(flight, reference), color=ORANGE, linestyle="--", linewidth=1.3, label="reference")
            for trajectory in flight.trajectories:
                left.plot(trajectory.time, _coordinate(flight, trajectory, label), color=ORANGE, linestyle="--", linewidth=1.3)
            left.plot(motion.time, values, color=BLUE, label=flight.motion_source)
            left.set_ylabel(label)
            right.plot(motion.time, rates, color=BLUE, linewidth=1.1)
            right.axhline(0.0, color=ORANGE, linestyle="--", linewidth=1.1)
            right.set_ylabel(rate_label)
            mark_steps(left, flight)
            mark_steps(right, flight)
        axes[0, 0].set_title("pose", loc="left")
        axes[0, 0].legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncol=2, borderaxespad=0.0)
        axes[0, 1].set_title("velocity", loc="left")
        for bottom in axes[-1]:
            bottom.set_xlabel("time [s]")
        figure.align_ylabels()
    return figure


def draw_inputs(flight):
    """The thruster inputs, normalised to full thrust."""
    count = flight.duty.shape[1]
    rows = (count + 1) // 2
    edges = np.append(flight.command_time, flight.command_time[-1] + flight.command_period[-1])
    lowest = -1.0 if flight.duty.min() < 0.0 else 0.0
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(rows, 2, figsize=(11, 1.45 * rows + 0.6), sharex=True, sharey=True,
                                    constrained_layout=True, squeeze=False)
        for i in range(count):
            panel = axes[i // 2, i % 2]
            panel.stairs(flight.duty[:, i], edges, color=BLUE, fill=True, alpha=0.35)
            panel.stairs(flight.duty[:, i], edges, color=BLUE, linewidth=0.7)
            panel.set_ylabel(f"$u_{{{i + 1}}}$", rotation=0, labelpad=12, va="center")
            panel.set_ylim(lowest - 0.04, 1.04)
            panel.set_yticks([lowest, 0.5 * (1.0 + lowest), 1.0])
            mark_steps(panel, flight)
        axes[0, 0].set_title("thruster inputs (share of full thrust)", loc="left")
        for bottom in axes[-1]:
            bottom.set_xlabel("time [s]")
    return figure


def _draw_axes(flight, rows, labels, title):
    """Three quantities over time, one below the other; `rows` as Flight.wrench."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(3, 1, figsize=(11, 5.4), sharex=True, constrained_layout=True)
        for panel, values, label in zip(axes, rows.T[1:], labels):
            panel.step(rows[:, 0], values, where="post", color=BLUE, linewidth=1.1)
            panel.axhline(0.0, color=GREY, linewidth=0.8)
            panel.set_ylabel(label)
            mark_steps(panel, flight)
        axes[0].set_title(title, loc="left")
        axes[-1].set_xlabel("time [s]")
        figure.align_ylabels()
    return figure


def draw_wrench(flight):
    """Body force and torque asked of the flight controller."""
    return _draw_axes(flight, flight.wrench, ("$f_x$ [N]", "$f_y$ [N]", r"$\tau_z$ [N m]"), "body wrench asked for")


def draw_disturbance(flight):
    """Disturbances that the observer estimates."""
    return _draw_axes(flight, flight.disturbance,
                      ("$d_{v,x}$ [m/s²]", "$d_{v,y}$ [m/s²]", r"$d_{\omega,z}$ [rad/s²]"), "estimated disturbance")


def draw_solve_times(flight):
    """Solve time of each period and its distribution, with the period as the deadline."""
    ms = 1e3 * flight.solve_s
    period_ms = 1e3 * float(np.median(flight.command_period))
    median, p99 = np.median(ms), np.percentile(ms, 99)
    with plt.rc_context(STYLE):
        figure, (left, right) = plt.subplots(1, 2, figsize=(11, 3.4), constrained_layout=True, sharey=True,
                                             gridspec_kw={"width_ratios": [3, 1]})
        left.plot(flight.solve_time, ms, ".", color=BLUE, markersize=3, alpha=0.7)
        left.set_yscale("log")
        left.axhline(period_ms, color=ORANGE, linestyle="--", linewidth=1.3)
        left.annotate(f"period {period_ms:.0f} ms", (0.995, period_ms), xycoords=("axes fraction", "data"), ha="right",
                      va="bottom", color=ORANGE)
        low, high = 0.7 * ms.min(), 1.8 * max(period_ms, ms.max())
        left.set_ylim(low, high)
        left.set_xlabel("time [s]")
        left.set_ylabel("solve time [ms]")
        left.set_title("NMPC solve time", loc="left")
        mark_steps(left, flight)
        right.hist(ms, bins=np.geomspace(low, high, 60), orientation="horizontal", color=BLUE, alpha=0.6)
        right.set_title(f"median {median:.1f}, p99 {p99:.1f}, max {ms.max():.1f} ms", loc="left", fontsize=9)
        right.set_xlabel("solves")
    return figure


def draw_plan_view(flight):
    """The path over the floor, with the set-points and the heading every two seconds."""
    motion = flight.motion
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(5.6, 5.4), constrained_layout=True)
        axes.plot(motion.x, motion.y, color=BLUE, label=flight.motion_source, zorder=2)
        for trajectory in flight.trajectories:
            axes.plot(trajectory.x, trajectory.y, color=ORANGE, linestyle="--", linewidth=1.3, zorder=2)
        seconds = np.searchsorted(motion.time, np.arange(0.0, flight.end, 2.0))
        axes.quiver(motion.x[seconds], motion.y[seconds], np.cos(motion.yaw[seconds]), np.sin(motion.yaw[seconds]),
                    color=GREY, angles="xy", scale=18, width=0.006, alpha=0.6, zorder=3)
        names = {}
        for number, s in enumerate(flight.setpoints, 1):
            names.setdefault((round(s.x, 3), round(s.y, 3)), []).append(str(number))
        for (x, y), numbers in names.items():
            axes.plot(x, y, "o", color=ORANGE, markersize=9, markerfacecolor="white", markeredgewidth=2, zorder=3)
            axes.annotate(", ".join(numbers), (x, y), xytext=(-9, 9), textcoords="offset points", color=ORANGE,
                          ha="right", fontsize=11, fontweight="bold")
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.15)
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
        axes.set_title("path, set-points in order", loc="left")
    return figure


FIGURES = {"states": draw_states, "inputs": draw_inputs, "wrench": draw_wrench, "disturbance": draw_disturbance,
           "solve_times": draw_solve_times, "plan_view": draw_plan_view}
# What a flight must have recorded for a figure that not every flight has.
NEEDED = {"wrench": lambda flight: flight.wrench, "disturbance": lambda flight: flight.disturbance,
          "solve_times": lambda flight: flight.solve_s}


def write_figures(flight, folder):
    """Writes every figure the flight has data for; returns the paths."""
    os.makedirs(folder, exist_ok=True)
    paths = []
    for name, draw in FIGURES.items():
        if name in NEEDED and NEEDED[name](flight).size == 0:
            continue
        figure = draw(flight)
        paths.append(os.path.join(folder, name + ".png"))
        figure.savefig(paths[-1])
        plt.close(figure)
    return paths


# ---------------------------------------------------------------- program

def print_table(flight, summary):
    print("set-point                     settling  overshoot  steady error       steady RMS   impulse")
    print("    x [m]   y [m]  yaw [deg]       [s]        [%]   [mm]    [deg]          [mm]     [N s]")
    for number, (setpoint, row) in enumerate(zip(flight.setpoints, summary["setpoints"]), 1):
        settling = "  never" if row["settling_s"] is None else f"{row['settling_s']:7.2f}"
        print(f"{number}  {setpoint.x:6.2f}  {setpoint.y:6.2f}  {math.degrees(setpoint.yaw):9.1f}   {settling}"
              f"    {100 * row['overshoot_ratio']:7.2f}  {1e3 * row['steady_position_error_m']:5.2f}"
              f"  {math.degrees(row['steady_yaw_error_rad']):7.3f}  {1e3 * row['steady_position_rms_m']:12.2f}"
              f"  {row['impulse_n_s']:8.2f}")
    for number, row in enumerate(summary["trajectories"], 1):
        print(f"trajectory {number}, from {row['start_s']:.1f} s for {row['duration_s']:.1f} s: tracking error "
              f"RMS {1e3 * row['position_rms_m']:.1f} mm, {math.degrees(row['yaw_rms_rad']):.2f} deg; "
              f"max {1e3 * row['position_max_m']:.1f} mm, {math.degrees(row['yaw_max_rad']):.2f} deg")
    solve = summary["solve_ms"]
    if solve:
        print(f"NMPC solve time: median {solve['median']:.2f} ms, p99 {solve['p99']:.2f} ms, max {solve['max']:.2f} ms;"
              f" deadline misses: {summary['deadline_misses']} of {flight.solve_s.size}")
    if summary["realtime_factor"] is not None:
        print(f"real-time factor: {summary['realtime_factor']:.1f}")


def main():
    parser = argparse.ArgumentParser(description="Metrics and figures of one recorded flight.")
    parser.add_argument("bag")
    parser.add_argument("--vehicle", required=True, help="vehicle file, for the thrust of each valve")
    parser.add_argument("--scenario", default="", help="name to report")
    parser.add_argument("--controller", default="", help="name to report")
    parser.add_argument("--sim-summary", help="what the simulator reported, for the real-time factor")
    parser.add_argument("--out", required=True, help="folder for summary.json and figures/")
    args = parser.parse_args()
    try:
        flight = load_flight(args.bag)
        realtime_factor = None
        if args.sim_summary:
            with open(args.sim_summary) as file:
                realtime_factor = json.load(file)["realtime_factor"]
        summary = {"scenario": args.scenario, "controller": args.controller,
                   "setpoints": setpoint_metrics(flight, vehicle_forces(args.vehicle)),
                   "trajectories": trajectory_metrics(flight), **solve_metrics(flight),
                   "realtime_factor": realtime_factor}
        os.makedirs(args.out, exist_ok=True)
        with open(os.path.join(args.out, "summary.json"), "w") as file:
            json.dump(summary, file, indent=1)
        write_figures(flight, os.path.join(args.out, "figures"))
    except (ReportError, OSError, ValueError, KeyError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print_table(flight, summary)
    return 0


if __name__ == "__main__":
    sys.exit(main())
