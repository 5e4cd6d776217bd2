"""Reads recordings: any ROS 1 bag with a robot's topics, several of one flight (split files, one per robot, stl.bag) as one.

read() gives everything, load_flight() one robot. What a recording does not hold is empty, never made up.
"""
import contextlib
import math
import os
from dataclasses import dataclass

import numpy as np
import rosbag
import yaml

# NmpcStatus.msg
MODE_WAITING = 4
SOLVER_NOT_RUN = 8

POSES = ("sim/truth", "odometry", "mocap/pose")  # what the motion is taken from, best first
NAMES = POSES + ("setpoint", "trajectory", "thruster_command", "nmpc/status", "nmpc/wrench", "nmpc/rate", "disturbance",
                 "pneumatics", "battery", "configuration")
POSE_SMOOTHING_S = 0.2  # poses without velocities are smoothed over this before they are differentiated


class ReportError(Exception):
    """The bag cannot be reported on; the text says why."""


@dataclass
class Motion:
    """Planar motion of base_link: time [s since the start of the flight], pose and velocity in the world frame."""
    time: np.ndarray
    x: np.ndarray
    y: np.ndarray
    yaw: np.ndarray  # unwrapped, rad
    vx: np.ndarray
    vy: np.ndarray
    yaw_rate: np.ndarray


@dataclass
class SetPoint:
    time: float
    x: float
    y: float
    yaw: float


@dataclass
class Trajectory:
    """A trajectory while it is in force: time [s since the start of the flight], pose in the world frame."""
    time: np.ndarray
    x: np.ndarray
    y: np.ndarray
    yaw: np.ndarray  # unwrapped, rad


@dataclass
class Flight:
    """One recorded flight of one robot. Times are seconds since `start` (ROS time of the first set-point; without one, of the
    first pose). Rows of an array start with the time."""
    bag: str
    robot: str
    start: float
    end: float
    setpoints: list
    trajectories: list
    motion: Motion
    motion_source: str       # the first of POSES that is recorded
    command_time: np.ndarray
    command_period: np.ndarray
    duty: np.ndarray         # commands x thrusters
    solve_time: np.ndarray   # of the statuses in which the solver ran, s since start
    solve_s: np.ndarray
    deadline_misses: int
    wrench: np.ndarray       # force x, force y [N], torque z [N m] asked for; no rows: not at this level
    rate: np.ndarray         # force x, force y [N], yaw rate [rad/s] asked for; likewise
    disturbance: np.ndarray  # d_v x, y [m/s^2, world], d_w z [rad/s^2]; no rows: no observer
    air: np.ndarray          # gas used [kg], pressures of bottles and thrusters [Pa]
    battery: np.ndarray      # voltage [V], charge [share]


@dataclass
class Stl:
    """What was planned and monitored under a specification; `start` is the ROS time of the plan's time 0."""
    plan: object     # StlPlan
    monitor: list    # StlMonitor
    start: float


@dataclass
class Recording:
    paths: list
    robots: dict                 # name -> Flight, sorted
    stl: Stl = None
    configuration: object = None  # RunConfiguration, the last one

    def file(self, used_by):
        """Content of the configuration file that the parameter ending so names, parsed; None when it is not recorded."""
        for entry in self.configuration.files if self.configuration else []:
            if any(user.endswith(used_by) for user in entry.used_by):
                return yaml.safe_load(entry.content)
        return None


def yaw_of(q):
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))


def wrap(angle):
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def _table(rows, width):
    return np.array(rows, dtype=float).reshape(-1, width)


def _stamps(messages):
    return [m.header.stamp.to_sec() for m in messages]


def _increasing(rows):
    """Rows in the order of their first column, each time once: the same topic may stand in two bags."""
    _, first = np.unique(rows[:, 0], return_index=True)
    return rows[first]


def _odometry_motion(messages):
    rows = _increasing(_table([(m.header.stamp.to_sec(), m.pose.pose.position.x, m.pose.pose.position.y,
                                yaw_of(m.pose.pose.orientation), m.twist.twist.linear.x, m.twist.twist.linear.y,
                                m.twist.twist.angular.z) for m in messages], 7))
    t, x, y, yaw, u, v, yaw_rate = rows.T
    c, s = np.cos(yaw), np.sin(yaw)
    return Motion(t, x, y, np.unwrap(yaw), c * u - s * v, s * u + c * v, yaw_rate)


