"""Draws what a flight under a specification was worth: paths, and planned and executed robustness over time."""
import argparse
import sys

import matplotlib
import rosbag

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402


def read(bag):
    """Plan, monitor messages, and per robot the flown path (time, x, y) and the planned one."""
    plan, monitor, flown, planned = None, [], {}, {}
    with rosbag.Bag(bag) as opened:
        for topic, message, _ in opened.read_messages():
            robot = topic.split("/")[1]
            if topic == "/stl/plan":
                plan = message
            elif topic == "/stl/monitor":
                monitor.append(message)
            elif topic.endswith("/sim/truth"):
                p = message.pose.pose.position
                flown.setdefault(robot, []).append((message.header.stamp.to_sec(), p.x, p.y))
            elif topic.endswith("/trajectory") and message.points:
                points = [(message.header.stamp.to_sec() + q.time_from_start.to_sec(), q.transforms[0].translation.x,
                           q.transforms[0].translation.y) for q in message.points]
                planned.setdefault(robot, []).append(points)
    if plan is None or not monitor:
        raise ValueError(f"{bag} holds no plan or no monitor")
    return plan, monitor, flown, planned


def draw(bag, path):
    """Writes the figure of one flight as PNG."""
    plan, monitor, flown, planned = read(bag)
    start = plan.header.stamp.to_sec()
    figure, (plane, coordinates, robustness) = plt.subplots(1, 3, figsize=(16, 4.6))
    for index, robot in enumerate(sorted(flown)):
        color = f"C{index}"
        for k, points in enumerate(planned.get(robot, [])):
            label = f"{robot}, planned" if k == 0 else None
            plane.plot([p[1] for p in points], [p[2] for p in points], "--", color=color, label=label)
            for axis, width in ((1, 1.6), (2, 0.8)):
                coordinates.plot([p[0] - start for p in points], [p[axis] for p in points], "--", color=color, lw=width)
        points = [p for p in flown[robot] if p[0] >= start]
        plane.plot([p[1] for p in points], [p[2] for p in points], color=color, label=f"{robot}, flown")
        for axis, name, width in ((1, "x", 1.6), (2, "y", 0.8)):
            coordinates.plot([p[0] - start for p in points], [p[axis] for p in points], color=color, lw=width,
                             label=f"{robot} {name}")
    plane.set(xlabel="x, m", ylabel="y, m", title="in the plane", aspect="equal")
    coordinates.set(xlabel="s", ylabel="m", title="over time (dashed: planned)")
    times = [m.time for m in monitor]
    robustness.plot(plan.curve_time, plan.curve, "C2--", label="planned, at this time")
    robustness.plot(times, [m.now for m in monitor], "C2", label="executed, at this time")
    robustness.fill_between(times, [m.robustness_low for m in monitor], [m.robustness_high for m in monitor], color="C7",
                            alpha=0.3, step="post", label="still possible")
    robustness.axhline(plan.robustness, color="k", ls="--", lw=0.8, label=f"planned, {plan.robustness:.3f} m")
    robustness.axhline(0.0, color="C3", lw=0.8)
    final = monitor[-1].robustness_low
    robustness.set(xlabel="s", ylabel="m", title=f"robustness, executed {final:.3f} m", ylim=(-0.6, 1.2))
    for axes in (plane, coordinates, robustness):
        axes.grid(alpha=0.3)
        axes.legend(fontsize=7)
    figure.suptitle(plan.specification)
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bag", help="stl.bag of a flight")
    parser.add_argument("out", help="PNG file")
    args = parser.parse_args()
    try:
        draw(args.bag, args.out)
    except (OSError, ValueError, rosbag.ROSBagException) as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
