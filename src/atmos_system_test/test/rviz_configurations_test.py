#!/usr/bin/python3
"""rviz itself, on a virtual screen, with every configuration of config/rviz: it loads what they name and logs no error."""
import glob
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

import rosgraph
import yaml

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", "..", ".."))
LIMIT_S = 60.0
ERROR = re.compile(r"\[\s*(ERROR|FATAL)\]|failed to load|Segmentation fault|terminate called")


def topics_of(path):
    with open(path) as file:
        displays = yaml.safe_load(file)["Visualization Manager"]["Displays"]
    return {d["Marker Topic"] for d in displays if "Marker Topic" in d}


def subscribed(node):
    _, subscribers, _ = rosgraph.Master("/rviz_configurations_test").getSystemState()
    return {topic for topic, nodes in subscribers if node in nodes}


def run_rviz(path, topics, name):
    """What rviz says from its start until it listens to `topics` and two seconds more; (log, topics it listens to)."""
    with tempfile.TemporaryDirectory() as home, open(os.path.join(home, "log"), "w+") as log:
        environment = {**os.environ, "HOME": home, "XDG_RUNTIME_DIR": home, "LIBGL_ALWAYS_SOFTWARE": "1",
                       "QT_X11_NO_MITSHM": "1"}
        command = ["xvfb-run", "-a", "-s", "-screen 0 1400x900x24 +extension GLX", "rosrun", "rviz", "rviz",
                   "--display-config", path, f"__name:={name}"]
        process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, env=environment, start_new_session=True)
        try:
            deadline = time.monotonic() + LIMIT_S
            while time.monotonic() < deadline and process.poll() is None and not topics <= subscribed("/" + name):
                time.sleep(0.2)
            time.sleep(2.0)
            heard = subscribed("/" + name)
            alive = process.poll() is None
        finally:
            try:
                os.killpg(process.pid, signal.SIGTERM)
            except ProcessLookupError:
                pass
            process.wait(20)
        log.seek(0)
        return log.read() + ("" if alive else "\n[ERROR] rviz ended by itself"), heard


class RvizConfigurations(unittest.TestCase):
    def setUp(self):
        self.assertTrue(shutil.which("xvfb-run"), "xvfb-run is missing: run scripts/setup")

    def test_every_configuration_loads(self):
        paths = sorted(glob.glob(os.path.join(ROOT, "config", "rviz", "*.rviz")))
        self.assertGreaterEqual(len(paths), 4)
        for path in paths:
            name = "rviz_" + os.path.splitext(os.path.basename(path))[0]
            topics = topics_of(path)
            self.assertTrue(topics, path)
            log, heard = run_rviz(path, topics, name)
            self.assertLessEqual(topics, heard, f"{path}: displays do not listen:\n{log}")
            self.assertFalse(ERROR.search(log), f"{path}:\n{log}")

    def test_a_missing_plugin_would_be_seen(self):
        with tempfile.NamedTemporaryFile("w", suffix=".rviz") as broken:
            broken.write("Panels:\n  - {Class: atmos_operator/NoSuchPanel, Name: Gone}\nVisualization Manager:\n"
                         "  Class: \"\"\n  Displays:\n    - {Class: rviz/MarkerArray, Name: M, Enabled: true, "
                         "Marker Topic: /display/robots}\n  Global Options: {Fixed Frame: world}\n")
            broken.flush()
            log, _ = run_rviz(broken.name, {"/display/robots"}, "rviz_broken")
        self.assertTrue(ERROR.search(log), log)


if __name__ == "__main__":
    import rostest
    rostest.rosrun("atmos_system_test", "rviz_configurations", RvizConfigurations, sys.argv)
