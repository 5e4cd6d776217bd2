#!/usr/bin/python3
"""The paper's set-point sequence, through all nodes in lockstep: every set-point is reached."""
import math
import os
import unittest

import numpy as np
import rosunit
from atmos_msgs.msg import NmpcStatus

import harness
import flight_report


class Sequence(unittest.TestCase):
    def test_every_set_point_is_reached(self):
        bag, log = harness.fly(os.path.join(harness.CONFIG, "scenario", "paper_sequence.yaml"), 240.0)
        flight = flight_report.load_flight(bag)
        expected = [(0, 0, 0), (1, 0, 0), (1, 0, 45), (1, 1, 90), (0, 0, 0)]
        self.assertEqual([(round(s.x, 6), round(s.y, 6), round(math.degrees(s.yaw), 6)) for s in flight.setpoints],
                         expected)
        self.assertEqual([round(s.time, 6) for s in flight.setpoints], [0, 20, 40, 60, 80])
        rows = flight_report.setpoint_metrics(flight, flight_report.vehicle_forces(harness.VEHICLE))
        for setpoint, row in zip(expected, rows):
            with self.subTest(setpoint=setpoint, **row):
                self.assertIsNotNone(row["settling_s"])
                self.assertLessEqual(row["steady_position_error_m"], 0.01)
                self.assertLessEqual(row["steady_yaw_error_rad"], math.radians(1.0))
                self.assertLessEqual(row["overshoot_ratio"], 0.10)
        self.assertEqual(flight.motion_source, "sim/truth")
        self.assertEqual((flight.command_time < flight.end - 1e-6).sum(), 1000, log)
        self.assertGreater(rows[1]["impulse_n_s"], 1.0, "the robot got there without thrust")
        # Commands come from solutions prepared ahead, at once; announced set-points are prepared for too.
        feedback = [m.feedback for m in harness.messages(bag, "nmpc/status") if m.mode == NmpcStatus.MODE_SOLVED]
        self.assertFalse(feedback[0])
        self.assertGreater(np.mean(feedback), 0.95)


if __name__ == "__main__":
    rosunit.unitrun("atmos_system_test", "sequence", Sequence)
