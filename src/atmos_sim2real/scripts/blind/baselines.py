"""Baselines of the blind benchmark: an extended Kalman filter with a constant disturbance, and sparse regression on
differentiated velocity. Both read the bag, and write what `diagnose` writes as far as the benchmark reads it. The third,
Gauss-Newton on all parameters, is tools/fit_all.cpp; the fourth, the nominal model, claims nothing."""
import json
import math
import os
import sys

import numpy as np
import rosbag
import yaml

GRID = 0.01  # s
CLAIM = 4.0  # deviations


def read(bag):
    """Poses [t, x, y, yaw unwrapped] and commands [(t, period, duties)]."""
    poses, commands = [], []
    with rosbag.Bag(bag) as file:
        for topic, message, _ in file.read_messages():
            if topic.endswith("mocap/pose"):
                q = message.pose.orientation
                poses.append((message.header.stamp.to_sec(), message.pose.position.x, message.pose.position.y,
                              2 * math.atan2(q.z, q.w)))
            elif topic.endswith("thruster_command"):
                commands.append((message.header.stamp.to_sec(), message.period, message.duty))
    poses = np.array(poses)
    poses[:, 3] = np.unwrap(poses[:, 3])
    return poses, commands


class Robot:
    def __init__(self, path):
        with open(path) as file:
            vehicle = yaml.safe_load(file)["vehicle"]
        self.mass, self.inertia = vehicle["mass_kg"], vehicle["inertia_kg_m2"][2]
        self.push = []  # per thruster, body: N, N, N m
        for t in vehicle["thrusters"]:
            (x, y, _), (dx, dy, _), force = t["position_m"], t["direction"], t["force_n"]
            self.push.append((force * dx, force * dy, force * (x * dy - y * dx)))
        self.push = np.array(self.push)


def openings(commands, times):
    """Mean opening of every valve over each stretch [times[i], times[i + 1])."""
    out = np.zeros((len(times) - 1, len(commands[0][2])))
    for stamp, period, duties in commands:
        for k, duty in enumerate(duties):
            if duty <= 0:
                continue
            first, last = np.searchsorted(times, (stamp, stamp + duty * period))
            for i in range(max(first - 1, 0), min(last, len(out))):
                overlap = min(times[i + 1], stamp + duty * period) - max(times[i], stamp)
                if overlap > 0:
                    out[i, k] += overlap / (times[i + 1] - times[i])
    return out


def claim(kind, parameters, score):
    return {"kind": kind, "parameters": {name: {"value": value, "std": std, "unit": ""}
                                         for name, (value, std) in parameters.items()},
            "evidence": {"log_likelihood_gain": 0.5 * score * score}, "indistinguishable_from": []}


def write(folder, claims, model):
    with open(os.path.join(folder, "report.json"), "w") as file:
        json.dump({"verdict": "explained" if claims else "consistent",
                   "mismatch": {"p_value": None, "smallest_detectable": {}}, "effects": claims}, file)
    with open(os.path.join(folder, "model.yaml"), "w") as file:
        json.dump({"effects": model}, file)


def unmodelled(force_x, force_y, torque):
    return [{"kind": "unmodelled", "parameters": {"force_x_n": force_x, "force_y_n": force_y, "torque_n_m": torque,
                                                  "coefficients": {}}}]


