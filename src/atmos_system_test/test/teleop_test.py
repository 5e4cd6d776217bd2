#!/usr/bin/python3
"""A hand on a joystick: the robot moves while the dead man is held, and the valves are closed on release and on silence."""
import functools
import math
import os
import pty
import signal
import struct
import subprocess
import termios
import threading
import time
import unittest

import rospy
import rosunit
from atmos_msgs.msg import NmpcStatus, ThrusterCommand
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Joy

import harness

HOLD = [{"time_s": 0.0, "x_m": 0.0, "y_m": 0.0, "yaw_deg": 0.0}]
CLOSED_WITHIN_S = 0.5
LEAD_S = 0.03  # a command comes this long before its period
ATTEMPTS = 4  # a machine under load may stall this process, too
REPORTED = {"sim/truth": Odometry, "setpoint": PoseStamped, "nmpc/status": NmpcStatus, "thruster_command": ThrusterCommand}
KEYBOARD = os.path.join(harness.ROOT, "devel", "lib", "atmos_operator", "teleop_keyboard")


class TestMaster:
    """The master of this test, to be joined by launches."""
    port = os.environ.get("ROS_MASTER_URI", "").rstrip("/").rpartition(":")[2]


class Hand:
    """A joystick that says what it reads 50 times a second, or nothing, and sees what the robot does."""

    def __init__(self):
        self.reading, self.last_s = None, 0.0
        self.open_s, self.commands, self.set_points, self.truth = 0.0, 0, [], None
        self.newest = {}  # message by topic, for a test that fails
        self.publisher = rospy.Publisher("/atmos/joy", Joy, queue_size=1)
        self.subscribers = [rospy.Subscriber("/atmos/thruster_command", ThrusterCommand, self.on_command, tcp_nodelay=True),
                            rospy.Subscriber("/atmos/sim/truth", Odometry, self.on_truth),
                            rospy.Subscriber("/atmos/setpoint", PoseStamped, self.on_set_point)]
        self.subscribers += [rospy.Subscriber("/atmos/" + topic, kind, functools.partial(self.newest.__setitem__, topic))
                             for topic, kind in REPORTED.items()]
        threading.Thread(target=self.run, daemon=True).start()

    def on_command(self, message):
        self.commands += 1
        if max(message.duty) > 0.0:
            self.open_s = time.monotonic()

    def on_truth(self, message):
        self.truth = message

    def on_set_point(self, message):
        self.set_points.append(message.pose.position)

    def seen(self):
        """What was seen last, a line per topic."""
        lines = [f"{self.commands} commands, {len(self.set_points)} set-points"]
        for topic in REPORTED:
            message = self.newest.get(topic, "none")
            parts = [message.header, message.pose.pose, message.twist.twist] if isinstance(message, Odometry) else [message]
            lines.append(f"{topic}: " + " ".join(" ".join(map(str, parts)).split()))
        return "\n".join(lines)

    def run(self):
        while True:
            if self.reading:
                self.publisher.publish(Joy(axes=self.reading[0], buttons=self.reading[1]))
                self.last_s = time.monotonic()
            time.sleep(0.02)

    def hold(self, forward=0.0, left=0.0, turn=0.0):
        self.reading = ([left, forward, 0.0, turn], [0, 0, 0, 0, 0, 1])

    def release(self):
        """Let go, with the sticks where they were: it is the dead man that counts."""
        self.reading = (self.reading[0] if self.reading else [0.0] * 4, [0] * 6)

    def fall_silent(self):
        self.reading = None


