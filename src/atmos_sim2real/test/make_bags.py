#!/usr/bin/python3
"""Writes the bags of tools_test into a folder: one good one and one per fault."""
import math
import os
import sys

import rosbag
import rospy
from atmos_msgs.msg import ThrusterCommand
from geometry_msgs.msg import PoseStamped

START = 1.7e9


def write(path, poses=1200, commands=120, valves=8, pose_shift=0.0, nan_from=None):
    with rosbag.Bag(path, "w") as bag:
        for k in range(commands):
            message = ThrusterCommand()
            message.header.stamp = rospy.Time.from_sec(START + 0.1 * k)
            message.period = 0.1
            message.duty = [0.0] * valves
            bag.write("/atmos/thruster_command", message, message.header.stamp)
        for i in range(poses):
            message = PoseStamped()
            stamp = START + pose_shift + 0.01 * i
            message.header.stamp = rospy.Time.from_sec(stamp)
            # At rest, with an error that never repeats.
            message.pose.position.x = 1.0 + 1e-5 * math.sin(12.9898 * i * i)
            message.pose.position.y = 1.0 + 1e-5 * math.sin(78.233 * i * i)
            message.pose.orientation.z = 1e-5 * math.sin(37.719 * i * i)
            message.pose.orientation.w = 1.0
            if nan_from is not None and i >= nan_from:
                message.pose.position.x = message.pose.orientation.w = float("nan")
            bag.write("/atmos/mocap/pose", message, message.header.stamp)


def write_flown(path, pose_shift=0.0, duration=30.0):
    """The nominal vehicle pushed to and fro along x by thrusters 1 and 3 against 2 and 4."""
    acceleration, x, velocity = 2 * 1.7 / 16.8, 0.0, 0.0
    with rosbag.Bag(path, "w") as bag:
        for k in range(int(duration * 10)):
            duty = 0.8 * abs(math.sin(12.9898 * k))
            forward = (k // 7) % 2 == 0
            message = ThrusterCommand()
            message.header.stamp = rospy.Time.from_sec(START + 0.1 * k)
            message.period = 0.1
            message.duty = [duty * (forward == (i % 2 == 0)) if i < 4 else 0.0 for i in range(8)]
            bag.write("/atmos/thruster_command", message, message.header.stamp)
            for i in range(10):
                pose = PoseStamped()
                pose.header.stamp = rospy.Time.from_sec(START + 0.1 * k + 0.01 * i + pose_shift)
                pose.pose.position.x = x + 1e-5 * math.sin(37.719 * (10 * k + i) ** 2)
                pose.pose.position.y = 1e-5 * math.sin(78.233 * (10 * k + i) ** 2)
                pose.pose.orientation.z = 1e-5 * math.sin(12.9898 * (10 * k + i) ** 2)
                pose.pose.orientation.w = 1.0
                bag.write("/atmos/mocap/pose", pose, pose.header.stamp)
                on = min(max(duty * 0.1 - 0.01 * i, 0.0), 0.01)
                velocity += (1 if forward else -1) * acceleration * on
                x += velocity * 0.01


def main():
    folder = sys.argv[1]

    def path(name):
        return os.path.join(folder, name + ".bag")

    write(path("good"))
    write(path("no_commands"), commands=0)
    write(path("no_poses"), poses=0)
    write(path("one_pose"), poses=1)
    write(path("four_valves"), valves=4)
    write(path("clocks_apart"), pose_shift=7200.0)
    write_flown(path("flown"))
    write_flown(path("seconds_apart"), pose_shift=3.0)
    write(path("all_nan"), nan_from=0)
    write(path("half_nan"), nan_from=600)
    rosbag.Bag(path("no_messages"), "w").close()
    with open(path("good"), "rb") as good:
        content = good.read()
    with open(path("truncated"), "wb") as out:
        out.write(content[:len(content) * 6 // 10])
    with open(path("text"), "w") as out:
        out.write("not a bag\n")
    open(path("empty"), "w").close()


if __name__ == "__main__":
    main()