def _smooth(values, width):
    """Moving average; the ends keep their value."""
    padded = np.concatenate([np.full(width, values[0]), values, np.full(width, values[-1])])
    return np.convolve(padded, np.ones(width) / width, "same")[width:-width]


def _pose_motion(messages):
    rows = _increasing(_table([(m.header.stamp.to_sec(), m.pose.position.x, m.pose.position.y, yaw_of(m.pose.orientation))
                               for m in messages if math.isfinite(m.pose.position.x)], 4))
    if len(rows) < 10:
        return None
    t, x, y, yaw = rows.T
    yaw = np.unwrap(yaw)
    step = float(np.median(np.diff(t)))
    even = np.arange(t[0], t[-1] + 0.5 * step, step)  # stamps that come in bunches would be slopes without end
    width = max(3, int(round(POSE_SMOOTHING_S / step)) | 1)
    rate = lambda v: np.interp(t, even, np.gradient(_smooth(np.interp(even, t, v), width), step))
    return Motion(t, x, y, yaw, rate(x), rate(y), rate(yaw))


def _motion(found):
    for source in POSES:
        if found[source]:
            motion = (_pose_motion if source == "mocap/pose" else _odometry_motion)([m for m, _ in found[source]])
            if motion is not None:
                return motion, source
    return None, ""


def _trajectory(message, start):
    begin = message.header.stamp.to_sec() - start
    rows = np.array([(begin + point.time_from_start.to_sec(), point.transforms[0].translation.x,
                      point.transforms[0].translation.y, yaw_of(point.transforms[0].rotation))
                     for point in message.points])
    return Trajectory(rows[:, 0], rows[:, 1], rows[:, 2], np.unwrap(rows[:, 3]))


def _next_start(time, setpoints, end):
    """When what started at `time` is replaced by a set-point, or the flight ends."""
    return min([s.time for s in setpoints if s.time > time] + [end])


def _until(trajectory, end):
    inside = trajectory.time <= end + 1e-6
    return Trajectory(*(values[inside] for values in (trajectory.time, trajectory.x, trajectory.y, trajectory.yaw)))


def _effective_stamp(message, received):
    """From when a set-point holds; without a stamp from its arrival."""
    return message.header.stamp.to_sec() or received


def _messages(found, name):
    """Messages of a topic in the order of their stamps, each stamp once."""
    by_stamp = {m.header.stamp: m for m, _ in found[name]}
    return [by_stamp[stamp] for stamp in sorted(by_stamp)]


def _split(topic):
    """(robot, name) of a topic; what serves all robots stands in no namespace."""
    robot, _, name = topic[1:].rpartition("/") if topic.count("/") < 2 else topic[1:].partition("/")
    return robot, name


def _flight(paths, robot, found):
    """The flight of one robot out of its messages; None when nothing moved in it."""
    motion, source = _motion(found)
    if motion is None:
        return None
    by_stamp = {_effective_stamp(m, received): m.pose for m, received in found["setpoint"]}
    start = min(by_stamp, default=motion.time[0])
    motion.time = motion.time - start
    end = float(motion.time[-1])
    setpoints = [SetPoint(stamp - start, p.position.x, p.position.y, yaw_of(p.orientation))
                 for stamp, p in sorted(by_stamp.items()) if stamp - start < end]
    trajectories = {m.header.stamp.to_sec(): _trajectory(m, start) for m, _ in found["trajectory"] if m.points}
    commands, statuses = _messages(found, "thruster_command"), _messages(found, "nmpc/status")
    solved = [m for m in statuses if m.mode != MODE_WAITING and m.solver != SOLVER_NOT_RUN]
    rows = lambda name, width, values: _table([(m.header.stamp.to_sec() - start, *values(m))
                                               for m in _messages(found, name)], width)
    return Flight(
        bag=", ".join(paths), robot=robot, start=start, end=end, setpoints=setpoints,
        trajectories=[_until(trajectories[stamp], _next_start(stamp - start, setpoints, end))
                      for stamp in sorted(trajectories) if stamp - start < end],
        motion=motion, motion_source=source,
        command_time=np.array(_stamps(commands)) - start,
        command_period=np.array([m.period for m in commands]),
        duty=np.array([m.duty for m in commands]) if commands else np.empty((0, 0)),
        solve_time=np.array(_stamps(solved)) - start,
        solve_s=np.array([m.solve_time for m in solved]),
        deadline_misses=max((m.deadline_misses for m in statuses), default=0),
        wrench=rows("nmpc/wrench", 4, lambda m: (m.wrench.force.x, m.wrench.force.y, m.wrench.torque.z)),
        rate=rows("nmpc/rate", 4, lambda m: (m.force.x, m.force.y, m.angular_rate.z)),
        disturbance=rows("disturbance", 4, lambda m: (m.linear_acceleration.x, m.linear_acceleration.y,
                                                      m.angular_acceleration.z)),
        air=rows("pneumatics", 4, lambda m: (m.gas_used, m.bottle_pressure, m.thruster_pressure)),
        battery=rows("battery", 3, lambda m: (m.voltage, m.percentage)))


