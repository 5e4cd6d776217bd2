#!/usr/bin/python3
"""Flights over PX4's own DDS client: the emulated Pixhawk with stock firmware takes set-points of every level over XRCE, alone or
with MAVLink beside it. ATMOS_LONG_TESTS=1: the paper's whole sequence with every controller, and faults of the lines."""
import math
import os
import unittest

import numpy as np
import rosunit
from atmos_msgs.msg import SupervisorStatus

import harness  # first: it knows where the scripts are
import flight_bag

LONG = "ATMOS_LONG_TESTS" in os.environ
# Controller, link, steady error allowed [m, deg].
FLIGHTS = [("direct_allocation", "xrce", 0.01, 1.0), ("rate", "both", 0.03, 2.0)]
LONG_FLIGHTS = [("wrench", "xrce", 0.01, 1.0), ("rate", "xrce", 0.03, 2.0),
                ("offset_free_direct_allocation", "xrce", 0.01, 1.0), ("offset_free_wrench", "xrce", 0.01, 1.0),
                ("wrench", "both", 0.01, 1.0)]
# PX4 sets its clock for five seconds first, and flies after eight.
STEP = [{"time_s": 0.0, "x_m": 0.0, "y_m": 0.0, "yaw_deg": 0.0},
        {"time_s": 9.0, "x_m": 0.2, "y_m": 0.1, "yaw_deg": 10.0}]
STEADY_S = 5.0


def steady_errors(bag):
    """Norm of the mean position error [m] and mean yaw error [rad] over the last five seconds of each set-point. From the
    robot's true motion: over XRCE alone PX4 does not tell its outputs, which a flight report would need."""
    truth = harness.messages(bag, "sim/truth")
    time_s = np.array([harness.stamp(m) for m in truth])
    pose = np.array([(m.pose.pose.position.x, m.pose.pose.position.y, flight_bag.yaw_of(m.pose.pose.orientation))
                     for m in truth])
    setpoints = {harness.stamp(m): m.pose for m in harness.messages(bag, "setpoint")}
    begins = sorted(setpoints)
    errors = []
    for begin, end in zip(begins, begins[1:] + [time_s[-1]]):
        last = (time_s >= end - STEADY_S) & (time_s < end)
        if not last.any():
            continue  # published one ahead
        goal = setpoints[begin]
        off = (pose[last][:, :2] - (goal.position.x, goal.position.y)).mean(axis=0)
        turn = flight_bag.wrap(pose[last][:, 2] - flight_bag.yaw_of(goal.orientation)).mean()
        errors.append((float(np.hypot(*off)), float(abs(turn))))
    return errors


class Xrce(unittest.TestCase):
    def check_flown(self, bag, log, position_m, yaw_deg):
        for error_m, error_rad in steady_errors(bag):
            print(f"steady error {1e3 * error_m:.2f} mm, {math.degrees(error_rad):.3f} deg")
            self.assertLessEqual(error_m, position_m, log)
            self.assertLessEqual(error_rad, math.radians(yaw_deg), log)
        states = harness.messages(bag, "px4/supervisor")
        self.assertEqual(states[-1].state, SupervisorStatus.FLYING, log)
        self.assertGreater(max(max(m.duty) for m in harness.messages(bag, "valves")), 0.1, "got there without thrust")

    def test_each_controller_reaches_its_set_points(self):
        for name, link, position_m, yaw_deg in FLIGHTS + (LONG_FLIGHTS if LONG else []):
            with self.subTest(controller=name, link=link):
                changes = {} if LONG else {"duration_s": 24.0, "setpoints": STEP}
                scenario = harness.write_scenario(harness.scratch(), controller=harness.controller(name), **changes)
                bag, log = harness.fly(scenario, 180.0, controller=harness.controller(name), fmu="serial", link=link,
                                       speed=1.0 if LONG else 1.5)
                print(name, link)
                self.check_flown(bag, log, position_m, yaw_deg)
                self.assertEqual(harness.messages(bag, "px4/supervisor")[-1].unsupported, 0, log)

    @unittest.skipUnless(LONG, "a minute of real time; the same faults fly in px4_serial_flight_test")
    def test_an_unplugged_cable_and_a_reboot_are_recovered_from(self):
        folder = harness.scratch()
        scenario = harness.write_scenario(folder, duration_s=60.0, setpoints=STEP, controller=harness.controller("wrench"))
        bag, summary = os.path.join(folder, "run.bag"), os.path.join(folder, "sim.json")
        with harness.Launch("sim.launch", scenario=scenario, controller=harness.controller("wrench"), fmu="serial", link="xrce",
                            record=bag, summary=summary) as launch:
            harness.disturb_the_line(launch, unplug_s=15, reboot_s=30)
            log = launch.wait(90.0)
        links = harness.messages(bag, "px4/state")
        self.assertEqual(links[-1].opened, 2, log)
        # Every session that PX4 begins anew counts; a cable that is away for longer than its three pings ends one, too.
        self.assertIn(links[-1].reboots, (1, 2), log)
        reboot = next(harness.stamp(m) for m in links if m.reboots == links[-1].reboots)
        states = harness.messages(bag, "px4/supervisor")
        back = [harness.stamp(s) for s in states if s.state == SupervisorStatus.FLYING and harness.stamp(s) > reboot + 0.3]
        self.assertTrue(back and back[0] < reboot + 12.0, f"no recovery after {reboot}:\n{log}")
        self.check_flown(bag, log, 0.01, 1.0)


if __name__ == "__main__":
    rosunit.unitrun("atmos_system_test", "xrce", Xrce)
