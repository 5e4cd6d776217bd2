"""Draws hidden systems: effects of random kinds and sizes, the nuisances of a lab, and two flights of each.

Sizes are log-uniform over a physically sensible range of each kind, from below what a recording can show to plainly
visible; `stratum` in [0, 1) says where in its range the size lies. All randomness comes from the seed given.
"""
import math
import random

# Kinds of the vocabulary; `unmodelled` is the family "outside".
FIRST_START = 1700000000.0  # ROS time of flight a
SECOND_START = FIRST_START + 900.0


def log_range(low, high, stratum):
    return low * (high / low) ** stratum


def sign(rng):
    return rng.choice((-1.0, 1.0))


class Arena:
    """The floor flown over: a rectangle of 3 m x 2 m somewhere in the world frame."""

    def __init__(self, rng):
        self.x = rng.uniform(-1.0, 2.5)
        self.y = rng.uniform(-1.0, 2.0)
        self.half_x, self.half_y = 1.3, 0.9

    def place(self, rng, share=1.0):
        return (self.x + share * self.half_x * rng.uniform(-1, 1), self.y + share * self.half_y * rng.uniform(-1, 1))


def vector(rng, size):
    angle = rng.uniform(0, 2 * math.pi)
    return size * math.cos(angle), size * math.sin(angle)


def factor(rng, low, high, stratum):
    return 1.0 + sign(rng) * log_range(low, high, stratum)


def sampled_map(arena, spacing, value):
    """value(x, y) on a grid over the arena with 0.5 m around it; rows are lines of constant y."""
    nx = int(math.ceil(2 * (arena.half_x + 0.5) / spacing)) + 1
    ny = int(math.ceil(2 * (arena.half_y + 0.5) / spacing)) + 1
    x0, y0 = arena.x - 0.5 * spacing * (nx - 1), arena.y - 0.5 * spacing * (ny - 1)
    rows = [[value(x0 + i * spacing, y0 + j * spacing) for i in range(nx)] for j in range(ny)]
    return [x0, y0], rows


def draw_unevenness(rng, s, arena, duration):
    """Hills and hollows, or waves all over the floor: the diagnosis must not live by either."""
    height = log_range(1e-4, 1.5e-3, s)
    if rng.random() < 0.5:
        hills = [(*arena.place(rng), sign(rng) * height * rng.uniform(0.6, 1.0), rng.uniform(0.3, 0.7)) for _ in range(4)]
        floor = lambda x, y: sum(
            h * math.exp(-((x - hx) ** 2 + (y - hy) ** 2) / (2 * w * w)) for hx, hy, h, w in hills)
    else:
        waves = [(*vector(rng, 2 * math.pi / rng.uniform(1.2, 3.5)), rng.uniform(0, 2 * math.pi),
                  height * rng.uniform(0.2, 0.5)) for _ in range(5)]
        floor = lambda x, y: sum(h * math.cos(kx * x + ky * y + phase) for kx, ky, phase, h in waves)
    origin, rows = sampled_map(arena, 0.15, floor)
    return {"origin_m": origin, "spacing_m": 0.15, "height_m": rows}


def draw_airflow(rng, s, arena, duration):
    """A jet: uniform flow is no case of its own, it is a tilt."""
    px, py = arena.place(rng, 0.6)
    fx, fy = vector(rng, log_range(0.01, 0.15, s))
    width = rng.uniform(0.4, 0.8)
    shape = lambda x, y: math.exp(-((x - px) ** 2 + (y - py) ** 2) / (2 * width * width))
    origin, rows = sampled_map(arena, 0.2, shape)
    return {"origin_m": origin, "spacing_m": 0.2, "force_x_n": [[fx * v for v in row] for row in rows],
            "force_y_n": [[fy * v for v in row] for row in rows]}


