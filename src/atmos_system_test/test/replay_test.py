#!/usr/bin/python3
"""A recorded flight goes through the same nodes again: odometry and commands come out as they did in flight."""
import os
import unittest

import numpy as np
import rosunit

import harness
import flight_report

DURATION_S = 15.0


class Replay(unittest.TestCase):
    def test_replay_is_close_to_the_flight(self):
        folder = harness.scratch()
        scenario = harness.write_scenario(
            folder, duration_s=DURATION_S,
            setpoints=[{"time_s": 0.0, "x_m": 0.0, "y_m": 0.0, "yaw_deg": 0.0},
                       {"time_s": 2.0, "x_m": 0.5, "y_m": 0.0, "yaw_deg": 45.0}])
        flown, _ = harness.fly(scenario, clock="real")
        replayed = os.path.join(folder, "replayed.bag")
        with harness.Launch("replay.launch", bag=flown, record=replayed) as launch:
            log = launch.wait(60.0)
        self.assertTrue(os.path.exists(replayed), log)

        live = flight_report.load_flight(flown)
        commands = [m for m in harness.messages(replayed, "thruster_command")]
        self.assertGreater(len(commands), 0.9 * DURATION_S / harness.PERIOD_S, log)
        self.assertGreater(np.array([m.duty for m in commands]).max(), 0.2, "the replayed controller asked for nothing")

        # Over the step, the replayed controller asks for the impulse that was asked for in flight.
        def impulse(messages):
            return sum(m.period * sum(m.duty) for m in messages if 2.0 <= harness.stamp(m) - live.start < 6.0)
        in_flight = impulse(harness.messages(flown, "thruster_command"))
        self.assertAlmostEqual(impulse(commands) / in_flight, 1.0, delta=0.2)

        before = {m.header.stamp: m for m in harness.messages(flown, "odometry")}
        pairs = [(before[m.header.stamp], m) for m in harness.messages(replayed, "odometry")
                 if m.header.stamp in before and harness.stamp(m) - live.start > 1.0]
        self.assertGreater(len(pairs), 0.9 * (DURATION_S - 1.0) * 100.0, log)
        position = [np.hypot(a.pose.pose.position.x - b.pose.pose.position.x,
                             a.pose.pose.position.y - b.pose.pose.position.y) for a, b in pairs]
        speed = [np.hypot(a.twist.twist.linear.x - b.twist.twist.linear.x,
                          a.twist.twist.linear.y - b.twist.twist.linear.y) for a, b in pairs]
        self.assertLess(np.max(position), 0.003)
        self.assertLess(np.sqrt(np.mean(np.square(speed))), 0.02)


if __name__ == "__main__":
    rosunit.unitrun("atmos_system_test", "replay", Replay)
