#!/usr/bin/python3
"""Two robots on crossing paths through all nodes: they touch without the distance monitor and stay apart with it."""
import math
import os
import unittest

import rosbag
import rosunit

import harness

SCENARIO = os.path.join(harness.CONFIG, "scenario", "crossing_robots.yaml")
ROBOTS = ["snap", "crackle"]
RADIUS_M = 0.2  # of a body, where a vehicle file says nothing (vehicle.h)


def truth(folder, robot):
    with rosbag.Bag(os.path.join(folder, robot + ".bag")) as bag:
        return {m.header.stamp.to_nsec(): m for _, m, _ in bag.read_messages(topics=[f"/{robot}/sim/truth"])}


def place(odometry):
    return odometry.pose.pose.position.x, odometry.pose.pose.position.y


def fly(**arguments):
    """Least distance of the bodies [m], speeds at the end [m/s] and the log of a flight of launch/two_robots.launch."""
    folder = harness.scratch()
    summary = os.path.join(folder, "sim.json")
    with harness.Launch("two_robots.launch", scenario=SCENARIO, record=folder, summary=summary, **arguments) as launch:
        log = launch.wait(90.0)
    assert os.path.exists(summary), f"the flight did not reach its end:\n{log}"
    first, second = (truth(folder, robot) for robot in ROBOTS)
    common = sorted(set(first) & set(second))
    assert common, "no common time stamps"
    least = min(math.dist(place(first[t]), place(second[t])) for t in common) - 2.0 * RADIUS_M
    speeds = [math.hypot(m.twist.twist.linear.x, m.twist.twist.linear.y) for m in (first[common[-1]], second[common[-1]])]
    return least, speeds, log


class DistanceMonitor(unittest.TestCase):
    def test_without_it_they_touch(self):
        least, _, log = fly(clock="lockstep", distance_monitor="false")
        self.assertLess(least, 0.002, log)

    def test_with_it_they_stay_apart(self):
        # In real time: in lockstep simulated time does not wait for the monitor.
        least, speeds, log = fly(clock="real")
        self.assertGreater(least, 0.0, log)
        self.assertLess(max(speeds), 0.03, log)
        for robot in ROBOTS:
            self.assertIn(f"{robot} is held", log)
        print(f"least distance of the bodies: {least:.3f} m")


if __name__ == "__main__":
    rosunit.unitrun("atmos_system_test", "distance_monitor", DistanceMonitor)
