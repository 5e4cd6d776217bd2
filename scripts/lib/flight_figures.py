"""Figures of one robot's flight, laid out like the paper's. Each draw_* takes a View and returns a figure."""
from dataclasses import dataclass

import numpy as np

import flight_metrics as metrics
from figure_style import BLUE, GREEN, GREY, LIGHT, ORANGE, plt, subplots, thin
from flight_bag import Flight, wrap

USEFUL_COUPLING = 0.03  # standard deviation of the loss per further open thruster, above which nothing is shown


@dataclass
class View:
    """A flight, the vehicle that flew, and the floor (height map, see floor_of) if one is known."""
    flight: Flight
    vehicle: dict
    floor: dict = None


def reference_curve(flight, value):
    """Step curve of one coordinate of the set-points."""
    times, values = [], []
    for setpoint, _, end in metrics.windows(flight):
        times += [setpoint.time, min(end, flight.end)]
        values += [value(setpoint)] * 2
    return times, values


def continuous_yaw(flight):
    """Set-point yaws on the same branch as the measured, unwrapped yaw."""
    result = {}
    for setpoint, _, end in metrics.windows(flight):
        at_end = flight.motion.yaw[np.searchsorted(flight.motion.time, min(end, flight.end)) - 1]
        result[setpoint.time] = at_end + float(wrap(setpoint.yaw - at_end))
    return result


def _coordinate(flight, trajectory, label):
    """What belongs to an axis of draw_states; yaw on the branch of the measured one."""
    if label.startswith("yaw"):
        at_start = flight.motion.yaw[min(np.searchsorted(flight.motion.time, trajectory.time[0]), len(flight.motion.yaw) - 1)]
        return np.degrees(trajectory.yaw + 2.0 * np.pi * np.round((at_start - trajectory.yaw[0]) / (2.0 * np.pi)))
    return trajectory.x if label.startswith("x") else trajectory.y


def mark_steps(axes, flight):
    for setpoint in flight.setpoints[1:]:
        axes.axvline(setpoint.time, color=LIGHT, linewidth=0.9, zorder=0)
    axes.set_xlim(min(0.0, flight.motion.time[0]), flight.end)


def draw_pose(axes, flight, label, values, reference):
    """One coordinate of the pose against its reference."""
    axes.plot(*reference_curve(flight, reference), color=ORANGE, linestyle="--", linewidth=1.3, label="reference")
    for trajectory in flight.trajectories:
        axes.plot(*thin(trajectory.time, _coordinate(flight, trajectory, label)), color=ORANGE, linestyle="--", linewidth=1.3)
    axes.plot(*thin(flight.motion.time, values), color=BLUE, label=flight.motion_source)
    mark_steps(axes, flight)


def pose_rows(flight):
    """(label, measured, set-point's) of x, y and yaw."""
    yaw = continuous_yaw(flight)
    return [("x [m]", flight.motion.x, lambda s: s.x), ("y [m]", flight.motion.y, lambda s: s.y),
            ("yaw [deg]", np.degrees(flight.motion.yaw), lambda s: np.degrees(yaw[s.time]))]


def draw_states(view):
    """States against references: x, y, yaw in the left column, their rates in the right one."""
    flight, motion = view.flight, view.flight.motion
    rates = [("$v_x$ [m/s]", motion.vx), ("$v_y$ [m/s]", motion.vy), ("yaw rate [deg/s]", np.degrees(motion.yaw_rate))]
    figure, axes = subplots(3, 2, figsize=(11, 6.6), sharex=True)
    for (left, right), (label, values, reference), (rate_label, rate) in zip(axes, pose_rows(flight), rates):
        draw_pose(left, flight, label, values, reference)
        left.set_ylabel(label)
        right.plot(*thin(motion.time, rate), color=BLUE, linewidth=1.1)
        right.axhline(0.0, color=GREY, linewidth=0.8)
        right.set_ylabel(rate_label)
        mark_steps(right, flight)
    axes[0, 0].set_title("pose", loc="left")
    axes[0, 0].legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncol=2, borderaxespad=0.0)
    axes[0, 1].set_title("velocity", loc="left")
    for bottom in axes[-1]:
        bottom.set_xlabel("time [s]")
    figure.align_ylabels()
    return figure