def draw_tether(rng, s, arena, duration):
    away, angle = rng.uniform(1.5, 2.2), rng.uniform(0, 2 * math.pi)
    return {"anchor_x_m": arena.x + away * math.cos(angle), "anchor_y_m": arena.y + away * math.sin(angle),
            "slack_m": away - rng.uniform(0.1, 0.7), "stiffness_n_m": log_range(0.03, 0.4, s),
            "damping_n_s_m": rng.uniform(0.02, 0.15)}


def draw_impulse(rng, s, arena, duration):
    events = []
    for k in range(rng.randint(1, 3)):
        x, y = vector(rng, log_range(0.03, 0.8, s))
        events.append({"time_s": FIRST_START + rng.uniform(0.1, 0.9) * duration, "impulse_x_n_s": x,
                       "impulse_y_n_s": y, "impulse_yaw_n_m_s": rng.uniform(-0.05, 0.05) * math.hypot(x, y)})
    return {"events": sorted(events, key=lambda e: e["time_s"])}


def draw_dead(rng, s, arena, duration):
    since = 0.0 if rng.random() < 0.3 else FIRST_START + rng.uniform(0.15, 0.8) * duration
    return {"thruster": rng.randint(1, 8), "since_s": since}


def draw_valve_delay(rng, s, arena, duration):
    late = log_range(0.002, 0.02, s)
    return {"open_s": late, "close_s": late * rng.choice((rng.uniform(0.2, 0.7), rng.uniform(1.4, 2.5)))}


def draw_patch(rng, s, arena, duration):
    x, y = arena.place(rng, 0.5)
    return {"coefficient": log_range(3e-4, 4e-3, s), "center_x_m": x, "center_y_m": y,
            "radius_m": rng.uniform(0.25, 0.5)}


def draw_slosh(rng, s, arena, duration):
    x, y = vector(rng, rng.uniform(0.0, 0.1))
    return {"mass_kg": log_range(0.2, 2.0, s), "frequency_hz": rng.uniform(0.4, 1.6),
            "damping_ratio": rng.uniform(0.02, 0.1), "x_m": x, "y_m": y}


def pair(kind_x, kind_y, low, high):
    return lambda rng, s, arena, duration: dict(zip((kind_x, kind_y), vector(rng, log_range(low, high, s))))


def scalar(name, low, high):
    return lambda rng, s, arena, duration: {name: log_range(low, high, s)}


def signed(name, low, high):
    return lambda rng, s, arena, duration: {name: sign(rng) * log_range(low, high, s)}


def scale(name, low, high):
    return lambda rng, s, arena, duration: {name: factor(rng, low, high, s)}


def of_thruster(draw):
    return lambda rng, s, arena, duration: dict({"thruster": rng.randint(1, 8)}, **draw(rng, s, arena, duration))


KINDS = {
    "floor_tilt": pair("slope_x", "slope_y", 5e-5, 2e-3),
    "floor_unevenness": draw_unevenness,
    "airflow": draw_airflow,
    "tether": draw_tether,
    "external_impulse": draw_impulse,
    "floor_vibration": lambda rng, s, arena, duration: {
        "amplitude_n": log_range(0.02, 0.4, s), "frequency_hz": rng.uniform(0.4, 6.0),
        "phase_rad": rng.uniform(-math.pi, math.pi), "direction_rad": rng.uniform(0, math.pi)},
    "viscous_drag": lambda rng, s, arena, duration: {
        "linear_n_s_m": log_range(0.1, 3.0, s), "angular_n_m_s": log_range(0.003, 0.06, s)},
    "quadratic_drag": scalar("coefficient_n_s2_m2", 0.8, 20.0),
    "coulomb_friction": scalar("coefficient", 2e-5, 1e-3),
    "friction_patch": draw_patch,
    "mass_error": scale("factor", 0.01, 0.15),
    "inertia_error": scale("factor", 0.015, 0.3),
    "com_offset": pair("x_m", "y_m", 1e-3, 2e-2),
    "mass_depletion": scalar("kg_per_open_second", 3e-3, 4e-2),
    "slosh": draw_slosh,
    "clock_skew": signed("ratio", 5e-5, 3e-3),
    "thrust_scale": scale("factor", 0.01, 0.2),
    "thruster_efficiency": of_thruster(lambda rng, s, arena, duration: {"factor": 1.0 - log_range(0.03, 0.5, s)}),
    "thruster_dead": draw_dead,
    "thruster_leak": of_thruster(scalar("fraction", 3e-3, 8e-2)),
    "thruster_misalignment": of_thruster(signed("angle_rad", 0.02, 0.2)),
    "supply_coupling": scalar("fraction_per_open_thruster", 5e-3, 0.15),
    "supply_droop": lambda rng, s, arena, duration: {"loss_per_s": log_range(0.01, 0.4, s),
                                                     "recovery_s": rng.uniform(0.3, 2.0)},
    "pressure_decay": scalar("fraction_per_kg", 0.1, 1.5),
    "valve_delay": draw_valve_delay,
    "thrust_rise": scalar("time_constant_s", 3e-3, 5e-2),
    "command_delay": scalar("delay_s", 3e-3, 6e-2),
    "mocap_latency": scalar("delay_s", 3e-3, 6e-2),
    "marker_offset": pair("x_m", "y_m", 1e-3, 2e-2),
    "yaw_misalignment": signed("angle_rad", 5e-3, 8e-2),
}

