#!/usr/bin/python3
"""Figures and metrics of recordings whose answers are known in closed form: coupling and slope are found again, what is not in
a bag is said and not drawn, and the page needs no other file. No ROS master."""
import contextlib
import io
import json
import math
import os
import re
import subprocess
import sys
import unittest

import numpy as np
import rosbag
import rosunit
from atmos_msgs.msg import ConfigurationFile, RunConfiguration, ThrusterCommand
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from rospy import Time

import harness
import compare_flights
import flight_bag
import flight_metrics
import flight_report
import run_configuration

START_S, PERIOD_S, STEP_S = 1234.5, 0.1, 0.01
LOSS, SLOPE = 0.11, (0.0012, -0.0007)  # per further open thruster; rise of the floor, m/m
VEHICLE = flight_bag.load_vehicle(harness.VEHICLE)


def pose_of(message_pose, x, y, yaw):
    message_pose.position.x, message_pose.position.y = x, y
    message_pose.orientation.z, message_pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)


def write_bag(path, names, duration_s=60.0):
    """A flight of random duties of thrusters 1 and 3 (+x) with 2 and 4, 5 to 8 in turn: so that the robot does not turn, and
    every impulse is exact. `names`: which topics are written."""
    rng = np.random.default_rng(3)
    x = np.array([0.0, 0.0])
    v = np.array([0.0, 0.0])
    directions = np.array([t["direction"][:2] for t in VEHICLE["thrusters"]], dtype=float)
    pairs = [(0, 2), (1, 3), (4, 6), (5, 7)]
    with rosbag.Bag(path, "w") as bag:
        def put(name, message, t):
            if name in names:
                message.header.stamp = Time.from_sec(t)
                message.header.frame_id = "world"
                bag.write("/atmos/" + name, message, Time.from_sec(t))
        goal = PoseStamped()
        pose_of(goal.pose, 1.0, 0.0, 0.0)
        put("setpoint", goal, START_S)
        for k in range(int(duration_s / PERIOD_S)):
            begin = START_S + k * PERIOD_S
            # Towards the start again, so that the robot stays; the other axis at random.
            duty = np.zeros(8)
            for axis, (plus, minus) in enumerate(((pairs[0], pairs[1]), (pairs[3], pairs[2]))):
                wanted = -0.3 * x[axis] - 1.5 * v[axis] + rng.uniform(-0.4, 0.4)
                duty[list(plus if wanted > 0 else minus)] = min(abs(wanted), 1.0)
            command = ThrusterCommand(period=PERIOD_S, duty=duty.tolist())
            put("thruster_command", command, begin)
            overlap = np.minimum(duty[:, None], duty[None, :]).sum(axis=1) - duty
            push = (1.7 * (duty - LOSS * overlap)) @ directions / VEHICLE["mass_kg"]
            push = push - flight_metrics.GRAVITY * np.array(SLOPE)
            for i in range(int(round(PERIOD_S / STEP_S))):
                truth = Odometry()
                pose_of(truth.pose.pose, x[0], x[1], 0.0)
                truth.twist.twist.linear.x, truth.twist.twist.linear.y = v
                put("sim/truth", truth, begin + i * STEP_S)
                frame = PoseStamped()
                pose_of(frame.pose, x[0], x[1], 0.0)
                put("mocap/pose", frame, begin + i * STEP_S)
                x, v = x + v * STEP_S + 0.5 * push * STEP_S ** 2, v + push * STEP_S
        if "configuration" in names:
            bag.write("/atmos/configuration", configuration(), Time.from_sec(START_S))
    return path


def configuration():
    with open(harness.VEHICLE) as file:
        text = file.read()
    entry = ConfigurationFile(path="/elsewhere/atmos.yaml", used_by=["/atmos/nmpc/vehicle"], content=text)
    entry.sha256 = run_configuration.hashlib.sha256(text.encode()).hexdigest()
    message = RunConfiguration(revision="v1", parameters=["/atmos/nmpc/lockstep: true"], files=[entry])
    message.digest = run_configuration.digest_of(message.files)
    return message


def report(bag, out, *arguments):
    """Exit code and output of scripts/figures."""
    run = subprocess.run([os.path.join(harness.ROOT, "scripts", "figures"), bag, "--out", out, *arguments],
                         capture_output=True, text=True)
    return run.returncode, run.stdout + run.stderr