def draw_plan_view(view):
    """The path over the floor, with the set-points and the heading every two seconds."""
    flight, motion = view.flight, view.flight.motion
    figure, axes = subplots(figsize=(6.4, 5.4))
    axes.plot(*thin(motion.x, motion.y), color=BLUE, label=flight.motion_source, zorder=2)
    for trajectory in flight.trajectories:
        axes.plot(trajectory.x, trajectory.y, color=ORANGE, linestyle="--", linewidth=1.3, zorder=2)
    seconds = np.searchsorted(motion.time, np.arange(motion.time[0], flight.end, 2.0))
    axes.quiver(motion.x[seconds], motion.y[seconds], np.cos(motion.yaw[seconds]), np.sin(motion.yaw[seconds]),
                color=GREY, angles="xy", scale=18, width=0.006, alpha=0.6, zorder=3)
    names = {}
    for number, s in enumerate(flight.setpoints, 1):
        names.setdefault((round(s.x, 3), round(s.y, 3)), []).append(str(number))
    for (x, y), numbers in names.items():
        axes.plot(x, y, "o", color=ORANGE, markersize=9, markerfacecolor="white", markeredgewidth=2, zorder=3)
        shown = ", ".join(numbers[:4]) + (", …" if len(numbers) > 4 else "")
        axes.annotate(shown, (x, y), xytext=(-9, 9), textcoords="offset points", color=ORANGE, ha="right", fontsize=11,
                      fontweight="bold", zorder=4)
    axes.set_aspect("equal")
    for limits, values in ((axes.set_xlim, motion.x), (axes.set_ylim, motion.y)):
        room = max(0.12, 0.15 * np.ptp(values))
        limits(values.min() - room, values.max() + room)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.set_title("path and heading every 2 s" + (", set-points in order" if names else ""), loc="left")
    return figure


def command_edges(flight):
    return np.append(flight.command_time, flight.command_time[-1] + flight.command_period[-1])


