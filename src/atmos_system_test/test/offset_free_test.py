#!/usr/bin/python3
"""The paper's sequence on a tilted floor, at the wrench level: nominal keeps centimetres, offset-free nothing."""
import math
import os
import unittest

import rosunit

import harness
import flight_report


def steady_errors(name):
    """Steady errors (m, rad) per set-point of a shipped scenario, and the flight."""
    scenario = os.path.join(harness.CONFIG, "scenario", name + ".yaml")
    controller = harness.controller(name.replace("tilted_floor_", ""))
    bag, log = harness.fly(scenario, 240.0, controller=controller)
    flight = flight_report.load_flight(bag)
    rows = flight_report.setpoint_metrics(flight, flight_report.vehicle_forces(harness.VEHICLE))
    return [(row["steady_position_error_m"], row["steady_yaw_error_rad"]) for row in rows], flight, log


class OffsetFree(unittest.TestCase):
    def test_nominal_keeps_centimetres(self):
        errors, flight, log = steady_errors("tilted_floor_wrench")
        self.assertTrue(all(0.03 < position < 0.15 for position, _ in errors), errors)
        self.assertGreater(len(flight.wrench), 990, log)
        self.assertEqual(len(flight.disturbance), 0)

    def test_offset_free_keeps_nothing(self):
        errors, flight, log = steady_errors("tilted_floor_offset_free_wrench")
        for position, yaw in errors:
            self.assertLessEqual(position, 0.002, errors)
            self.assertLessEqual(yaw, math.radians(0.2), errors)
        self.assertGreater(len(flight.disturbance), 990, log)
        held = flight.disturbance[(flight.disturbance[:, 0] > 15.0) & (flight.disturbance[:, 0] < 20.0)]
        self.assertAlmostEqual(held[:, 1].mean(), -0.002 * 9.81 / 0.875, delta=0.003)  # two valves, coupled


if __name__ == "__main__":
    rosunit.unitrun("atmos_system_test", "offset_free", OffsetFree)
