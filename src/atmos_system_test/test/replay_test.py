#!/usr/bin/python3
"""A recorded flight goes through the same nodes again: of a flight in lockstep, odometry and commands come out bit for bit, at
any speed and out of split files; of one in real time, within the noise of the odometry filter."""
import glob
import io
import os
import unittest

import numpy as np
import rosunit

import harness
import flight_report

DURATION_S = 13.0
STEP = [{"time_s": 0.0, "x_m": 0.0, "y_m": 0.0, "yaw_deg": 0.0}, {"time_s": 2.0, "x_m": 0.5, "y_m": 0.0, "yaw_deg": 45.0}]
OUTCOME = ("odometry", "mocap/status", "nmpc/thrusters", "nmpc/wrench", "nmpc/rate", "disturbance", "thruster_command")
OFFSET_FREE = harness.controller("offset_free_wrench")


def payloads(bags, name):
    """(stamp, bytes) of each message of a topic; not the sequence number, which counts what a process has sent."""
    result = []
    for bag in bags:
        for message in harness.messages(bag, name):
            message.header.seq = 0
            buffer = io.BytesIO()
            message.serialize(buffer)
            result.append((message.header.stamp.to_nsec(), buffer.getvalue()))
    return result


class Replay(unittest.TestCase):
    def replay(self, bags, folder, **arguments):
        replayed = os.path.join(folder, "replayed.bag")
        with harness.Launch("replay.launch", bag=" ".join(bags), record=replayed, **arguments) as launch:
            log = launch.wait(90.0)
        self.assertTrue(os.path.exists(replayed), log)
        self.assertIn("replay: over", log)
        return replayed, log

    def assert_same(self, flown, replayed, log):
        compared = 0
        for name in OUTCOME:
            before, after = payloads(flown, name), payloads([replayed], name)
            self.assertEqual([stamp for stamp, _ in before], [stamp for stamp, _ in after], f"{name}\n{log}")
            differing = [stamp for (stamp, a), (_, b) in zip(before, after) if a != b]
            self.assertEqual(differing, [], f"{name} differs\n{log}")
            compared += len(before)
        self.assertGreater(compared, 2.0 * 100.0 * DURATION_S)  # odometry and status of each frame, and commands

    def test_a_flight_in_lockstep_is_repeated_bit_for_bit(self):
        # Frames are lost, so that the filter coasts and the controller predicts, and the observer remembers everything.
        folder = harness.scratch()
        scenario = harness.write_scenario(folder, duration_s=DURATION_S, setpoints=STEP, controller=OFFSET_FREE,
                                          mocap={"dropout_probability": 0.1})
        bag, _ = harness.fly(scenario, controller=OFFSET_FREE, split_s=4.0)
        flown = sorted(glob.glob(bag.replace("run.bag", "run_*.bag")))
        self.assertEqual(len(flown), 4)
        for speed in (0.0, 5.0):
            with self.subTest(speed=speed):
                replayed, log = self.replay(flown, folder, controller=OFFSET_FREE, speed=speed)
                self.assert_same(flown, replayed, log)
                self.assertNotIn("warning", log)
        # What another controller would have asked for: the same estimates, other commands, and the log says so.
        replayed, log = self.replay(flown, folder, controller=harness.CONTROLLER)
        self.assertIn("/atmos/nmpc/controller is not the recorded file", log)
        self.assertEqual(payloads(flown, "odometry"), payloads([replayed], "odometry"))
        self.assertNotEqual(payloads(flown, "thruster_command"), payloads([replayed], "thruster_command"))

    def test_a_flight_in_real_time_is_repeated_closely(self):
        folder = harness.scratch()
        scenario = harness.write_scenario(folder, duration_s=DURATION_S, setpoints=STEP)
        flown, _ = harness.fly(scenario, clock="real")
        replayed, log = self.replay([flown], folder, clock="real")

        live = flight_report.load_flight(flown)
        commands = harness.messages(replayed, "thruster_command")
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
        # The filter's own standard deviations, from its covariance.
        position_noise = np.sqrt(np.median([a.pose.covariance[0] for a, _ in pairs]))
        speed_noise = np.sqrt(np.median([a.twist.covariance[0] for a, _ in pairs]))
        print(f"replay in real time: position RMS {1e6 * np.sqrt(np.mean(np.square(position))):.2f} um, max "
              f"{1e6 * np.max(position):.2f} um (noise {1e6 * position_noise:.1f} um); speed RMS "
              f"{1e3 * np.sqrt(np.mean(np.square(speed))):.3f} mm/s (noise {1e3 * speed_noise:.2f} mm/s)")
        self.assertLess(np.sqrt(np.mean(np.square(position))), position_noise)
        self.assertLess(np.sqrt(np.mean(np.square(speed))), speed_noise)


if __name__ == "__main__":
    rosunit.unitrun("atmos_system_test", "replay", Replay)