def draw_inputs(view):
    """The thruster inputs, normalised to full thrust."""
    flight = view.flight
    count = flight.duty.shape[1]
    rows = (count + 1) // 2
    edges = command_edges(flight)
    lowest = -1.0 if flight.duty.min() < 0.0 else 0.0
    figure, axes = subplots(rows, 2, figsize=(11, 1.45 * rows + 0.6), sharex=True, sharey=True, squeeze=False)
    for i in range(count):
        panel = axes[i // 2, i % 2]
        panel.stairs(flight.duty[:, i], edges, facecolor="#a9c8e6", edgecolor=BLUE, fill=True, linewidth=0.6)
        panel.set_ylabel(f"$u_{{{i + 1}}}$", rotation=0, labelpad=12, va="center")
        panel.set_ylim(lowest - 0.04, 1.04)
        panel.set_yticks([lowest, 0.5 * (1.0 + lowest), 1.0])
        mark_steps(panel, flight)
    axes[0, 0].set_title("thruster inputs, share of full thrust", loc="left")
    for bottom in axes[-1]:
        bottom.set_xlabel("time [s]")
    return figure


def draw_duty_histogram(view):
    """How long each thruster was asked to be open, and how its duties are distributed."""
    flight = view.flight
    shares = metrics.duty_shares(flight)
    open_time = (np.abs(flight.duty) * flight.command_period[:, None]).sum(axis=0)
    thrusters = np.arange(1, len(shares) + 1)
    labels = ["closed"] + [f"{low:.1f} to {high:.1f}" for low, high in zip(metrics.DUTY_EDGES, metrics.DUTY_EDGES[1:])]
    colors = ["#e5e7eb"] + [plt.get_cmap("Blues")(0.25 + 0.15 * k) for k in range(len(labels) - 1)]
    figure, (left, right) = subplots(1, 2, figsize=(11, 3.6), gridspec_kw={"width_ratios": [2, 1]})
    below = np.zeros(len(shares))
    for column, label, color in zip(100.0 * shares.T, labels, colors):
        left.barh(thrusters, column, left=below, color=color, label=label, height=0.72)
        below += column
    left.set_xlim(0, 100)
    left.set_ylabel("thruster")
    left.set_xlabel("share of the commands [%]")
    left.set_title("duties", loc="left")
    left.legend(ncol=3, loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize=8, columnspacing=1.0, handlelength=1.2)
    right.barh(thrusters, open_time, color=BLUE, height=0.72)
    right.set_xlabel("time open [s]")
    right.set_title(f"{open_time.sum():.1f} s in all", loc="left")
    for panel in (left, right):
        panel.set_yticks(thrusters)
        panel.invert_yaxis()
        panel.grid(axis="y", visible=False)
    return figure


def _draw_axes(flight, rows, labels, title):
    """Three quantities over time, one below the other; `rows` as Flight.wrench."""
    figure, axes = subplots(3, 1, figsize=(11, 5.4), sharex=True)
    for panel, values, label in zip(axes, rows.T[1:], labels):
        panel.step(*thin(rows[:, 0], values), where="post", color=BLUE, linewidth=1.1)
        panel.axhline(0.0, color=GREY, linewidth=0.8)
        panel.set_ylabel(label)
        mark_steps(panel, flight)
    axes[0].set_title(title, loc="left")
    axes[-1].set_xlabel("time [s]")
    figure.align_ylabels()
    return figure


def draw_wrench(view):
    """Body force and torque asked of the flight controller."""
    return _draw_axes(view.flight, view.flight.wrench, ("$f_x$ [N]", "$f_y$ [N]", r"$\tau_z$ [N m]"), "body wrench asked for")


def draw_rate(view):
    """Body force and yaw rate asked of the flight controller."""
    return _draw_axes(view.flight, view.flight.rate, ("$f_x$ [N]", "$f_y$ [N]", r"$\omega_z$ [rad/s]"),
                      "body force and yaw rate asked for")


def draw_disturbance(view):
    """Disturbances that the observer estimates."""
    return _draw_axes(view.flight, view.flight.disturbance,
                      ("$d_{v,x}$ [m/s²]", "$d_{v,y}$ [m/s²]", r"$d_{\omega,z}$ [rad/s²]"), "estimated disturbance")


def draw_solve_times(view):
    """Solve time of each period and its distribution, with the period as the deadline."""
    flight = view.flight
    ms = 1e3 * flight.solve_s
    period_ms = 1e3 * float(np.median(flight.command_period))
    median, p99 = np.median(ms), np.percentile(ms, 99)
    figure, (left, right) = subplots(1, 2, figsize=(11, 3.4), sharey=True, gridspec_kw={"width_ratios": [3, 1]})
    left.plot(flight.solve_time, ms, ".", color=BLUE, markersize=3, alpha=0.7)
    left.set_yscale("log")
    left.axhline(period_ms, color=ORANGE, linestyle="--", linewidth=1.3)
    left.annotate(f"period {period_ms:.0f} ms", (0.995, period_ms), xycoords=("axes fraction", "data"), ha="right",
                  va="bottom", color=ORANGE)
    low, high = max(0.7 * ms.min(), 1e-3), 1.8 * max(period_ms, ms.max())
    left.set_ylim(low, high)
    left.set_xlabel("time [s]")
    left.set_ylabel("solve time [ms]")
    left.set_title("NMPC solve time", loc="left")
    mark_steps(left, flight)
    right.hist(ms, bins=np.geomspace(low, high, 60), orientation="horizontal", color=BLUE, alpha=0.6)
    right.set_title(f"median {median:.1f}, p99 {p99:.1f}, max {ms.max():.1f} ms", loc="left", fontsize=9)
    right.set_xlabel("solves")
    return figure


def draw_supply(view):
    """Air and battery over the flight."""
    flight = view.flight
    panels = ([("gas used [g]", flight.air[:, 0], 1e3 * (flight.air[:, 1] - flight.air[0, 1])),
               ("bottles [bar]", flight.air[:, 0], flight.air[:, 2] / 1e5)] if len(flight.air) else [])
    if len(flight.battery):
        panels.append(("battery [V]", flight.battery[:, 0], flight.battery[:, 1]))
    figure, axes = subplots(len(panels), 1, figsize=(11, 1.75 * len(panels) + 0.4), sharex=True, squeeze=False)
    for panel, (label, times, values) in zip(axes[:, 0], panels):
        panel.plot(*thin(times, values), color=BLUE)
        panel.ticklabel_format(useOffset=False)
        panel.set_ylabel(label)
        mark_steps(panel, flight)
    axes[0, 0].set_title("air and power", loc="left")
    axes[-1, 0].set_xlabel("time [s]")
    figure.align_ylabels()
    return figure


def draw_coupling(view):
    """Thrust that arrives, against how many further thrusters are open: the paper's measurement, made in flight."""
    impulses = metrics.Impulses(view.flight, view.vehicle)
    fit = metrics.coupling(impulses)
    enough = metrics.strong_periods(impulses)
    asked = impulses.asked[enough]
    share = (impulses.measured[enough] * asked).sum(axis=1) / (asked ** 2).sum(axis=1)
    others = impulses.others[enough]
    figure, axes = subplots(figsize=(7.4, 4.2))
    axes.plot(others, 100.0 * share, ".", color=BLUE, markersize=4, alpha=0.35, label="one PWM period")
    bins = np.arange(-0.125, max(others.max(), 1.0) + 0.25, 0.25)
    centres, middles, spreads = [], [], []
    for low, high in zip(bins, bins[1:]):
        inside = share[(others >= low) & (others < high)]
        if inside.size >= 5:
            quartiles = np.percentile(inside, [25, 50, 75])
            centres.append(others[(others >= low) & (others < high)].mean())
            middles.append(quartiles[1])
            spreads.append((quartiles[1] - quartiles[0], quartiles[2] - quartiles[1]))
    if centres:
        axes.errorbar(centres, 100.0 * np.array(middles), 100.0 * np.array(spreads).T, fmt="o", color="#0f3f66", capsize=3,
                      label="median and quartiles", zorder=3)
    line = np.array([0.0, max(others.max(), 1.0)])
    axes.plot(line, 100.0 * (1.0 - 0.125 * line), color=ORANGE, linestyle="--", linewidth=1.3, label="paper: 12.5 % each")
    if fit:
        axes.plot(line, 100.0 * (1.0 - fit[0] * line), color=GREEN,
                  label=f"fit: {round(100 * fit[0], 1) + 0.0:.1f} ± {100 * fit[1]:.1f} % each")
    middle = np.median(share)
    axes.set_ylim(100.0 * min(0.4, middle - 0.4), 100.0 * max(1.4, middle + 0.4))
    axes.set_xlabel("further thrusters open at the same time, mean over the pulses")
    axes.set_ylabel("impulse measured / asked for [%]")
    axes.set_title(f"thruster coupling, from the motion ({view.flight.motion_source})", loc="left")
    axes.legend(loc="lower left", fontsize=8, ncol=2)
    return figure


def floor_of(effects, read):
    """The floor of a scenario or a model.yaml: {x, y [m], height [m]} of its height map or {slope: (x, y)}, None without one.
    read(name) gives the text of a height file."""
    for effect in effects or []:
        parameters = effect.get("parameters", {})
        if effect["kind"] == "floor_unevenness":
            text = parameters.get("height_m") or [[float(word) for word in row.split()] for row in
                                                  read(parameters["height_file"]).splitlines()
                                                  if row.strip() and not row.lstrip().startswith("#")]
            height = np.array(text, dtype=float)
            x0, y0 = parameters["origin_m"]
            spacing = parameters["spacing_m"]
            return {"x": x0 + spacing * np.arange(height.shape[1]), "y": y0 + spacing * np.arange(height.shape[0]),
                    "height": height}
        if effect["kind"] == "floor_tilt":
            return {"slope": (parameters["slope_x"], parameters["slope_y"])}
    return None


def draw_floor(view):
    """What pushes the robot besides its thrusters, where it was; over the floor's height where a map is known."""
    impulses = metrics.Impulses(view.flight, view.vehicle)
    fit = metrics.coupling(impulses)
    rows = metrics.floor_push(impulses, fit[0] if fit else 0.0)
    slope = 1e3 * rows[:, 2:] / metrics.GRAVITY  # mm/m downhill
    size = np.hypot(*slope.T)
    figure, axes = subplots(figsize=(7.4, 5.6))
    room = max(0.3, 0.3 * np.ptp(rows[:, :2], axis=0).max())
    low, high = rows[:, :2].min(axis=0) - room, rows[:, :2].max(axis=0) + room
    if view.floor:
        x, y = np.meshgrid(np.linspace(low[0], high[0], 120), np.linspace(low[1], high[1], 120))
        if "slope" in view.floor:
            height = view.floor["slope"][0] * x + view.floor["slope"][1] * y
        else:
            height = bilinear(view.floor, x, y)
        shades = axes.contourf(x, y, 1e3 * (height - height.mean()), 16, cmap="RdYlBu_r", alpha=0.75)
        figure.colorbar(shades, ax=axes, label=f"height of the floor [mm], {view.floor['name']}", shrink=0.85)
    axes.plot(*thin(view.flight.motion.x, view.flight.motion.y), color=GREY, linewidth=0.8, alpha=0.7)
    largest = max(0.2, size.max())  # below that, arrows show noise: they stay short
    key = max(k for k in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50) if k <= largest or k == 0.1)
    arrows = axes.quiver(rows[:, 0], rows[:, 1], slope[:, 0], slope[:, 1], color="#111827", angles="xy", scale_units="width",
                         scale=largest / 0.13, width=0.005, zorder=3)
    axes.quiverkey(arrows, 0.72, 1.035, key, f"{key:g} mm/m downhill", labelpos="E", coordinates="axes",
                   fontproperties={"size": 9})
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.grid(visible=not view.floor)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.set_title("floor: push not explained by thrust", loc="left")
    return figure


