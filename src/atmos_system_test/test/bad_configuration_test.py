#!/usr/bin/python3
"""Bad configuration: one message that names file, key and rule; exit code 2; nothing flies."""
import glob
import os
import subprocess
import unittest

import rosunit
import yaml

import harness


def run(package, program, *arguments):
    binary = os.path.join(harness.ROOT, "devel", "lib", package, program)
    return subprocess.run([binary, *arguments], capture_output=True, text=True, timeout=20)


def mutated(path, folder, change):
    """A copy of a YAML file after change(content)."""
    with open(path) as file:
        content = yaml.safe_load(file)
    change(content)
    copy = os.path.join(folder, os.path.basename(path))
    with open(copy, "w") as file:
        yaml.safe_dump(content, file)
    return copy


class BadConfiguration(unittest.TestCase):
    def setUp(self):
        self.folder = harness.scratch()

    def refused(self, result, *words):
        self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
        for word in words:
            self.assertIn(word, result.stderr)

    def scenario_with_vehicle(self, change):
        vehicle = mutated(harness.VEHICLE, self.folder, change)
        return run("atmos_operator", "check_scenario", harness.write_scenario(self.folder, vehicle=vehicle))

    def test_every_shipped_file_is_accepted(self):
        scenarios = glob.glob(os.path.join(harness.CONFIG, "scenario", "*.yaml"))
        controllers = glob.glob(os.path.join(harness.CONFIG, "controller", "*.yaml"))
        self.assertTrue(scenarios and controllers)
        for path in scenarios:
            result = run("atmos_operator", "check_scenario", path)
            self.assertEqual(result.returncode, 0, result.stderr)
        for path in controllers:
            result = run("atmos_nmpc", "check_controller", "--vehicle", harness.VEHICLE, path)
            self.assertEqual(result.returncode, 0, result.stderr)

    def test_zero_thruster_axis(self):
        def change(content):
            content["vehicle"]["thrusters"][2]["direction"] = [0, 0, 0]
        self.refused(self.scenario_with_vehicle(change), "atmos.yaml", "thrusters[2].direction",
                     "must not be the zero vector")

    def test_negative_mass(self):
        def change(content):
            content["vehicle"]["mass_kg"] = -16.8
        self.refused(self.scenario_with_vehicle(change), "atmos.yaml", "mass_kg", "must be > 0, is -16.8")

    def test_horizon_of_zero(self):
        def change(content):
            content["controller"]["horizon"]["steps"] = 0
        path = mutated(harness.CONTROLLER, self.folder, change)
        result = run("atmos_nmpc", "check_controller", "--vehicle", harness.VEHICLE, path)
        self.refused(result, "direct_allocation.yaml", "horizon.steps", "must be in [")

    def test_unknown_key(self):
        self.refused(run("atmos_operator", "check_scenario", harness.write_scenario(self.folder, speling=1)),
                     "scenario.yaml", "speling", "is not a known key")

    def test_broken_yaml(self):
        path = os.path.join(self.folder, "broken.yaml")
        with open(path, "w") as file:
            file.write("name: broken\nsetpoints: [{time_s: 0\n")
        self.refused(run("atmos_operator", "check_scenario", path), "broken.yaml", "is not valid YAML")

    def test_every_fault_at_once(self):
        def change(content):
            content["vehicle"]["mass_kg"] = "heavy"
            del content["vehicle"]["pwm"]["period_s"]
            content["vehicle"]["colour"] = "blue"
        result = self.scenario_with_vehicle(change)
        self.refused(result, "mass_kg", "period_s", "colour")
        self.assertEqual(len(result.stderr.strip().splitlines()), 3)

    def test_a_launch_with_it_ends_at_once(self):
        scenario = harness.write_scenario(self.folder, duration_s=-1.0)
        summary = os.path.join(self.folder, "sim.json")
        with harness.Launch("sim.launch", scenario=scenario, summary=summary) as launch:
            log = launch.wait(40.0)
        self.assertIn("exit code 2", log)
        self.assertIn("duration_s", log)
        self.assertIn("must be > 0, is -1", log)
        self.assertNotIn("sim: t =", log)
        self.assertFalse(os.path.exists(summary))


if __name__ == "__main__":
    rosunit.unitrun("atmos_system_test", "bad_configuration", BadConfiguration)
