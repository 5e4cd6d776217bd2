#!/usr/bin/python3
"""From a specification to the flight: both scenarios of the paper are planned, certified, flown and monitored."""
import math
import os
import unittest

import rosbag
import rosunit

import harness
import figure_style
import flight_report
import stl_figure

PLANNED, SATISFIED = 0, 1
LONG = "ATMOS_LONG_TESTS" in os.environ


def fly(launch_file, scenario, limit_s, **arguments):
    """Folder with the recordings of a flight that reached its end."""
    folder = harness.scratch()
    summary = os.path.join(folder, "sim.json")
    with harness.Launch(launch_file, record=folder, summary=summary, clock="lockstep",
                        scenario=os.path.join(harness.CONFIG, "scenario", scenario + ".yaml"), **arguments) as launch:
        log = launch.wait(limit_s)
    assert os.path.exists(summary), f"the flight did not reach its end:\n{log}"
    return folder, log


def least_distance(bag, robots):
    """Least distance of the centres of two robots over the flight, by truth."""
    at = {robot: {} for robot in robots}
    with rosbag.Bag(bag) as opened:
        for topic, message, _ in opened.read_messages(topics=[f"/{robot}/sim/truth" for robot in robots]):
            p = message.pose.pose.position
            at[topic.split("/")[1]][message.header.stamp.to_sec()] = (p.x, p.y)
    common = sorted(set(at[robots[0]]) & set(at[robots[1]]))
    assert common, "no common time stamps"
    return min(math.dist(at[robots[0]][t], at[robots[1]][t]) for t in common)


class Stl(unittest.TestCase):
    def check(self, launch_file, scenario, robots):
        folder, log = fly(launch_file, scenario, 300.0)
        bag = os.path.join(folder, "stl.bag")
        with rosbag.Bag(bag) as opened:
            plan = [m for _, m, _ in opened.read_messages(topics=["/stl/plan"])][0]
            monitor = [m for _, m, _ in opened.read_messages(topics=["/stl/monitor"])]
        self.assertEqual(plan.status, PLANNED, log)
        self.assertAlmostEqual(plan.robustness, 0.25, 5)
        self.assertLessEqual(plan.peak_acceleration, 1.0 + 1e-6)
        self.assertLessEqual(plan.peak_velocity, 1.0 + 1e-6)
        # 100 Hz until the end of the plan, a verdict per clause, and intervals that have become one number.
        self.assertGreater(len(monitor), 99 * (monitor[-1].time - 0.1) * 0.98)
        last = monitor[-1]
        self.assertEqual(last.verdict, SATISFIED, log)
        self.assertGreater(last.robustness_low, 0.0)
        self.assertAlmostEqual(last.robustness_low, last.robustness_high)
        for earlier, later in zip(monitor, monitor[1:]):
            self.assertGreaterEqual(later.robustness_low, earlier.robustness_low - 1e-9)
            self.assertLessEqual(later.robustness_high, earlier.robustness_high + 1e-9)
        if len(robots) > 1:
            self.assertGreater(least_distance(bag, robots), 0.4)  # the sum of two radii
        (figure,) = figure_style.write(stl_figure.draw(flight_report.read([bag])), folder, "robustness", ["png"])
        self.assertGreater(os.path.getsize(figure), 10000)
        print(f"{scenario}: planned {plan.robustness:.4f} m, executed {last.robustness_low:.4f} m")

    def test_single(self):
        self.check("stl_single.launch", "stl_single", ["atmos"])

    def test_two_robots(self):
        self.check("stl_two_robots.launch", "stl_two_robots", ["snap", "crackle"])

    @unittest.skipUnless(LONG, "long tests only")
    def test_on_an_ordinary_day(self):
        self.check("stl_single.launch", "stl_single_lab", ["atmos"])
        self.check("stl_two_robots.launch", "stl_two_robots_lab", ["snap", "crackle"])

    def test_without_a_plan_nothing_flies(self):
        folder = harness.scratch()
        with open(os.path.join(harness.CONFIG, "stl", "single.yaml")) as file:
            text = file.read().replace("F[0,60] in(D)", "F[0,5] in(D)")
        path = os.path.join(folder, "impossible.yaml")
        with open(path, "w") as file:
            file.write(text)
        summary = os.path.join(folder, "sim.json")
        with harness.Launch("stl_single.launch", specification=path, record=folder, summary=summary) as launch:
            log = launch.wait(120.0)
        self.assertFalse(os.path.exists(summary) and os.path.getsize(summary), log)
        self.assertIn("no certified plan", log)
        self.assertIn("F[0,5] atmos.in(D)", log)


if __name__ == "__main__":
    rosunit.unitrun("atmos_system_test", "stl", Stl)