def bilinear(floor, x, y):
    """Height at places, held constant outside the map; like the paper's figure of the floor."""
    along = lambda nodes, at: np.clip((at - nodes[0]) / (nodes[1] - nodes[0] if len(nodes) > 1 else 1.0), 0, len(nodes) - 1)
    i, j = along(floor["x"], x), along(floor["y"], y)
    i0 = np.minimum(i.astype(int), max(len(floor["x"]) - 2, 0))
    j0 = np.minimum(j.astype(int), max(len(floor["y"]) - 2, 0))
    i1, j1 = np.minimum(i0 + 1, len(floor["x"]) - 1), np.minimum(j0 + 1, len(floor["y"]) - 1)
    a, b, height = i - i0, j - j0, floor["height"]
    return ((1 - a) * (1 - b) * height[j0, i0] + a * (1 - b) * height[j0, i1] + (1 - a) * b * height[j1, i0]
            + a * b * height[j1, i1])


def _has_thrust(view):
    flight = view.flight
    return flight.duty.size > 0 and np.abs(flight.duty).max() > 0.0


def _no_coupling(view):
    if not _has_thrust(view):
        return "no thrust was commanded"
    if view.flight.duty.min() < 0.0:
        return "propellers share no supply"
    fit = metrics.coupling(metrics.Impulses(view.flight, view.vehicle))
    if fit is None:
        return "too seldom two thrusters open at once for an estimate"
    return None if fit[1] <= USEFUL_COUPLING else \
        f"the motion ({view.flight.motion_source}) is too noisy: {100 * fit[0]:.0f} ± {100 * fit[1]:.0f} % per open thruster"


