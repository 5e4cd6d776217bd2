#!/usr/bin/python3
"""Every launch file: it parses, explains its arguments in the same words as the others, names nodes that exist, and some
system test starts it. And those that no other test flies: they reach their goal and end clean, with the exit code of it."""
import glob
import os
import re
import subprocess
import time
import unittest
import xml.etree.ElementTree as ElementTree

import rosgraph
import rosunit
import roslaunch.arg_dump
import roslaunch.config
import roslaunch.node_args
import yaml

import harness
import flight_report
import run_configuration

FILES = sorted(glob.glob(os.path.join(harness.ROOT, "launch", "*.launch")))
# For arguments without a default: a value with which the file can be read.
VALUES = {"bag": "/a.bag", "record": "/b.bag", "mission": os.path.join(harness.CONFIG, "scenario", "paper_sequence.yaml"),
          "robot": "atmos", "scenario": os.path.join(harness.CONFIG, "scenario", "paper_sequence.yaml"),
          "vehicle": harness.VEHICLE, "controller": harness.CONTROLLER, "lockstep": "true", "topics": "/atmos/sim/truth",
          "specification": os.path.join(harness.CONFIG, "stl", "single.yaml"), "model": "/model.yaml"}
# Arguments that are handed on under another name: one robot of several is `robot` to its own launch file.
RENAMED = {("robot", "first"), ("robot", "second"), ("robot", "robots")}
HOLD = [{"time_s": 0.0, "x_m": 0.0, "y_m": 0.0, "yaw_deg": 0.0}]
STEP = HOLD + [{"time_s": 1.0, "x_m": 0.15, "y_m": 0.0, "yaw_deg": 0.0}]


def name_of(path):
    return os.path.basename(path)


def arguments_of(path):
    """Name -> (doc, default or None); what `roslaunch --ros-args` prints."""
    return roslaunch.arg_dump.get_args([path])


class Described(unittest.TestCase):
    def test_every_argument_is_explained(self):
        for path in FILES:
            for name, (doc, _) in arguments_of(path).items():
                with self.subTest(file=name_of(path), argument=name):
                    self.assertTrue(doc and len(doc) >= 8, "no doc")

    def test_an_argument_is_handed_on_under_its_own_name(self):
        for path in FILES:
            for include in ElementTree.parse(path).getroot().iter("include"):
                for argument in include.iter("arg"):
                    whole = re.fullmatch(r"\$\(arg (\w+)\)", argument.get("value") or "")
                    if whole and (argument.get("name"), whole.group(1)) not in RENAMED:
                        with self.subTest(file=name_of(path)):
                            self.assertEqual(argument.get("name"), whole.group(1))

    def test_a_name_means_one_kind_of_thing(self):
        kinds = {}
        for path in FILES:
            for name, (_, default) in arguments_of(path).items():
                if default is None or "$(" in default and not default.startswith("$(dirname)"):
                    continue
                kind = ("switch" if default in ("true", "false") else "file" if default.startswith("$(dirname)")
                        else "number" if re.fullmatch(r"-?[\d.]+", default) else "word")
                kinds.setdefault(name, {})[name_of(path)] = kind
        for name, by_file in kinds.items():
            with self.subTest(argument=name):
                self.assertEqual(len(set(by_file.values())), 1, by_file)

    def test_every_file_can_be_read_and_its_nodes_exist(self):
        for path in FILES:
            needed = [name for name, (_, default) in arguments_of(path).items() if default is None]
            with self.subTest(file=name_of(path)):
                config = roslaunch.config.load_config_default([(path, [f"{name}:={VALUES[name]}" for name in needed])], 11311,
                                                              verbose=False)
                self.assertEqual(config.config_errors, [])
                self.assertTrue(config.nodes)
                for node in config.nodes:
                    node.machine = config.machines[""]
                    roslaunch.node_args.create_local_process_args(node, node.machine)  # raises when there is no such node

    def test_every_file_is_started_by_a_test(self):
        text = ""
        for path in glob.glob(os.path.join(os.path.dirname(os.path.realpath(__file__)), "*_test.*")):
            with open(path) as file:
                text += file.read()
        includes = {name_of(path): {name_of(i.get("file")) for i in ElementTree.parse(path).getroot().iter("include")}
                    for path in FILES}
        started = {name for name in includes if f'"{name}"' in text}
        while True:
            more = set().union(*(includes[name] for name in started)) | started
            if more == started:
                break
            started = more
        self.assertEqual(set(includes) - started, set())