# At most one of each group in one system: together they are one statement.
TOGETHER_ONE = (
    ("thrust_scale", "mass_error", "inertia_error"), ("floor_tilt", "airflow", "floor_unevenness"),
    ("command_delay", "mocap_latency", "valve_delay", "thrust_rise"), ("thruster_misalignment", "yaw_misalignment"),
    ("coulomb_friction", "friction_patch", "viscous_drag", "quadratic_drag"),
    ("mass_depletion", "pressure_decay", "supply_droop"), ("com_offset", "marker_offset", "slosh"),
    ("thruster_dead", "thruster_efficiency", "thruster_leak"), ("external_impulse", "floor_vibration"),
)


def law(force_x="0", force_y="0", torque="0", accepted=(), **coefficients):
    """A law outside the vocabulary; `accepted`: kinds whose own equation contains it."""
    return {"force_x_n": force_x, "force_y_n": force_y, "torque_n_m": torque,
            "coefficients": {name: {"value": value, "unit": unit} for name, (value, unit) in coefficients.items()}}, accepted


def draw_magnet_yaw(rng, s, arena, duration):
    return law(torque="-k * sin(yaw - psi)", k=(log_range(1e-3, 1e-2, s), "N m"),
               psi=(rng.uniform(-3, 3), "rad"))


def draw_lift(rng, s, arena, duration):
    k = (sign(rng) * log_range(0.3, 2.0, s), "N s/m")
    return law("-k * vy", "k * vx", k=k)


def draw_growing(rng, s, arena, duration):
    fx, fy = vector(rng, log_range(0.02, 0.3, s))
    return law("a * (t / tau)^2", "b * (t / tau)^2", a=(fx, "N"), b=(fy, "N"), tau=(duration, "s"))


def draw_decaying(rng, s, arena, duration):
    fx, fy = vector(rng, log_range(0.04, 0.4, s))
    return law("a * exp(-t / tau)", "b * exp(-t / tau)", a=(fx, "N"), b=(fy, "N"), tau=(rng.uniform(10, 40), "s"))


def draw_swirl(rng, s, arena, duration):
    return law(torque="k * (u1 + u2 + u3 + u4 + u5 + u6 + u7 + u8)", k=(sign(rng) * log_range(2e-3, 2e-2, s), "N m"))


def draw_crosstalk(rng, s, arena, duration):
    return law("k * u5 * u1 * cos(yaw)", "k * u5 * u1 * sin(yaw)", k=(log_range(0.2, 1.5, s), "N"))


def draw_vortex(rng, s, arena, duration):
    """A field with curl: no floor makes it; a steady airflow map contains it."""
    x, y = arena.place(rng, 0.3)
    shape = " * exp(-((x - x0)^2 + (y - y0)^2) / w^2)"
    return law("-k * (y - y0)" + shape, "k * (x - x0)" + shape, accepted=("airflow",),
               k=(log_range(0.04, 0.4, s), "N/m"), x0=(x, "m"), y0=(y, "m"), w=(rng.uniform(0.6, 1.0), "m"))