class Figures(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = harness.scratch()
        cls.bag = write_bag(os.path.join(cls.folder, "whole.bag"), ("setpoint", "thruster_command", "sim/truth", "configuration"))

    def test_coupling_and_slope_are_found_again(self):
        flight = flight_report.load_flight(self.bag)
        impulses = flight_metrics.Impulses(flight, VEHICLE)
        loss, deviation = flight_metrics.coupling(impulses)
        self.assertAlmostEqual(loss, LOSS, delta=1e-3)
        self.assertLess(deviation, 1e-3)
        rows = flight_metrics.floor_push(impulses, LOSS)
        self.assertGreater(len(rows), 3)
        for row in rows:
            np.testing.assert_allclose(row[2:], -flight_metrics.GRAVITY * np.array(SLOPE), atol=1e-5)

    def test_poses_alone_give_velocities(self):
        bag = write_bag(os.path.join(self.folder, "poses.bag"), ("mocap/pose",))
        (flight,) = flight_report.read([bag]).robots.values()
        self.assertEqual(flight.motion_source, "mocap/pose")
        truth = flight_report.load_flight(self.bag).motion
        inside = slice(50, -50)
        error = np.interp(truth.time[inside], flight.motion.time, flight.motion.vx) - truth.vx[inside]
        self.assertLess(np.sqrt(np.mean(error ** 2)), 0.05 * np.ptp(truth.vx))

    def test_the_page_needs_no_other_file_and_says_what_is_missing(self):
        out = os.path.join(self.folder, "whole")
        code, text = report(self.bag, out)
        self.assertEqual(code, 0, text)
        with open(os.path.join(out, "report.html")) as file:
            page = file.read()
        drawn = sorted(os.listdir(os.path.join(out, "figures")))
        names = {os.path.splitext(name)[0] for name in drawn}
        self.assertEqual(names, {"states", "plan_view", "inputs", "duty_histogram", "coupling", "floor"})
        self.assertEqual(len(drawn), 3 * len(names))  # PNG, PDF, SVG
        self.assertEqual(page.count("<img"), len(names))
        for reference in re.findall(r'(?:src|href)="([^"]*)"', page):
            self.assertTrue(reference.startswith("data:"), reference[:80])
        for missing in ("no nmpc/wrench", "no nmpc/rate", "no disturbance", "no nmpc/status", "no /stl/plan", "neither pneumatics"):
            self.assertIn(missing, page)
            self.assertIn(missing, text)
        self.assertIn("the recorded configuration", page)
        with open(os.path.join(out, "summary.json")) as file:
            summary = json.load(file)
        self.assertAlmostEqual(summary["gas_kg"], 0.0035 * sum(summary["open_s"]), 9)
        self.assertAlmostEqual(summary["impulse_n_s"], 1.7 * sum(summary["open_s"]), 6)
        histogram = summary["duty_histogram"]
        self.assertAlmostEqual(histogram["closed"] + sum(histogram["share"]), 1.0)

    def test_a_bag_with_poses_only(self):
        bag = write_bag(os.path.join(self.folder, "bare.bag"), ("mocap/pose",), 5.0)
        code, text = report(bag, os.path.join(self.folder, "bare"))
        self.assertEqual(code, 0, text)
        self.assertIn("no thruster_command", text)
        self.assertEqual(len(os.listdir(os.path.join(self.folder, "bare", "figures"))), 6)  # states and path

    def test_what_is_no_bag(self):
        path = os.path.join(self.folder, "none.bag")
        with open(path, "w") as file:
            file.write("not a bag")
        for bag in (path, os.path.join(self.folder, "missing.bag")):
            code, text = report(bag, os.path.join(self.folder, "none"))
            self.assertEqual(code, 1)
            self.assertIn(bag, text)
            self.assertNotIn("Traceback", text)

    def test_two_runs_side_by_side(self):
        other = write_bag(os.path.join(self.folder, "other.bag"), ("setpoint", "thruster_command", "sim/truth"), 20.0)
        figure = os.path.join(self.folder, "both.svg")
        printed = io.StringIO()
        arguments, sys.argv = sys.argv, ["compare", self.bag + "=long", other, "--out", figure]
        try:
            with contextlib.redirect_stdout(printed):
                self.assertEqual(compare_flights.main(), 0)
        finally:
            sys.argv = arguments
        lines = printed.getvalue().splitlines()
        self.assertRegex(lines[0], r"long +other\.bag$")
        opened = next(line for line in lines if line.startswith("thrusters open"))
        long, short = map(float, opened.split()[-2:])
        self.assertGreater(long, 2.0 * short)
        self.assertGreater(os.path.getsize(figure), 10000)

    def test_a_configuration_that_was_changed_is_noticed(self):
        self.assertEqual(run_configuration.faults(configuration()), [])
        changed = configuration()
        changed.files[0].content += "#"
        self.assertEqual(len(run_configuration.faults(changed)), 1)
        moved = configuration()
        moved.files[0].used_by = ["/atmos/nmpc/controller"]
        self.assertEqual(len(run_configuration.faults(moved)), 1)


if __name__ == "__main__":
    rosunit.unitrun("atmos_system_test", "figures", Figures)
