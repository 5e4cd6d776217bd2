"""Checks the workspace's rules that a compiler does not see. Prints every violation; exit code 1 if there is any.

1. Cores (include/, src/, test/, benchmark/ of a package) include no ROS header; atmos_model_ros/ is for nodes, and a
   rostest may include what it talks to.
2. Cores read no clock: time is an argument. Nodes, tools, tests and benchmarks may measure wall time (steady_clock.h).
3. A package.xml names no package of ours but the allowed ones, test dependencies included.
4. clang-format has nothing to change, where it is installed.
5. Every file a launch file, scenario or script refers to exists; every launch argument has a doc.
"""
import glob
import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

# docs/architecture.md, "Packages". An arrow includes those of the package it points to.
ARROWS = {
    "atmos_msgs": [],
    "atmos_model": ["atmos_msgs"],
    "atmos_sim": ["atmos_model"],
    "atmos_mocap_bridge": ["atmos_model"],
    "atmos_nmpc": ["atmos_model"],
    "atmos_stl_planner": ["atmos_model"],
    "atmos_px4_bridge": ["atmos_model"],
    "atmos_operator": ["atmos_model"],
    "atmos_sim2real": ["atmos_model"],
    "atmos_system_test": ["atmos_sim", "atmos_mocap_bridge", "atmos_nmpc", "atmos_stl_planner", "atmos_px4_bridge",
                          "atmos_operator", "atmos_sim2real"],
}
# Run as a child process only.
EXEC_ARROWS = {"atmos_sim2real": ["atmos_sim"]}

ROS_PACKAGES = ("ros", "std_msgs", "std_srvs", "geometry_msgs", "sensor_msgs", "nav_msgs", "visualization_msgs",
                "trajectory_msgs", "rosgraph_msgs", "diagnostic_msgs", "diagnostic_updater", "tf2_ros", "tf2_msgs",
                "tf2_geometry_msgs", "atmos_msgs", "atmos_model_ros", "rosbag", "rviz", "topic_tools", "actionlib",
                "dynamic_reconfigure", "nodelet", "pluginlib", "message_filters")
ROS_INCLUDE = re.compile(r'^\s*#\s*include\s*[<"](?:%s)/' % "|".join(ROS_PACKAGES))
CLOCK = re.compile(r"_clock::now|ros::(?:Wall|Steady)?Time::now|\bgettimeofday\b|\bclock_gettime\b|\bstd::time\s*\("
                   r"|include .*steady_clock\.h")
CLOCK_HEADER = "src/atmos_model/include/atmos_model/steady_clock.h"
SOURCES = (".h", ".cpp")

violations = []


def violation(path, line, rule):
    violations.append(f"{path}{f':{line}' if line else ''}: {rule}")


def sources(package, folders):
    for folder in folders:
        for base, _, names in os.walk(os.path.join("src", package, folder)):
            for name in sorted(names):
                if name.endswith(SOURCES):
                    yield os.path.join(base, name)


def find_lines(path, pattern):
    with open(path) as source:
        for number, text in enumerate(source, 1):
            if pattern.search(text):
                yield number, text.strip()


def rostest_sources(package):
    """Sources of tests that run against a ROS master: those are no core."""
    with open(f"src/{package}/CMakeLists.txt") as file:
        return {f"src/{package}/{name}" for name in re.findall(r"add_rostest_gtest\(\s*\S+\s+\S+\s+(\S+)\s*\)",
                                                               file.read())}


def check_layering(package):
    with_master = rostest_sources(package)
    for path in sources(package, ("include", "src", "test", "benchmark")):
        if path.startswith("src/atmos_model/include/atmos_model_ros/") or path in with_master:
            continue
        for number, text in find_lines(path, ROS_INCLUDE):
            violation(path, number, f"a core must not include ROS: {text}")
    for path in sources(package, ("include", "src")):
        if path.startswith("src/atmos_model/include/atmos_model_ros/") or path == CLOCK_HEADER:
            continue
        for number, text in find_lines(path, CLOCK):
            violation(path, number, f"a core must not read a clock: {text}")
    for path in sources(package, ("nodes", "rviz")):
        with open(path) as source:
            length = len(source.readlines())
        if length > 300:
            violation(path, 0, f"a node file must stay under 300 lines, has {length}")


def reachable(package):
    result = set()
    for target in ARROWS[package]:
        result |= {target} | reachable(target)
    return result


def check_arrows(package):
    path = f"src/{package}/package.xml"
    if package not in ARROWS:
        violation(path, 0, "is not a package of docs/architecture.md")
        return
    allowed = reachable(package)
    for element in ElementTree.parse(path).getroot():
        name = (element.text or "").strip()
        if not element.tag.endswith("depend") or not name.startswith("atmos_"):
            continue
        if element.tag == "exec_depend" and name in EXEC_ARROWS.get(package, []):
            continue
        if name not in allowed:
            violation(path, 0, f"<{element.tag}> {name}: no arrow from {package} to {name} in docs/architecture.md")


def check_format(packages):
    tool = shutil.which("clang-format")
    if not tool:
        print("check: clang-format is not installed; formatting not checked")
        return
    files = [path for p in packages for path in sources(p, ("include", "src", "nodes", "rviz", "tools", "test", "benchmark"))]
    if not files:
        return
    result = subprocess.run([tool, "--dry-run", "--ferror-limit=1"] + files, stderr=subprocess.PIPE, text=True)
    for path in sorted(set(re.findall(r"^(\S+?):\d+:\d+: warning: code should be clang-formatted", result.stderr,
                                      re.MULTILINE))):
        violation(path, 0, "run clang-format -i")


def check_launch_files():
    for path in sorted(glob.glob("launch/*.launch") + glob.glob("src/*/test/*.test")):
        with open(path) as source:
            text = source.read()
        for reference in re.findall(r"\$\(dirname\)(/[^\"'\s<]+)", text):
            if "$(" not in reference and not os.path.exists(os.path.dirname(path) + reference):
                violation(path, 0, f"refers to $(dirname){reference}, which does not exist")
        for element in ElementTree.fromstring(text).iter("arg"):
            inside_include = element.get("value") is not None
            if not inside_include and not element.get("doc"):
                violation(path, 0, f"argument {element.get('name')} has no doc")


def check_scenarios():
    for path in sorted(glob.glob("config/scenario/*.yaml")):
        with open(path) as source:
            for key, target in re.findall(r"^(vehicle|controller):\s*(\S+)", source.read(), re.MULTILINE):
                if not os.path.exists(os.path.join(os.path.dirname(path), target)):
                    violation(path, 0, f"{key} {target} does not exist")


def check_scripts():
    for path in sorted(glob.glob("scripts/*") + glob.glob("scripts/lib/*") + [".ci/run", "README.md"]):
        if not os.path.isfile(path):
            continue
        with open(path) as source:
            for target in re.findall(r"(?<![\w/.])((?:scripts|launch|config)/[\w./-]*\w)", source.read()):
                if not os.path.exists(target):
                    violation(path, 0, f"refers to {target}, which does not exist")


def main():
    packages = sorted(os.path.basename(os.path.dirname(p)) for p in glob.glob("src/*/package.xml"))
    for package in packages:
        check_layering(package)
        check_arrows(package)
    check_format(packages)
    check_launch_files()
    check_scenarios()
    check_scripts()
    for text in violations:
        print(text, file=sys.stderr)
    print(f"check: {len(packages)} packages, {len(violations)} violations")
    return 1 if violations else 0


if __name__ == "__main__":
    sys.exit(main())