def draw_magnet_place(rng, s, arena, duration):
    """Pulls the robot's front towards a place, with a torque: a magnet under the floor and steel on the robot."""
    x, y = arena.place(rng, 0.5)
    ax, ay = "(x0 - x - r * cos(yaw))", "(y0 - y - r * sin(yaw))"
    shape = f" * exp(-({ax}^2 + {ay}^2) / w^2)"
    fx, fy = f"k * {ax}{shape}", f"k * {ay}{shape}"
    return law(fx, fy, f"r * cos(yaw) * ({fy}) - r * sin(yaw) * ({fx})", k=(log_range(0.05, 0.6, s), "N/m"),
               x0=(x, "m"), y0=(y, "m"), w=(rng.uniform(0.4, 0.8), "m"), r=(0.15, "m"))


LAWS = {"magnet_yaw": draw_magnet_yaw, "lift": draw_lift, "growing_force": draw_growing,
        "decaying_force": draw_decaying, "swirl": draw_swirl, "valve_crosstalk": draw_crosstalk,
        "vortex": draw_vortex, "magnet_place": draw_magnet_place}


def draw_set_points(rng, arena, duration):
    """Start pose and set-points in one of three styles: hover, tour of the floor, steps of one axis at a time."""
    style = rng.choice(("hover", "tour", "tour", "steps", "steps"))
    x, y = arena.place(rng, 0.5)
    yaw = rng.uniform(-180, 180) if style == "tour" else rng.choice((0.0, 45.0, 90.0, -90.0))
    points, t = [], 0.0
    start = {"x_m": x + rng.gauss(0, 0.01), "y_m": y + rng.gauss(0, 0.01), "yaw_deg": yaw + rng.gauss(0, 1)}
    at = [x, y, yaw]
    while t < duration:
        points.append({"time_s": t, "x_m": at[0], "y_m": at[1], "yaw_deg": (at[2] + 180) % 360 - 180})
        if style == "hover":
            at = [x + rng.uniform(-0.2, 0.2), y + rng.uniform(-0.2, 0.2), yaw + rng.uniform(-18, 18)]
            t += rng.uniform(8, 16)
        elif style == "tour":
            at = [*arena.place(rng), rng.uniform(-180, 180)]
            t += rng.uniform(6, 10)
        else:
            axis = rng.randrange(3)
            if axis == 2:
                at[2] += rng.choice((-45.0, 45.0, 90.0, -90.0))
            else:
                centre, half = ((arena.x, arena.half_x), (arena.y, arena.half_y))[axis]
                step = sign(rng) * rng.choice((0.5, 1.0))
                at[axis] = min(max(at[axis] + step, centre - half), centre + half)
            t += rng.uniform(9, 15)
    return style, start, points


def draw_nuisances(rng, duration):
    """What every lab has, at random levels; nothing of it is an effect."""
    noise = log_range(1e-4, 9e-4, rng.random())
    mocap = {"rate_hz": rng.choice((60.0, 100.0, 100.0, 100.0, 120.0, 200.0)), "noise_m": noise,
             "noise_rad": noise * rng.uniform(2.0, 4.0), "distortion_m": log_range(5e-5, 5e-4, rng.random()),
             "stamp_jitter_s": log_range(2e-5, 3e-4, rng.random()), "dropout_probability": rng.choice((0.0, rng.uniform(0, 0.02))),
             "dropouts": [{"start_s": rng.uniform(1, duration - 2), "duration_s": log_range(0.03, 0.6, rng.random())}
                          for _ in range(rng.choice((0, 0, 1, 3)))]}
    lab = {"thrust_scatter": rng.uniform(0.005, 0.035), "slow_force_n": log_range(1e-3, 5e-3, rng.random()),
           "slow_torque_n_m": log_range(5e-5, 3e-4, rng.random()), "slow_time_s": rng.uniform(1.5, 8.0)}
    return mocap, lab


