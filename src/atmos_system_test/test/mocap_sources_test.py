#!/usr/bin/python3
"""Set-points flown through an emulated Qualisys and through rendered images: the steady errors of each.

Two set-points; ATMOS_LONG_TESTS=1: the paper's sequence. That the topic does it is shown by sequence_test.
"""
import math
import os
import socket
import unittest

import rosunit
import yaml

import harness
import flight_report

MOCAP = os.path.join(harness.CONFIG, "mocap")
LONG = bool(os.environ.get("ATMOS_LONG_TESTS"))


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def changed(folder, name, source, **changes):
    """A copy of a configuration file with some keys of the top level or of `source` replaced; returns the path."""
    with open(source) as file:
        config = yaml.safe_load(file)
    for key, value in changes.items():
        (config["source"] if "source" in config and key in config["source"] else config)[key] = value
    path = os.path.join(folder, name)
    with open(path, "w") as file:
        yaml.safe_dump(config, file)
    return path


class MocapSources(unittest.TestCase):
    def fly(self, position_m, yaw_deg, **arguments):
        folder = harness.scratch()
        changes = {} if LONG else {
            "duration_s": 20.0,
            "setpoints": [{"time_s": 0.0, "x_m": 0.0, "y_m": 0.0, "yaw_deg": 0.0},
                          {"time_s": 5.0, "x_m": 0.4, "y_m": 0.2, "yaw_deg": 45.0}]}
        bag, log = harness.fly(harness.write_scenario(folder, **changes), 240.0, **arguments)
        flight = flight_report.load_flight(bag)
        rows = flight_report.setpoint_metrics(flight, flight_report.vehicle_forces(harness.VEHICLE))
        self.assertEqual(len(rows), 5 if LONG else 2, log)
        self.assertEqual(flight.motion_source, "sim/truth")
        for row in rows:
            print(f"{arguments['mocap']}: steady errors {1e3 * row['steady_position_error_m']:.2f} mm, "
                  f"{math.degrees(row['steady_yaw_error_rad']):.3f} deg")
            self.assertIsNotNone(row["settling_s"])
            self.assertLessEqual(row["steady_position_error_m"], position_m)
            self.assertLessEqual(row["steady_yaw_error_rad"], math.radians(yaw_deg))
        # What the source made of the poses is what was recorded as mocap/pose.
        self.assertEqual({m.header.frame_id for m in harness.messages(bag, "mocap/pose")}, {"world"})
        self.assertEqual(sum(m.state == m.LOST for m in harness.messages(bag, "mocap/status")), 0)

    def test_qtm(self):
        folder, port = harness.scratch(), free_port()
        self.fly(0.01, 1.0, mocap="qtm", mocap_config=changed(folder, "qtm.yaml", f"{MOCAP}/qtm.yaml", port=port),
                 emulator_config=changed(folder, "emulator.yaml", f"{MOCAP}/emulator/qtm.yaml", port=port))

    def test_camera(self):
        self.fly(0.03, 2.0, mocap="camera")


if __name__ == "__main__":
    rosunit.unitrun("atmos_system_test", "mocap_sources", MocapSources)
