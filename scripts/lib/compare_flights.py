"""Draws recorded flights side by side, one column each: pose against reference, and the thrusters' inputs."""
import sys

import matplotlib.pyplot as plt
import numpy as np

import flight_report as report


def draw(flights):
    """flights: list of (title, Flight)."""
    rows = [("x [m]", lambda m: m.x, lambda s, yaw: s.x), ("y [m]", lambda m: m.y, lambda s, yaw: s.y),
            ("yaw [deg]", lambda m: np.degrees(m.yaw), lambda s, yaw: np.degrees(yaw[s.time]))]
    with plt.rc_context(report.STYLE):
        figure, axes = plt.subplots(4, len(flights), figsize=(4.6 * len(flights), 7.6), sharex=True, sharey="row",
                                    constrained_layout=True, squeeze=False)
        for column, (title, flight) in enumerate(flights):
            yaw = report.continuous_yaw(flight)
            for row, (label, measured, reference) in enumerate(rows):
                panel = axes[row, column]
                panel.plot(*report.reference_curve(flight, lambda s: reference(s, yaw)), color=report.ORANGE, linestyle="--",
                           linewidth=1.3, label="reference")
                panel.plot(flight.motion.time, measured(flight.motion), color=report.BLUE, label=flight.motion_source)
                report.mark_steps(panel, flight)
                if column == 0:
                    panel.set_ylabel(label)
            axes[0, column].set_title(title, loc="left")
            for thruster in range(flight.duty.shape[1]):
                axes[3, column].step(flight.command_time, flight.duty[:, thruster], where="post", linewidth=0.6)
            report.mark_steps(axes[3, column], flight)
            axes[3, column].set_xlabel("time [s]")
        axes[3, 0].set_ylabel("inputs, share of full thrust")
        axes[2, 0].legend(loc="upper left")
        figure.align_ylabels()
    return figure


def main():
    out, bags = sys.argv[1], sys.argv[2:]
    try:
        flights = []
        for argument in bags:
            path, _, title = argument.partition("=")
            flights.append((title or path, report.load_flight(path)))
    except (report.ReportError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    draw(flights).savefig(out)
    print(f"written: {out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