def disturbance_filter(bag, vehicle, folder):
    """The offset-free controller's observer, run over the recording: pose, velocity and a constant disturbance per axis. A
    disturbance is all it can name, and a steady one is a tilt."""
    robot = Robot(vehicle)
    poses, commands = read(bag)
    times = poses[:, 0]
    u = openings(commands, times)
    means, deviations = [], []
    sigma = (3e-4, 3e-4, 1e-3)
    walk = (2e-4, 2e-4, 1e-3)  # of the disturbance, per root second
    body = u @ robot.push
    for axis in range(3):
        x = np.array([poses[0, axis + 1], 0.0, 0.0])
        P = np.diag([1e-4, 1e-2, 1e-2])
        total, kept = 0.0, []
        for i in range(1, len(times)):
            dt = times[i] - times[i - 1]
            yaw = poses[i - 1, 3]
            force = body[i - 1]
            a = ((math.cos(yaw) * force[0] - math.sin(yaw) * force[1]) / robot.mass,
                 (math.sin(yaw) * force[0] + math.cos(yaw) * force[1]) / robot.mass, force[2] / robot.inertia)[axis]
            F = np.array([[1, dt, dt * dt / 2], [0, 1, dt], [0, 0, 1]])
            x = F @ x + np.array([a * dt * dt / 2, a * dt, 0])
            P = F @ P @ F.T + np.diag([0, 1e-8 * dt, walk[axis] ** 2 * dt])
            K = P[:, 0] / (P[0, 0] + sigma[axis] ** 2)
            x = x + K * (poses[i, axis + 1] - x[0])
            P = P - np.outer(K, P[0])
            if times[i] - times[0] > 10.0:
                kept.append(x[2])
        # The spread of its own estimate over stretches of 10 s says how sure it is.
        blocks = [np.mean(part) for part in np.array_split(kept, max(3, int(len(kept) * GRID / 10)))]
        means.append(float(np.mean(blocks)))
        deviations.append(float(np.std(blocks, ddof=1) / math.sqrt(len(blocks))))
    score = max(abs(m) / max(d, 1e-9) for m, d in zip(means[:2], deviations[:2]))
    claims = []
    if score > CLAIM:
        claims.append(claim("floor_tilt", {"slope_x": (-means[0] / 9.81, deviations[0] / 9.81),
                                           "slope_y": (-means[1] / 9.81, deviations[1] / 9.81)}, score))
    write(folder, claims, unmodelled(f"{robot.mass * means[0]:.9f}", f"{robot.mass * means[1]:.9f}",
                                     f"{robot.inertia * means[2]:.9f}"))


def differentiated(poses, half=12):
    """Poses on the grid with velocity and acceleration, each out of a sliding cubic over +-half frames (Savitzky-Golay)."""
    times = np.arange(poses[0, 0], poses[-1, 0], GRID)
    grid = np.column_stack([np.interp(times, poses[:, 0], poses[:, k]) for k in (1, 2, 3)])
    steps = np.arange(-half, half + 1) * GRID
    inverse = np.linalg.pinv(np.column_stack([steps ** p for p in range(4)]))
    smooth = [np.column_stack([np.convolve(grid[:, k], factor * inverse[order][::-1], mode="same") for k in range(3)])
              for order, factor in ((0, 1.0), (1, 1.0), (2, 2.0))]
    inside = slice(2 * half, len(times) - 2 * half)
    return times[inside], [part[inside] for part in smooth]


# Terms of the sparse regression per axis: expression, column of (p, v, yaw, openings), and the kind that a selected term means.
def library(axis, p, v, u, robot):
    x, y, yaw = p.T
    vx, vy, w = v.T
    c, s = np.cos(yaw), np.sin(yaw)
    terms = []
    if axis < 2:
        own, speed = (vx, vy)[axis], np.hypot(vx, vy)
        name = ("vx", "vy")[axis]
        terms += [("1", np.ones_like(x), "floor_tilt", 0), ("x", x, "floor_unevenness", 0), ("y", y, "floor_unevenness", 0),
                  ("x * y", x * y, "floor_unevenness", 0), ("x^2", x * x, "floor_unevenness", 0),
                  ("y^2", y * y, "floor_unevenness", 0), (name, own, "viscous_drag", 0),
                  (f"{name} * sqrt(vx^2 + vy^2)", own * speed, "quadratic_drag", 0),
                  (f"tanh({name} / 0.005)", np.tanh(own / 0.005), "coulomb_friction", 0)]
    else:
        terms += [("1", np.ones_like(x), "unmodelled", 0), ("yaw_rate", w, "viscous_drag", 0),
                  ("yaw_rate * abs(yaw_rate)", w * np.abs(w), "quadratic_drag", 0),
                  ("tanh(yaw_rate / 0.02)", np.tanh(w / 0.02), "coulomb_friction", 0)]
    for k, (fx, fy, torque) in enumerate(robot.push):
        if axis == 2:
            column, text = torque * u[:, k], f"{torque:.6g} * u{k + 1}"
        elif axis == 0:
            column, text = u[:, k] * (c * fx - s * fy), f"u{k + 1} * ({fx:.6g} * cos(yaw) - {fy:.6g} * sin(yaw))"
        else:
            column, text = u[:, k] * (s * fx + c * fy), f"u{k + 1} * ({fx:.6g} * sin(yaw) + {fy:.6g} * cos(yaw))"
        terms.append((text, column, "thruster_efficiency", k + 1))
    return terms


