"""Recorded flights side by side, one column each: their metrics as a table, and a figure like the paper's: pose against
reference, and the thrusters' inputs. Set-points are compared in order."""
import argparse
import os
import sys

import figure_style as style
import flight_figures
import flight_report as report
from figure_style import STYLE, plt, subplots, thin


def draw(flights):
    """flights: list of (title, Flight)."""
    figure, axes = subplots(4, len(flights), figsize=(4.6 * len(flights), 7.6), sharex=True, sharey="row", squeeze=False)
    for column, (title, flight) in enumerate(flights):
        for row, (label, values, reference) in enumerate(flight_figures.pose_rows(flight)):
            panel = axes[row, column]
            flight_figures.draw_pose(panel, flight, label, values, reference)
            if column == 0:
                panel.set_ylabel(label)
        axes[0, column].set_title(title, loc="left")
        for thruster in range(flight.duty.shape[1]):
            axes[3, column].step(*thin(flight.command_time, flight.duty[:, thruster]), where="post", linewidth=0.6)
        flight_figures.mark_steps(axes[3, column], flight)
        axes[3, column].set_xlabel("time [s]")
    axes[3, 0].set_ylabel("inputs, share of full thrust")
    axes[2, 0].legend(loc="upper left")
    figure.align_ylabels()
    return figure


def rows_of(flight, metrics):
    """(what, value) of one flight, in an order that is the same for every flight."""
    rows = []
    pose, measured = report.SETPOINT_COLUMNS[:3], report.SETPOINT_COLUMNS[3:]
    for number, (setpoint, row) in enumerate(zip(flight.setpoints, metrics["setpoints"]), 1):
        place = ", ".join(f"{value(setpoint, row)} {unit}" for _, unit, value in pose)
        rows += [(f"{number} ({place}): {name} [{unit}]", value(setpoint, row)) for name, unit, value in measured]
    return rows + report.totals(metrics)


def print_table(titles, columns):
    """What each flight has, side by side; what only some have is a dash in the others."""
    names = list(dict.fromkeys(name for column in columns for name, _ in column))
    values = [dict(column) for column in columns]
    width = max(map(len, names))
    widths = [max([len(title)] + [len(value) for _, value in column]) for title, column in zip(titles, columns)]
    line = lambda first, rest: print(f"{first:<{width}}  " + "  ".join(f"{cell:>{w}}" for cell, w in zip(rest, widths)))
    line("", titles)
    for name in names:
        line(name, [column.get(name, "–") for column in values])


def main():
    parser = argparse.ArgumentParser(prog="scripts/compare", description=__doc__)
    parser.add_argument("bags", nargs="+", metavar="BAG[=TITLE]", help="recordings, as scripts/demo leaves them in out/demo/run.bag")
    parser.add_argument("--out", default="out/compare.png", metavar="FIGURE", help="PNG, PDF or SVG (default: %(default)s)")
    parser.add_argument("--vehicle", help="vehicle file (default: the recorded one)")
    args = parser.parse_args()
    titles, flights, columns = [], [], []
    try:
        for argument in args.bags:
            path, _, title = argument.partition("=")
            recording = report.read([path])
            vehicles = report.Vehicles(recording, args.vehicle)
            for robot, flight in recording.robots.items():
                titles.append((title or os.path.basename(path)) + (f", {robot}" if len(recording.robots) > 1 else ""))
                flights.append(flight)
                columns.append(rows_of(flight, report.flight_metrics(flight, vehicles.of(robot))))
        print_table(titles, columns)
        os.makedirs(os.path.dirname(os.path.abspath(args.out)), exist_ok=True)
        name, extension = os.path.splitext(os.path.basename(args.out))
        with plt.rc_context(STYLE):
            style.write(draw(list(zip(titles, flights))), os.path.dirname(os.path.abspath(args.out)), name, [extension[1:] or "png"])
    except (report.ReportError, OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"written: {args.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
