#!/usr/bin/python3
"""In lockstep a seed determines the flight: payloads of commands and odometry and the truth, bit for bit."""
import io
import unittest

import rosunit

import harness

DURATION_S = 12.0
TOPICS = ("thruster_command", "odometry", "sim/truth", "mocap/pose")


def payloads(bag, name):
    """Stamp to serialised message, without the sequence number, which counts publications and is no payload, and without
    the last instant: nobody waits for the answers to it."""
    result = {}
    end = harness.stamp(harness.messages(bag, "setpoint")[0]) + DURATION_S
    for message in harness.messages(bag, name):
        if harness.stamp(message) > end - 1e-6:
            continue
        message.header.seq = 0
        buffer = io.BytesIO()
        message.serialize(buffer)
        result[message.header.stamp.to_nsec()] = buffer.getvalue()
    return result


class LockstepRepeats(unittest.TestCase):
    def fly(self, name, seed):
        scenario = harness.write_scenario(
            harness.scratch(), name, seed=seed, duration_s=DURATION_S,
            setpoints=[{"time_s": 0.0, "x_m": 0.0, "y_m": 0.0, "yaw_deg": 0.0},
                       {"time_s": 2.0, "x_m": 0.5, "y_m": -0.3, "yaw_deg": 60.0},
                       {"time_s": 7.0, "x_m": 0.0, "y_m": 0.2, "yaw_deg": -30.0}],
            mocap={"dropouts": [{"start_s": 4.0, "duration_s": 0.25}], "dropout_probability": 0.05})
        bag, _ = harness.fly(scenario)
        return {topic: payloads(bag, topic) for topic in TOPICS}

    def test_same_seed_same_flight_other_seed_another(self):
        first, second, other = self.fly("first", 7), self.fly("second", 7), self.fly("other", 8)
        self.assertEqual(len(first["thruster_command"]), 120)
        for topic in TOPICS:
            common = first[topic].keys() & second[topic].keys()
            self.assertEqual(first[topic].keys(), second[topic].keys(), f"{topic}: a recording is incomplete")
            differing = sorted(t for t in common if first[topic][t] != second[topic][t])
            self.assertEqual(differing, [], f"{topic}: two flights with the same seed differ at these stamps")
            self.assertTrue(any(first[topic][t] != other[topic].get(t) for t in common), f"{topic} ignores the seed")


if __name__ == "__main__":
    rosunit.unitrun("atmos_system_test", "lockstep_repeats", LockstepRepeats)