def sparse_regression(bag, vehicle, folder):
    """Sequentially thresholded least squares of the force that the nominal model leaves, per axis."""
    robot = Robot(vehicle)
    poses, commands = read(bag)
    times, (p, v, a) = differentiated(poses)
    u = openings(commands, np.append(times, times[-1] + GRID))
    # The openings get the filter that the accelerations went through, or they would not fit each other.
    steps = np.arange(-12, 13) * GRID
    kernel = np.linalg.pinv(np.column_stack([steps ** q for q in range(4)]))[0][::-1]
    u = np.column_stack([np.convolve(u[:, k], kernel, mode="same") for k in range(u.shape[1])])
    c, s = np.cos(p[:, 2]), np.sin(p[:, 2])
    body = u @ robot.push
    left = (robot.mass * a[:, 0] - (c * body[:, 0] - s * body[:, 1]),
            robot.mass * a[:, 1] - (s * body[:, 0] + c * body[:, 1]), robot.inertia * a[:, 2] - body[:, 2])
    texts, scores, values = [], {}, {}
    for axis in range(3):
        terms = library(axis, p, v, u, robot)
        A = np.column_stack([t[1] for t in terms])
        scale = np.linalg.norm(A, axis=0)
        scale[scale == 0] = 1.0
        A = A / scale
        keep = np.ones(len(terms), bool)
        for _ in range(10):
            x = np.zeros(len(terms))
            if keep.any():
                x[keep] = np.linalg.lstsq(A[:, keep], left[axis], rcond=None)[0]
            rest = left[axis] - A @ x
            # Neighbours share their noise over the filter's length.
            deviation = math.sqrt(25 * float(rest @ rest) / max(len(rest) - keep.sum(), 1))
            smaller = keep & (np.abs(x) < CLAIM * deviation)
            if not smaller.any():
                break
            keep &= ~smaller
        texts.append(" + ".join(f"({x[j] / scale[j]:.9g}) * {terms[j][0]}" for j in np.flatnonzero(keep)) or "0")
        for j in np.flatnonzero(keep):
            kind, thruster = terms[j][2], terms[j][3]
            scores[(kind, thruster)] = max(scores.get((kind, thruster), 0.0), abs(x[j]) / deviation)
            values.setdefault((kind, thruster), []).append((axis, terms[j][0], x[j] / scale[j], deviation / scale[j]))
    claims = []
    for (kind, thruster), score in scores.items():
        parameters = {"thruster": (thruster, None)} if thruster else {}
        first = values[(kind, thruster)][0]
        if kind == "thruster_efficiency":
            parameters["factor"] = (1.0 + first[2], first[3])
        elif kind == "floor_tilt":
            found = {axis: (-value / robot.mass / 9.81, std / robot.mass / 9.81) for axis, _, value, std in values[(kind, 0)]}
            parameters.update(slope_x=found.get(0, (0.0, None)), slope_y=found.get(1, (0.0, None)))
        claims.append(claim(kind, parameters, score))
    write(folder, claims, unmodelled(*texts))


METHODS = {"disturbance_ekf": disturbance_filter, "sparse_regression": sparse_regression}

if __name__ == "__main__":
    METHODS[sys.argv[1]](*sys.argv[2:])
