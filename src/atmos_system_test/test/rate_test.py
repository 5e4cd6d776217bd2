#!/usr/bin/python3
"""The rate level through all nodes: a trajectory is followed with preview, and the robot rests at its end."""
import math
import os
import unittest

import rosunit

import harness
import flight_report


class Rate(unittest.TestCase):
    def test_trajectories_are_followed(self):
        bag, log = harness.fly(os.path.join(harness.CONFIG, "scenario", "trajectory_rate.yaml"), 240.0,
                               controller=harness.controller("rate"))
        flight = flight_report.load_flight(bag)
        rows = flight_report.trajectory_metrics(flight)
        self.assertEqual(len(rows), 2, log)
        for row in rows:
            with self.subTest(**row):
                self.assertLess(row["position_rms_m"], 0.015)
                self.assertLess(row["position_max_m"], 0.04)
                self.assertLess(row["yaw_rms_rad"], math.radians(2.0))
        self.assertGreater(len(harness.messages(bag, "nmpc/rate")), 1090)
        for row in flight_report.setpoint_metrics(flight, flight_report.vehicle_forces(harness.VEHICLE)):
            self.assertLessEqual(row["steady_position_error_m"], 0.01)
            self.assertLessEqual(row["steady_yaw_error_rad"], math.radians(1.0))


if __name__ == "__main__":
    rosunit.unitrun("atmos_system_test", "rate", Rate)
