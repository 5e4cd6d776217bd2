"""Draws what a flight under a specification was worth, laid out like the paper's: paths in the plane and over time, and
planned and executed robustness. And, for robots that flew together, their distance."""
import itertools

import numpy as np
from matplotlib.patches import Rectangle

import flight_metrics as metrics
from figure_style import GREEN, GREY, ORANGE, RED, SERIES, subplots, thin

# On top of what was flown, which is a few millimetres away.
PLANNED = {"color": "#111827", "linestyle": (0, (3, 3)), "linewidth": 0.9, "zorder": 3}


def _draw_regions(axes, specification):
    for region in specification.get("regions", []):
        (x, y), (w, h) = region["center_m"], region["size_m"]
        obstacle = region["name"].lower().startswith("obs")
        axes.add_patch(Rectangle((x - w / 2, y - h / 2), w, h, facecolor="#fca5a5" if obstacle else "#dbeafe", edgecolor="none",
                                 alpha=0.7, zorder=0))
        axes.annotate(region["name"], (x, y), ha="center", va="center", color="#374151", fontsize=9,
                      fontweight="bold", zorder=1)


def draw(recording):
    """The figure of a recording that holds a plan and its monitor."""
    plan, monitor, start = recording.stl.plan, recording.stl.monitor, recording.stl.start
    figure, (plane, coordinates, robustness) = subplots(1, 3, figsize=(15, 4.7), gridspec_kw={"width_ratios": [1.1, 1, 1.1]})
    _draw_regions(plane, recording.file("/stl_planner/specification") or {})
    for color, (robot, flight) in zip(itertools.cycle(SERIES), recording.robots.items()):
        shift, motion = flight.start - start, flight.motion
        for trajectory in flight.trajectories:
            plane.plot(trajectory.x, trajectory.y, **PLANNED)
            for values in (trajectory.x, trajectory.y):
                coordinates.plot(trajectory.time + shift, values, **PLANNED)
        flown = motion.time + shift >= 0.0
        plane.plot(*thin(motion.x[flown], motion.y[flown]), color=color, linewidth=2.2, label=robot)
        for name, values, width in (("$x$", motion.x, 2.2), ("$y$", motion.y, 1.4)):
            coordinates.plot(*thin(motion.time[flown] + shift, values[flown]), color=color, linewidth=width,
                             label=f"{robot} {name}")
    plane.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    plane.set_title("in the plane (dashed: planned)", loc="left")
    coordinates.set(xlabel="time [s]", ylabel="position [m]")
    coordinates.set_title("over time (dashed: planned)", loc="left")
    for axes in (plane, coordinates):
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncol=4, fontsize=9)

    time = np.array([m.time for m in monitor])
    now, low, high = (np.array([getattr(m, name) for m in monitor]) for name in
                      ("now", "robustness_low", "robustness_high"))
    curve = np.array(plan.curve)
    finite = np.concatenate([values[np.isfinite(values)] for values in (now, curve)] + [[plan.robustness, 0.0]])
    bottom, top = finite.min() - 0.15, finite.max() + 0.25
    robustness.fill_between(*thin(time, np.clip(low, bottom, top), np.clip(high, bottom, top)), color="#d1d5db", alpha=0.6,
                            step="post", label="still possible", linewidth=0)
    robustness.plot(*thin(time, now), color=GREEN, linewidth=2.2, label="executed, at this time")
    robustness.plot(plan.curve_time, curve, label="planned, at this time", **PLANNED)
    robustness.axhline(plan.robustness, color=ORANGE, linewidth=1.1, label=f"planned, {plan.robustness:.3f} m")
    robustness.axhline(0.0, color=RED, linewidth=0.9)
    robustness.set(xlabel="time [s]", ylabel="robustness [m]", ylim=(bottom, top))
    last = monitor[-1]
    robustness.set_title(f"robustness, executed {last.robustness_low:.3f} m"
                         + ("" if last.robustness_low == last.robustness_high else " (not decided)"), loc="left")
    robustness.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncol=2, fontsize=9)
    return figure


def draw_separation(recording):
    """Distance of the centres of each pair of robots over time."""
    figure, axes = subplots(figsize=(11, 3.2))
    for color, (first, second) in zip(itertools.cycle(SERIES), itertools.combinations(recording.robots, 2)):
        time, distance = metrics.separation(recording.robots[first], recording.robots[second])
        axes.plot(*thin(time, distance), color=color, label=f"{first} and {second}, least {distance.min():.2f} m")
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    axes.set(xlabel="time [s]", ylabel="distance of the centres [m]")
    axes.set_title("distance between robots", loc="left")
    axes.legend(loc="best", fontsize=9)
    return figure