def _no_floor(view):
    if not view.flight.duty.size:
        return "no thruster_command: what the thrusters did is not known"
    impulses = metrics.Impulses(view.flight, view.vehicle)
    return None if len(metrics.floor_push(impulses, 0.0)) else "the robot was nowhere for a second"


def _without(rows, text):
    return lambda view: None if len(rows(view.flight)) else text


# name: (what it shows, drawing, why a flight has none: None when it has)
FIGURES = {
    "states": ("Set-point responses: pose against reference, and velocity", draw_states, lambda view: None),
    "plan_view": ("Path over the floor", draw_plan_view, lambda view: None),
    "inputs": ("Thruster inputs", draw_inputs, _without(lambda f: f.duty, "no thruster_command in the recording")),
    "duty_histogram": ("Use of the thrusters", draw_duty_histogram,
                       _without(lambda f: f.duty, "no thruster_command in the recording")),
    "wrench": ("Body wrench asked of the flight controller", draw_wrench,
               _without(lambda f: f.wrench, "no nmpc/wrench in the recording")),
    "rate": ("Body force and yaw rate asked of the flight controller", draw_rate,
             _without(lambda f: f.rate, "no nmpc/rate in the recording")),
    "disturbance": ("Disturbance estimate of the offset-free controller", draw_disturbance,
                    _without(lambda f: f.disturbance, "no disturbance in the recording: it is only there with an observer")),
    "coupling": ("Thruster coupling: thrust that arrives when several are open", draw_coupling, _no_coupling),
    "floor": ("Floor map: where the floor pushes the robot", draw_floor, _no_floor),
    "solve_times": ("Solve times of the NMPC", draw_solve_times,
                    _without(lambda f: f.solve_s, "no nmpc/status of a solve in the recording")),
    "supply": ("Air and power", draw_supply,
               lambda view: None if len(view.flight.air) or len(view.flight.battery) else
               "neither pneumatics nor battery in the recording"),
}