class Teleop(unittest.TestCase):
    flown = None  # the newest world

    @classmethod
    def setUpClass(cls):
        rospy.init_node("teleop_test")  # before use_sim_time: a hand lives in wall time
        cls.hand = Hand()

    def wait(self, what, condition, launch, limit_s=30.0):
        deadline = time.monotonic() + limit_s
        while not condition():
            if launch.process.poll() is not None or time.monotonic() >= deadline:
                self.give_up(what, launch)
            time.sleep(0.02)

    def give_up(self, what, launch):
        """Fails with what was seen last and what the launch and its world have said."""
        logs = [launch.text()] + ([self.flown.text()] if self.flown not in (None, launch) else [])
        self.fail("\n".join([f"no {what}; exit code {launch.process.poll()}", self.hand.seen(), *logs]))

    def hold_until(self, what, condition, launch, **sticks):
        """Holds the dead man, again every few seconds: a machine that stalls makes a silence, after which he must be released."""
        for _ in range(6):
            self.hand.release()
            time.sleep(0.3)
            self.hand.hold(**sticks)
            deadline = time.monotonic() + 5.0
            while time.monotonic() < deadline:
                if condition():
                    return
                if launch.process.poll() is not None:
                    self.give_up(what, launch)
                time.sleep(0.02)
        self.give_up(what, launch)

    def world(self, **arguments):
        self.hand.truth, self.hand.commands = None, 0
        self.hand.newest.clear()
        scenario = harness.write_scenario(harness.scratch(), duration_s=1000.0, setpoints=HOLD)
        self.flown = harness.Launch("sim.launch", joins=TestMaster, scenario=scenario, clock="real", **arguments)
        return self.flown

    def teleop(self, world, mode):
        self.hand.release()
        self.wait("end of the last teleop", lambda: self.hand.publisher.get_num_connections() == 0, world)
        # Before it has set use_sim_time, a node would live in wall time for ever.
        self.wait("simulated robot", lambda: self.hand.truth and self.hand.commands > 5, world)
        teleop = harness.Launch("teleop.launch", joins=TestMaster, mode=mode)
        self.wait("teleop", lambda: self.hand.publisher.get_num_connections() > 0, teleop)
        time.sleep(0.3)
        return teleop

    def push(self, launch, **sticks):
        """Holds the dead man until valves have opened, then a little longer."""
        begin = time.monotonic() + 0.2
        self.hold_until("open valve", lambda: self.hand.open_s > begin, launch, **sticks)
        time.sleep(0.7)
        self.assertGreater(self.hand.open_s, time.monotonic() - 0.5, "valves closed while held")

    def closed_after(self, let_go, launch, **sticks):
        """Seconds from letting go until the end of the last period in which a valve was open; least of the attempts."""
        least = math.inf
        for _ in range(ATTEMPTS):
            self.push(launch, **sticks)
            let_go()
            begin = self.hand.last_s
            time.sleep(1.0)
            least = min(least, max(0.0, self.hand.open_s + LEAD_S + harness.PERIOD_S - begin))
            self.assertLess(least, 1.0, "valves stay open")
            if least < CLOSED_WITHIN_S:
                break
        return least

    def fly_without_controller(self, world, mode):
        with self.teleop(world, mode) as teleop:
            self.assertLess(self.hand.open_s, time.monotonic() - 0.3, "valves open without a dead man")
            before = self.hand.truth
            released = self.closed_after(self.hand.release, teleop, forward=1.0, turn=0.5)
            silent = self.closed_after(self.hand.fall_silent, teleop, forward=1.0, turn=0.5)
            print(f"{mode}: valves closed {released:.2f} s after release, {silent:.2f} s after silence")
            self.assertLess(released, CLOSED_WITHIN_S)
            self.assertLess(silent, CLOSED_WITHIN_S)
            p, q = before.pose.pose.position, self.hand.truth.pose.pose.position
            self.assertGreater(math.hypot(q.x - p.x, q.y - p.y), 0.03)
            self.assertGreater(self.hand.truth.twist.twist.angular.z, 0.1)  # turn is positive counterclockwise
            # Bad data closes, too.
            self.push(teleop, forward=-1.0)
            self.hand.reading = ([0.0, math.nan, 0.0, 0.0], [0, 0, 0, 0, 0, 1])
            time.sleep(1.0)
            self.assertLess(self.hand.open_s, time.monotonic() - 0.5)
            self.assertIn("joystick refused", teleop.text())
            self.hand.fall_silent()
            teleop.stop()
            self.assertEqual(teleop.process.returncode, 0, teleop.text())

    def test_wrench_and_rate(self):
        with self.world(nmpc=False, player=False) as world:
            self.fly_without_controller(world, "wrench")
            self.fly_without_controller(world, "rate")

    def test_position_and_a_controller_that_is_not_to_be_disturbed(self):
        with self.world(player=False) as world:
            with self.teleop(world, "position") as teleop:
                start = self.hand.truth.pose.pose.position
                self.hold_until("motion", lambda: self.hand.truth.pose.pose.position.x > start.x + 0.1, teleop, forward=1.0)
                self.hand.release()
                time.sleep(0.5)
                count, last = len(self.hand.set_points), self.hand.set_points[-1]
                time.sleep(0.5)
                self.assertEqual(len(self.hand.set_points), count, "set-points after release")
                self.wait("rest", lambda: abs(self.hand.truth.twist.twist.linear.x) < 0.01, teleop)
                self.assertGreater(last.x, start.x + 0.05)
                self.assertLess(abs(last.y - start.y), 0.05)
            # A controller runs: teleop does not take its place beside it.
            with harness.Launch("teleop.launch", joins=TestMaster, mode="wrench") as refused:
                log = refused.wait(30.0)
            self.assertIn("/atmos/nmpc publishes /atmos/nmpc/", log)
            self.assertIn("exit code 1", log)

    def test_keyboard(self):
        readings = []
        subscriber = rospy.Subscriber("/atmos/joy", Joy, readings.append)
        self.hand.fall_silent()
        master, slave = pty.openpty()
        before = termios.tcgetattr(slave)
        process = subprocess.Popen([KEYBOARD, "__ns:=atmos"], stdin=slave, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            deadline = time.monotonic() + 20.0
            while subscriber.get_num_connections() < 2 and time.monotonic() < deadline:
                time.sleep(0.05)
            os.write(master, b" ")
            time.sleep(0.3)
            os.write(master, b"a")
            while not any(m.buttons[0] for m in readings if len(m.buttons) == 1) and time.monotonic() < deadline:
                time.sleep(0.05)
            held = [m for m in readings if len(m.buttons) == 1 and m.buttons[0]]
            self.assertTrue(held)
            self.assertEqual(list(held[0].axes), [0.0, 1.0, 0.0])
            time.sleep(1.0)
            self.assertEqual(readings[-1].buttons, (0,))
            self.assertNotEqual(termios.tcgetattr(slave)[3], before[3])
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(20.0)
            subscriber.unregister()
        self.assertEqual(process.returncode, 0)
        self.assertEqual(termios.tcgetattr(slave), before, "the terminal is not as it was")

    def test_keyboard_without_a_terminal(self):
        result = subprocess.run([KEYBOARD], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=20.0)
        self.assertEqual(result.returncode, 2)
        self.assertIn("stdin is no terminal", result.stderr)

    def test_a_joystick_of_the_kernel_until_it_is_unplugged(self):
        readings = []
        subscriber = rospy.Subscriber("/atmos/joy", Joy, readings.append)
        self.hand.fall_silent()
        device = os.path.join(harness.scratch(), "js0")
        os.mkfifo(device)
        plug = os.open(device, os.O_RDWR)  # open for writing before the node looks
        with harness.Launch("teleop.launch", joins=TestMaster, joystick=device) as launch:
            # js_event: time, value, type (1 button, 2 axis, 0x80 state at the start), number.
            for event in ((0, -32767, 0x82, 1), (0, 32767, 2, 0), (0, 1, 1, 5)):
                os.write(plug, struct.pack("IhBB", *event))
            self.wait("reading", lambda: any(len(m.buttons) == 6 and len(m.axes) == 2 for m in readings), launch)
            self.assertEqual(list(readings[-1].axes), [-1.0, 1.0])
            self.assertEqual(readings[-1].buttons, (0, 0, 0, 0, 0, 1))
            os.close(plug)
            self.assertIn("is gone", launch.wait(30.0))
        subscriber.unregister()

    def test_bad_configuration(self):
        with harness.Launch("teleop.launch", joins=TestMaster, mode="sideways") as launch:
            self.assertIn("must be wrench, rate or position", launch.wait(30.0))


if __name__ == "__main__":
    rosunit.unitrun("atmos_system_test", "teleop", Teleop)