class Started(unittest.TestCase):
    def assert_clean(self, launch):
        log = launch.text()
        self.assertEqual(launch.process.returncode, 0, log)
        self.assertEqual(re.findall(r"process has died \[.*", log), [], log)
        self.assertNotIn("Traceback", log)

    def stop(self, launch):
        launch.stop()
        self.assert_clean(launch)

    def distance_to_goal(self, bag, robot=None):
        flight = flight_report.load_flight(bag, robot)
        goal, motion = flight.setpoints[-1], flight.motion
        return ((motion.x[-1] - goal.x) ** 2 + (motion.y[-1] - goal.y) ** 2) ** 0.5

    def test_sim(self):
        folder = harness.scratch()
        bag, summary = os.path.join(folder, "run.bag"), os.path.join(folder, "sim.json")
        scenario = harness.write_scenario(folder, duration_s=9.0, setpoints=STEP)
        with harness.Launch("sim.launch", scenario=scenario, record=bag, summary=summary) as launch:
            launch.wait(120.0)
            self.assert_clean(launch)
        self.assertTrue(os.path.exists(summary))
        self.assertLess(self.distance_to_goal(bag), 0.02)
        # The recording says what was running.
        said = subprocess.run([os.path.join(harness.ROOT, "scripts", "configuration"), bag], capture_output=True, text=True)
        self.assertEqual(said.returncode, 0, said.stdout + said.stderr)
        for name in (scenario, os.path.realpath(harness.VEHICLE), os.path.realpath(harness.CONTROLLER)):
            self.assertIn(name, said.stdout)

    def test_two_robots(self):
        folder = harness.scratch()
        with open(os.path.join(harness.CONFIG, "scenario", "two_robots.yaml")) as file:
            scenario = yaml.safe_load(file)
        scenario.update(duration_s=10.0, vehicle=harness.VEHICLE, controller=harness.CONTROLLER)
        for robot in scenario["robots"]:
            start = robot["setpoints"][0]
            robot["setpoints"] = [start, {**start, "time_s": 1.0, "x_m": start["x_m"] + 0.15}]
        path = os.path.join(folder, "two.yaml")
        with open(path, "w") as file:
            yaml.safe_dump(scenario, file)
        with harness.Launch("two_robots.launch", scenario=path, record=folder) as launch:
            launch.wait(120.0)
            self.assert_clean(launch)
        for robot in ("snap", "crackle"):
            self.assertLess(self.distance_to_goal(os.path.join(folder, robot + ".bag"), robot), 0.02)

    def test_a_mission_on_a_running_robot(self):
        folder = harness.scratch()
        mission = os.path.join(folder, "mission.yaml")
        with open(mission, "w") as file:
            yaml.safe_dump({"setpoints": STEP}, file)
        bag, summary = os.path.join(folder, "mission.bag"), os.path.join(folder, "sim.json")
        scenario = harness.write_scenario(folder, duration_s=20.0, setpoints=HOLD)
        with harness.Launch("sim.launch", scenario=scenario, summary=summary, clock="real", player=False) as world:
            world.wait_for("t = 5 /")
            with harness.Launch("mission.launch", joins=world, mission=mission, record=bag) as launch:
                world.wait_for("t = 15 /")
                self.stop(launch)
            self.assertEqual([pid for pid in world.processes() if world.says(pid, "setpoint_player", "recorder")], [])
            world.wait(120.0)
            self.assert_clean(world)
        self.assertTrue(os.path.exists(summary))
        self.assertLess(self.distance_to_goal(bag), 0.05)
        self.assertGreater(flight_report.load_flight(bag).duty.max(), 0.05, "the robot got there without thrust")

    def test_hardware_against_an_emulated_pixhawk(self):
        folder = harness.scratch()
        bag, device = os.path.join(folder, "run.bag"), os.path.join(folder, "pixhawk")
        scenario = harness.write_scenario(folder, duration_s=300.0, setpoints=HOLD)
        mission = os.path.join(folder, "mission.yaml")
        with open(mission, "w") as file:
            yaml.safe_dump({"setpoints": STEP}, file)
        here = os.path.dirname(os.path.realpath(__file__))
        with harness.Launch(os.path.join(here, "hardware_world.launch"), scenario=scenario, device=device,
                            summary=os.path.join(folder, "sim.json")) as world:
            world.wait_for("process[atmos/pixhawk_emulator")
            with harness.Launch("hardware.launch", joins=world, device=device, record=bag) as hardware, \
                    harness.Launch("mission.launch", joins=world, mission=mission) as player:
                world.wait_for("t = 5 /")  # time starts when everything is connected
                world.call("/atmos/px4/arm", "true")
                world.wait_for("t = 15 /")
                self.stop(player)
                self.stop(hardware)
                log = hardware.text()
            self.stop(world)
        states = harness.messages(bag, "px4/supervisor")
        self.assertEqual(states[-1].state, states[-1].FLYING, log)
        self.assertLess(self.distance_to_goal(bag), 0.05)
        # The mission came after the recording had begun.
        configuration = run_configuration.read(bag)
        self.assertEqual(run_configuration.faults(configuration), [])
        self.assertIn(mission, [entry.path for entry in configuration.files])

    def test_markers_of_a_diagnosis(self):
        with harness.Launch("diagnosis.launch", model=os.path.join(harness.CONFIG, "model", "harsh.yaml"), rviz=False) as launch:
            launch.wait_for("diagnosis_display-")
            master = rosgraph.Master("/launch_files_test", launch.master)
            deadline = time.monotonic() + 30.0
            # Without a transform rviz would not know the frame that the markers are in.
            while not {"/display/diagnosis", "/tf_static"} <= {topic for topic, _ in master.getPublishedTopics("/")}:
                self.assertLess(time.monotonic(), deadline, launch.text())
                time.sleep(0.2)
            self.stop(launch)

    def test_the_exit_code_of_a_launch_that_fails(self):
        folder = harness.scratch()
        scenario = harness.write_scenario(folder, duration_s=-1.0)
        with harness.Launch("sim.launch", through=os.path.join(harness.ROOT, "scripts", "launch"), scenario=scenario) as launch:
            log = launch.wait(60.0)
            self.assertEqual(launch.process.returncode, 2, log)
            self.assertIn("duration_s", log)

    def test_lockstep_without_a_controller_is_refused_before_anything_starts(self):
        with harness.Launch("sim.launch", nmpc=False) as launch:
            log = launch.wait(60.0)
            self.assertEqual(launch.process.returncode, 1, log)
            self.assertIn("nmpc:=false needs clock:=real", log)
            self.assertNotIn("process[", log)


class Everything(unittest.TestSuite):
    def __init__(self):
        load = unittest.defaultTestLoader.loadTestsFromTestCase
        super().__init__([load(Described), load(Started)])


if __name__ == "__main__":
    rosunit.unitrun("atmos_system_test", "launch_files", "launch_files_test.Everything")
