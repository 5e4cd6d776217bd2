#!/usr/bin/python3
"""Two seconds without odometry in the middle of a move: valves close, the status says why, the flight recovers."""
import math
import os
import signal
import time
import unittest

import numpy as np
import rosunit
from atmos_msgs.msg import NmpcStatus

import harness
import flight_report

STEP_S = 2.0
LOSS_S = 3.05       # while the robot is under way
LOSS_LENGTH_S = 2.0
DURATION_S = 30.0
AGE_LIMIT_S = 0.5   # older odometry: valves closed
COAST_S = 0.05      # odometry ends this long after the last frame (config/mocap/topic.yaml)
SETPOINTS = [{"time_s": 0.0, "x_m": 0.0, "y_m": 0.0, "yaw_deg": 0.0},
             {"time_s": STEP_S, "x_m": 1.0, "y_m": 0.0, "yaw_deg": 45.0}]


class OdometryLoss(unittest.TestCase):
    def check(self, bag, loss_s, back_s, slack_s=0.0):
        """loss_s, back_s: last time with odometry and first one with it again, after the start of the flight."""
        flight = flight_report.load_flight(bag)
        time_s, open_valves = flight.command_time, flight.duty.max(axis=1) > 0.0

        before = (time_s > STEP_S - 1e-6) & (time_s < loss_s)
        self.assertTrue(open_valves[before].any(), "the robot was not under way when odometry was lost")
        closed_from = loss_s + AGE_LIMIT_S + harness.PERIOD_S
        lost = (time_s >= closed_from) & (time_s < back_s)
        self.assertFalse(open_valves[lost].any(), f"valves open at {time_s[lost][open_valves[lost]]} s")

        statuses = harness.messages(bag, "nmpc/status")
        said = [m for m in statuses
                if closed_from + slack_s <= harness.stamp(m) - flight.start < back_s - harness.PERIOD_S]
        self.assertGreater(len(said), 0.5 * (back_s - closed_from) / harness.PERIOD_S)
        self.assertEqual({(m.mode, m.odometry) for m in said}, {(NmpcStatus.MODE_CLOSED, NmpcStatus.ODOMETRY_LOST)})

        after = [m for m in statuses if harness.stamp(m) - flight.start > back_s + 1.0]
        self.assertEqual({m.mode for m in after}, {NmpcStatus.MODE_SOLVED})
        # Nothing was prepared for the period in which odometry came back: its problem is solved in it.
        solved = [m for m in statuses if m.mode == NmpcStatus.MODE_SOLVED]
        first = next(m for m in solved if harness.stamp(m) - flight.start > closed_from)
        self.assertFalse(first.feedback)
        self.assertGreater(np.mean([m.feedback for m in after]), 0.9)
        self.assertTrue(open_valves[time_s > back_s + 0.3].any(), "the controller did not come back")
        row = flight_report.setpoint_metrics(flight, flight_report.vehicle_forces(harness.VEHICLE))[-1]
        self.assertLessEqual(row["steady_position_error_m"], 0.01)
        self.assertLessEqual(row["steady_yaw_error_rad"], math.radians(1.0))

    def test_frames_are_lost_in_lockstep(self):
        scenario = harness.write_scenario(
            harness.scratch(), duration_s=DURATION_S, setpoints=SETPOINTS,
            mocap={"dropouts": [{"start_s": LOSS_S, "duration_s": LOSS_LENGTH_S}]})
        bag, _ = harness.fly(scenario)
        self.check(bag, LOSS_S + COAST_S, LOSS_S + LOSS_LENGTH_S)

    def test_the_bridge_stands_still_in_real_time(self):
        folder = harness.scratch()
        scenario = harness.write_scenario(folder, duration_s=DURATION_S, setpoints=SETPOINTS)
        bag, summary = os.path.join(folder, "run.bag"), os.path.join(folder, "sim.json")
        with harness.Launch("sim.launch", scenario=scenario, record=bag, summary=summary, clock="real") as launch:
            launch.wait_for("t = 5 /")
            bridge = launch.node_pid("mocap_bridge")
            os.kill(bridge, signal.SIGSTOP)
            time.sleep(LOSS_LENGTH_S)
            os.kill(bridge, signal.SIGCONT)
            log = launch.wait(60.0)
        self.assertTrue(os.path.exists(summary), log)

        # The gap as the controller saw it: between the odometry that arrived before and after it.
        arrivals = self.arrivals(bag)
        widest = int(np.argmax(np.diff(arrivals)))
        self.assertGreater(arrivals[widest + 1] - arrivals[widest], 0.9 * LOSS_LENGTH_S)
        self.check(bag, arrivals[widest], arrivals[widest + 1], slack_s=harness.PERIOD_S)

    @staticmethod
    def arrivals(bag):
        """ROS times, after the start of the flight, at which odometry was recorded."""
        start = flight_report.load_flight(bag).start
        with harness.rosbag.Bag(bag) as opened:
            return np.array([t.to_sec() - start for _, _, t in opened.read_messages(topics=["/atmos/odometry"])])


if __name__ == "__main__":
    rosunit.unitrun("atmos_system_test", "odometry_loss", OdometryLoss)
