#!/usr/bin/python3
"""Flights through px4_bridge, a serial line and the emulated Pixhawk: each controller reaches its set-points, and faults of
the line close the valves until the flight goes on by itself. ATMOS_LONG_TESTS=1: the paper's whole sequence."""
import math
import os
import unittest

import numpy as np
import rosunit
from atmos_msgs.msg import SupervisorStatus

import harness
import flight_report

LONG = "ATMOS_LONG_TESTS" in os.environ
# Controller, firmware, steady error allowed [m, deg]: the rate level 3 cm and 2 deg, the others 1 cm and 1 deg. The short
# flight at the rate level is the one with the faults.
FLIGHTS = [("direct_allocation", "patched", 0.01, 1.0), ("wrench", "patched", 0.01, 1.0),
           ("offset_free_direct_allocation", "patched", 0.01, 1.0)]
LONG_FLIGHTS = [("rate", "patched", 0.03, 2.0), ("rate", "stock", 0.03, 2.0), ("offset_free_wrench", "patched", 0.01, 1.0)]
STEP = [{"time_s": 0.0, "x_m": 0.0, "y_m": 0.0, "yaw_deg": 0.0},
        {"time_s": 3.5, "x_m": 0.2, "y_m": 0.1, "yaw_deg": 10.0}]
PWM_S = 0.1
OFFBOARD_LOSS_S = 0.5  # COM_OF_LOSS_T in config/px4/pixhawk.yaml


class Serial(unittest.TestCase):
    def check_steady(self, bag, log, position_m, yaw_deg):
        flight = flight_report.load_flight(bag)
        rows = flight_report.setpoint_metrics(flight, flight_report.vehicle_forces(harness.VEHICLE))
        for row in rows:
            print({k: round(v, 5) if isinstance(v, float) else v for k, v in row.items()})
            self.assertLessEqual(row["steady_position_error_m"], position_m, log)
            self.assertLessEqual(row["steady_yaw_error_rad"], math.radians(yaw_deg), log)
        self.assertGreater(rows[-1]["impulse_n_s"], 0.5, "the robot got there without thrust")

    def test_each_controller_reaches_its_set_points(self):
        for name, firmware, position_m, yaw_deg in FLIGHTS + (LONG_FLIGHTS if LONG else []):
            with self.subTest(controller=name, firmware=firmware):
                changes = {} if LONG else {"duration_s": 14.0, "setpoints": STEP}
                scenario = harness.write_scenario(harness.scratch(), controller=harness.controller(name), **changes)
                bag, log = harness.fly(scenario, 180.0, controller=harness.controller(name), fmu="serial", firmware=firmware,
                                       speed=1.0 if LONG else 1.5)
                print(name, firmware)
                self.check_steady(bag, log, position_m, yaw_deg)
                states = harness.messages(bag, "px4/supervisor")
                flown = [s for s in states if s.state == SupervisorStatus.FLYING]
                self.assertGreater(len(flown), 0.7 * len(states), log)
                # What the bridge says of the valves is what the valves were told.
                told = {round(harness.stamp(m), 1): m.duty for m in harness.messages(bag, "valves")}
                for message in harness.messages(bag, "thruster_command")[20:]:
                    np.testing.assert_allclose(message.duty, told[round(harness.stamp(message), 1)], atol=1e-4)

    def test_an_unplugged_cable_and_a_reboot_are_recovered_from(self):
        folder = harness.scratch()
        scenario = harness.write_scenario(folder, duration_s=30.0, setpoints=STEP, controller=harness.controller("rate"))
        bag, summary = os.path.join(folder, "run.bag"), os.path.join(folder, "sim.json")
        with harness.Launch("sim.launch", scenario=scenario, controller=harness.controller("rate"), fmu="serial", firmware="stock",
                            record=bag, summary=summary) as launch:
            harness.disturb_the_line(launch, unplug_s=5, reboot_s=15)
            log = launch.wait(60.0)

        states = harness.messages(bag, "px4/supervisor")
        took_off = next(harness.stamp(s) for s in states if s.state == SupervisorStatus.FLYING)
        lost = [harness.stamp(s) for s in states if s.rule == SupervisorStatus.LINK_LOST and harness.stamp(s) > took_off]
        self.assertTrue(lost, log)
        # The supervisor notices half a second after the plug was pulled; so does the autopilot.
        begin, end = lost[0] + OFFBOARD_LOSS_S + 2.0 * PWM_S, lost[-1]
        self.assertGreater(end - lost[0], 2.0, log)
        valves = [(harness.stamp(m), max(m.duty)) for m in harness.messages(bag, "valves")]
        self.assertEqual([t for t, duty in valves if begin < t < end and duty > 0.0], [], "valves open without a line")

        links = harness.messages(bag, "px4/state")
        self.assertEqual((links[-1].opened, links[-1].reboots), (2, 1), log)
        reboot = next(harness.stamp(m) for m in links if m.reboots == 1)
        for event in (end, reboot):
            back = [harness.stamp(s) for s in states if s.state == SupervisorStatus.FLYING and harness.stamp(s) > event + 0.3]
            self.assertTrue(back and back[0] < event + 5.0, f"no recovery after {event}:\n{log}")
        self.assertEqual(states[-1].state, SupervisorStatus.FLYING, log)
        self.check_steady(bag, log, 0.03, 2.0)


if __name__ == "__main__":
    rosunit.unitrun("atmos_system_test", "serial", Serial)