def _wanted(present):
    """Topic -> (robot, name) of what is used of the topics `present`; of the POSES of a robot the best one only."""
    split = {topic: _split(topic) for topic in present}
    best = {}
    for robot, name in split.values():
        if name in POSES:
            best[robot] = min(best.get(robot, name), name, key=POSES.index)
    return {topic: (robot, name) for topic, (robot, name) in split.items()
            if name in NAMES and (name not in POSES or name == best[robot])}


def read(paths):
    """Everything of a flight in the bags `paths`. Raises ReportError when one cannot be read or nothing moves in them."""
    found, plans, monitor = {}, [], []
    with contextlib.ExitStack() as stack:
        bags = []
        for path in paths:
            try:
                bags.append(stack.enter_context(rosbag.Bag(path)))
            except (OSError, rosbag.ROSBagException) as error:
                raise ReportError(f"{path}: {error}") from error
        topics = {topic for bag in bags for topic in bag.get_type_and_topic_info().topics}
        wanted = _wanted(topics)
        for path, bag in zip(paths, bags):
            try:
                for topic, message, received in bag.read_messages(topics=list(wanted) + ["/stl/plan", "/stl/monitor"]):
                    if topic == "/stl/plan":
                        plans.append(message)
                    elif topic == "/stl/monitor":
                        monitor.append(message)
                    else:
                        robot, name = wanted[topic]
                        found.setdefault(robot, {n: [] for n in NAMES})[name].append((message, received.to_sec()))
            except (OSError, rosbag.ROSBagException) as error:
                raise ReportError(f"{path}: {error}") from error
    flights = {robot: _flight(paths, robot, found[robot]) for robot in sorted(found)}
    flights = {robot: flight for robot, flight in flights.items() if flight is not None}
    if not flights:
        raise ReportError(f"{', '.join(paths)}: none of the topics {', '.join(POSES)} of any robot in the bag")
    configurations = [m for robot in sorted(found) for m, _ in found[robot]["configuration"]]
    return Recording(paths=list(paths), robots=flights,
                     stl=Stl(plans[-1], monitor, plans[-1].header.stamp.to_sec()) if plans and monitor else None,
                     configuration=configurations[-1] if configurations else None)


def load_flight(path, robot=None):
    """The flight of `robot`; by default of the first robot with commands. Raises ReportError when it has no set-point or no
    command: for programs that measure flights rather than look at whatever there is."""
    recording = read([path])
    flown = [name for name, flight in recording.robots.items() if flight.duty.size]
    name = robot or (flown[0] if flown else None)
    flight = recording.robots.get(name)
    if flight is None or not flight.duty.size:
        raise ReportError(f"{path}: no thruster_command in the bag")
    if not flight.setpoints:
        raise ReportError(f"{path}: no setpoint in the bag")
    return flight


def load_vehicle(path):
    """The content of a vehicle file."""
    with open(path) as file:
        return yaml.safe_load(file)["vehicle"]


def thrusters_of(vehicle):
    """Rows of the vehicle's thrusters or propellers, in command order."""
    return vehicle.get("propellers") or vehicle["thrusters"]


def default_vehicle():
    return os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", "..", "config", "vehicle", "atmos.yaml")