def in_second_flight(rng, effect):
    """The same hidden effect in flight b: events do not repeat, and a phase is another one."""
    if effect["kind"] == "external_impulse":
        return None
    parameters = dict(effect["parameters"])
    if effect["kind"] == "floor_vibration":
        parameters["phase_rad"] = rng.uniform(-math.pi, math.pi)
    return {"kind": effect["kind"], "parameters": parameters}


def draw_kinds(rng, count):
    """Kinds that are separate statements."""
    groups = list(TOGETHER_ONE) + [("tether",), ("supply_coupling",), ("clock_skew",)]
    return [rng.choice(group) for group in rng.sample(groups, count)]


def draw_several(rng, count, arena, duration, seen):
    """Effects that are separate statements, in the upper half of their ranges; those that would not be seen are drawn again."""
    while True:
        effects = []
        for kind in draw_kinds(rng, count):
            tries = ({"kind": kind, "parameters": KINDS[kind](rng, rng.uniform(0.55, 1.0), arena, duration)}
                     for _ in range(30))
            effects.append(next(filter(seen, tries), None))
        if all(effects):  # else this flight shows one of the kinds nowhere: others
            return effects


def draw(seed, family, index, durations, vehicle, seen=lambda effect: True):
    """One hidden system: {"truth": ..., "flights": {"a": scenario, "b": scenario}, "frequency": pilot's}; of single and multi
    there is a flight "twin": flight a without the effects. `seen` says of an effect whether the twin would have shown it; what
    is flown does not depend on it, and only `multi` asks."""
    rng, hide = random.Random(f"{seed}/flights"), random.Random(f"{seed}/effects")
    arena = Arena(rng)
    duration = round(rng.uniform(*durations), 1)
    effects, accepted, stratum, label = [], [], None, "null"
    if family == "single":
        names = list(KINDS)
        label = names[index % len(names)]
        # Strata of the range: thirds in turn, at random within.
        stratum = ((index // len(names)) % 3 + hide.random()) / 3
        effects = [{"kind": label, "parameters": KINDS[label](hide, stratum, arena, duration)}]
    elif family == "multi":
        effects = draw_several(hide, 2 + index % 2, arena, duration, seen)
        label = "+".join(effect["kind"] for effect in effects)
    elif family == "outside":
        names = list(LAWS)
        label = names[index % len(names)]
        stratum = ((index // len(names)) % 3 + hide.random()) / 3
        parameters, accepted = LAWS[label](hide, stratum, arena, duration)
        effects = [{"kind": "unmodelled", "parameters": parameters}]
    mocap, lab = draw_nuisances(rng, duration)
    if family == "single":  # sizes are comparable only where the nuisances are alike
        mocap.update(noise_m=3e-4, noise_rad=9e-4, rate_hz=100.0)
    second = [e for e in (in_second_flight(hide, effect) for effect in effects) if e is not None]
    flights, styles = {}, {}
    for name, length, own in (("a", duration, effects), ("b", min(duration, 90.0), second)):
        styles[name], start, points = draw_set_points(rng, arena, length)
        own_mocap = dict(mocap, dropouts=[d for d in mocap["dropouts"] if d["start_s"] + 2 < length])
        flights[name] = {"name": "hidden", "vehicle": vehicle, "controller": vehicle, "duration_s": length,
                         "seed": rng.randrange(2 ** 31), "start": start, "setpoints": points, "mocap": own_mocap,
                         "lab": lab, "effects": own}
    if family in ("single", "multi"):
        flights["twin"] = dict(flights["a"], effects=[])
    truth = {"family": family, "label": label, "stratum": stratum, "effects": effects, "second_effects": second,
             "accepted": list(accepted), "styles": styles, "mocap": mocap, "lab": lab, "duration_s": duration}
    return {"truth": truth, "flights": flights, "frequency": rng.uniform(0.5, 1.1)}
