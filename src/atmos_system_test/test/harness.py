"""Starts launch files as a user does, each with a ROS master of its own, and reads what they recorded."""
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time

import rosbag
import yaml

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", "..", ".."))
sys.path.insert(0, os.path.join(ROOT, "scripts", "lib"))

CONFIG = os.path.join(ROOT, "config")
VEHICLE = os.path.join(CONFIG, "vehicle", "atmos.yaml")
PERIOD_S = 0.1


def controller(name):
    """Path of a shipped controller file."""
    return os.path.join(CONFIG, "controller", name + ".yaml")


CONTROLLER = controller("direct_allocation")


def scratch():
    """A new folder that the operating system may empty."""
    return tempfile.mkdtemp(prefix="atmos_system_test_")


def write_scenario(folder, name="scenario", **changes):
    """The paper's sequence with some keys replaced; returns the path."""
    with open(os.path.join(CONFIG, "scenario", "paper_sequence.yaml")) as file:
        scenario = yaml.safe_load(file)
    scenario.update({"name": name, "vehicle": VEHICLE, "controller": CONTROLLER})
    mocap = {**scenario["mocap"], **changes.pop("mocap", {})}
    scenario.update({**changes, "mocap": mocap})
    path = os.path.join(folder, name + ".yaml")
    with open(path, "w") as file:
        yaml.safe_dump(scenario, file)
    return path


class Launch:
    """A running launch file. Leaves no process behind, whatever happens. `joins` another launch: its master is used.
    `through`: the program that starts it."""

    def __init__(self, launch_file, joins=None, through="roslaunch", **arguments):
        self.joined = joins is not None
        self.port = joins.port if joins else self._free_port()
        self.master = f"http://localhost:{self.port}"
        self.environment = {**os.environ, "ROS_MASTER_URI": self.master}
        self.log = tempfile.NamedTemporaryFile("w", suffix=".log")
        command = [through] + ([] if joins else ["--port", str(self.port)]) + [os.path.join(ROOT, "launch", launch_file)]
        self.process = subprocess.Popen(command + [f"{k}:={v}" for k, v in arguments.items()], stdout=self.log,
                                        stderr=subprocess.STDOUT, env=self.environment)

    @staticmethod
    def _free_port():
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            return probe.getsockname()[1]

    def call(self, service, *arguments):
        """Calls a service of a node under this launch's master."""
        subprocess.run(["rosservice", "call", service, *arguments], check=True, timeout=30.0, env=self.environment,
                       stdout=subprocess.DEVNULL)

    def wait_for(self, text, limit_s=120.0):
        """Returns once the log has the text; AssertionError with the log when the launch ends or time is over before."""
        deadline = time.monotonic() + limit_s
        while text not in self.text():
            assert self.process.poll() is None, f"ended before '{text}':\n{self.text()}"
            assert time.monotonic() < deadline, f"no '{text}' after {limit_s} s:\n{self.text()}"
            time.sleep(0.1)

    def wait(self, limit_s):
        """The log once the launch has ended by itself; TimeoutError with the log when it has not."""
        try:
            self.process.wait(limit_s)
        except subprocess.TimeoutExpired:
            self.stop()
            raise TimeoutError(f"not over after {limit_s} s:\n{self.text()}") from None
        return self.text()

    def stop(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            try:
                self.process.wait(30)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()

    def text(self):
        # Opened anew: the launch writes through the offset of self.log.
        with open(self.log.name, errors="replace") as log:
            return log.read()

    def processes(self):
        """Process ids of everything that talks to this launch's master."""
        marks = {f"ROS_MASTER_URI={self.master}{end}".encode() for end in ("", "/")}  # roslaunch adds the slash
        found = []
        for pid in filter(str.isdigit, os.listdir("/proc")):
            try:
                with open(f"/proc/{pid}/environ", "rb") as file:
                    variables = set(file.read().split(b"\0"))
                with open(f"/proc/{pid}/stat") as file:
                    zombie = file.read().rsplit(")", 1)[1].split()[0] == "Z"
            except OSError:
                continue  # gone, or not ours
            if marks & variables and not zombie:
                found.append(int(pid))
        return found

    def node_pid(self, name):
        """Process id of a node, by its name in the launch file."""
        for pid in self.processes():
            with open(f"/proc/{pid}/cmdline", "rb") as file:
                if f"__name:={name}".encode() in file.read().split(b"\0"):
                    return pid
        raise LookupError(f"no node {name}")

    @staticmethod
    def says(pid, *words):
        """Whether a word stands in the process's command line."""
        with open(f"/proc/{pid}/cmdline") as file:
            text = file.read()
        return any(word in text for word in words)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stop()
        if self.joined:
            self.log.close()
            return  # what it leaves behind, the launch it joined finds
        deadline = time.monotonic() + 5.0
        while self.processes() and time.monotonic() < deadline:
            time.sleep(0.1)
        orphans = self.processes()
        for pid in orphans:
            os.kill(pid, signal.SIGKILL)
        self.log.close()
        if orphans:
            raise AssertionError(f"processes outlived the launch: {orphans}")


def fly(scenario, limit_s=120.0, **arguments):
    """Flies a scenario to its end with sim.launch; returns (bag, log). AssertionError when it did not get there. With
    split_s or split_mb the bag's name is that of the files without _0, _1, ..."""
    folder = scratch()
    bag, summary = os.path.join(folder, "run.bag"), os.path.join(folder, "sim.json")
    with Launch("sim.launch", scenario=scenario, record=bag, summary=summary, **arguments) as launch:
        log = launch.wait(limit_s)
    assert os.path.exists(summary), f"the flight did not reach its end:\n{log}"
    assert os.path.exists(bag) or os.path.exists(bag.replace(".bag", "_0.bag")), f"no recording:\n{log}"
    return bag, log


def disturb_the_line(launch, unplug_s, reboot_s):
    """Pulls the emulated Pixhawk's plug for three seconds and later reboots it, both at a flight time that the log tells."""
    launch.wait_for(f"t = {unplug_s} /")
    launch.call("/atmos/pixhawk_emulator/unplug", "true")
    time.sleep(3.0)
    launch.call("/atmos/pixhawk_emulator/unplug", "false")
    launch.wait_for(f"t = {reboot_s} /")
    launch.call("/atmos/pixhawk_emulator/reboot")


def messages(bag, name, robot="atmos"):
    """Messages of one topic in the order of recording."""
    with rosbag.Bag(bag) as opened:
        return [message for _, message, _ in opened.read_messages(topics=[f"/{robot}/{name}"])]


def stamp(message):
    return message.header.stamp.to_sec()
