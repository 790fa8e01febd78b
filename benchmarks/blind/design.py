"""Which cases there are: robots, effects and their sizes, controllers, motions, sensors. All of it from a seed."""

from __future__ import annotations

import hashlib
import math
import zlib
from dataclasses import dataclass

import numpy as np
from bodies import build_chain, inverse_dynamics
from motions import command
from world import (
    CATALOGUE,
    OTHER_FRICTION,
    World,
    home_inertia,
    quickness,
    robot_named,
    rotors,
    sampled,
    simulate,
    substeps_needed,
    world_of,
)

ROBOTS = ("imece2013", "puma560", "arm7", "scara", "pendulum")
STRENGTHS = {"strong": 20.0, "medium": 6.0, "weak": 1.5}
# steps a second
FINEST = 10_000.0
# robots whose spread is that of the tolerances: of few, one direction of tolerance alone scatters as far as it likes
TOLERANCE_DRAWS = 12
# of a joint's speed a controller takes away no more than this share within a tick, and no command is missed by more
QUICKEST, LOST = 0.7, 0.5
SEEDS = {"dev": 10_000_000, "tune": 20_000_000, "report": 70_000_000, "sample": 90_000_000}
# where each set's single effects begin in the catalogue, so that robots and strengths meet others
FIRST = {"dev": 0, "tune": 0, "report": 11, "sample": 0}
CLASSES = ("nothing", "single", "pair", "triple", "outside", "numerical", "positions")
OUTSIDE = (
    "outside_coupling",
    "outside_cable",
    "outside_warming",
    "outside_wavy_friction",
    "outside_drag",
    "outside_motor_lag",
    "outside_slosh",
    "outside_mount",
)
NUMERICAL = ("euler", "held_command", "continuous", "shifted_stamps", "shifted_torque", "fine_euler")
# what each law has besides the catalogue's form
HAS_OTHER_FORM = {
    "joint_compliance", "joint_compliance_6d", "coulomb_friction", "viscous_friction", "stribeck_friction",
    "load_friction", "hysteresis", "backlash", "transmission_error", "torque_ripple", "torque_constant", "torque_limit",
    "joint_spring", "link_flexibility",
}  # fmt: skip
# these make a second coordinate at the joint, and are not combined there
ELASTIC = {"joint_compliance", "backlash", "joint_compliance_6d"}
ELASTIC_LIKE = ELASTIC | {"transmission_error", "hysteresis", "link_flexibility"}


def whole_number(*parts: object) -> int:
    """A seed that hangs on nothing but its parts."""
    return zlib.crc32("/".join(str(part) for part in parts).encode())


def case_id(which: str, group: str, index: int) -> str:
    """A name that tells nothing."""
    return hashlib.sha256(f"{SEEDS[which]}/{group}/{index}/name".encode()).hexdigest()[:10]


# ------------------------------------------------------------------------------------------------ robot and controller


def draw_tolerance(rng: np.random.Generator, robot, sigma: dict) -> dict:
    """One example of a calibrated robot: what its numbers differ from the database by."""
    return {
        "arms": [
            {
                "mass": float(rng.normal() * sigma["mass"]),
                "com": (rng.normal(size=3) * sigma["com"]).tolist(),
                "inertia": (rng.normal(size=3) * sigma["inertia"]).tolist(),
                "angle": (rng.normal(size=3) * sigma["angle"]).tolist(),
                "length": (rng.normal(size=2) * sigma["length"]).tolist(),
            }
            for _ in robot.arms
        ]
    }


def base_recipe(rng: np.random.Generator, name: str, group: str, duration: float | None) -> dict:
    """Everything but what is missing in the model."""
    robot = robot_named(name)
    n = robot.n
    rotor = rotors(name)
    database: dict = {"rotor_inertia": {str(i + 1): {"inertia": float(rotor[i])} for i in range(n)}}
    greasy = rng.random() < 0.4
    if greasy:
        typical = typical_friction(name)
        database["coulomb_friction"] = {str(i + 1): {"torque": typical[0][i]} for i in range(n)}
        database["viscous_friction"] = {str(i + 1): {"coefficient": typical[1][i]} for i in range(n)}
    size = float(rng.choice([0.3, 1.0, 1.0, 2.0]))
    tolerance = {
        "mass": 0.003 * size,
        "com": 3.0e-4 * size * (0.3 if name in ("pendulum", "scara") else 1.0),
        "inertia": 0.01 * size,
        "length": 3.0e-5 * size,
        "angle": 5.0e-5 * size,
    }
    inertia = home_inertia(robot) + rotor
    frequency = float(rng.uniform(3.5, 7.0))
    w = 2.0 * math.pi * frequency
    mode = (
        "pd"
        if group == "positions"
        else str(rng.choice(["pd", "motion", "torque", "unknown"], p=[0.74, 0.12, 0.07, 0.07]))
    )
    if group == "numerical":
        mode = "pd"
    rate = float(rng.choice([1000.0, 500.0], p=[0.6, 0.4]))
    # what is fitted, then the run that is held out
    kinds = [*list(rng.permutation(["rich", "moves"])), "rich"]
    if rng.random() < 0.35:
        kinds[0] = "slow"
    if rng.random() < 0.12:
        kinds[0] = kinds[1] = str(rng.choice(["single", "small"]))
    if rng.random() < 0.4:
        kinds = kinds[1:]
    length = float(rng.choice([4.0, 5.0])) if duration is None else duration
    if mode in ("torque", "unknown") and name == "pendulum":
        mode = "pd"
    recipe = {
        "robot": name,
        "database": database,
        "tolerance": tolerance,
        "drawn": draw_tolerance(rng, robot, tolerance),
        "control": {
            "mode": mode,
            "kp": (w * w * inertia).tolist(),
            "kd": (1.4 * w * inertia).tolist(),
            "feedforward": str(rng.choice(["none", "gravity", "inverse_dynamics"])) if mode == "pd" else "none",
            "rate": rate,
        },
        "runs": [
            {"kind": str(kind), "seed": int(rng.integers(2**31)), "duration": length, "noise": int(rng.integers(2**31))}
            for kind in kinds
        ],
        "payload": None,
    }
    recipe["sensors"] = draw_sensors(rng, recipe, group)
    return recipe


def typical_friction(name: str) -> tuple[list[float], list[float]]:
    """Coulomb and viscous friction of such a robot."""
    tables = robot_named(name).tables
    if name == "imece2013":
        return [60.0, 60.0, 35.0, 9.0, 6.0, 2.5], [120.0, 120.0, 60.0, 12.0, 8.0, 3.0]
    n = robot_named(name).n
    return (
        [tables["coulomb_friction"][i + 1]["torque"] for i in range(n)],
        [tables["viscous_friction"][i + 1]["coefficient"] for i in range(n)],
    )


def typical_torque(recipe: dict) -> np.ndarray:
    """Root mean square torque of the nominal robot in its richest run, (n,)."""
    law = law_of(recipe, recipe["runs"][-1])
    q, dq, ddq = sampled(law, int(recipe["runs"][-1]["duration"] * 100) + 1, 100.0)
    robot = robot_named(recipe["robot"])
    chain, _, _, _ = build_chain(robot)
    tau = inverse_dynamics(chain, q, dq, ddq) + rotors(recipe["robot"]) * ddq
    return np.sqrt(np.mean(tau**2, axis=0))


def law_of(recipe: dict, row: dict):
    robot = robot_named(recipe["robot"])
    return command(robot, row["kind"], row["seed"], row["duration"], home_inertia(robot) + rotors(recipe["robot"]))


def draw_sensors(rng: np.random.Generator, recipe: dict, group: str) -> dict:
    """Which channels there are, their noise and their steps."""
    robot = robot_named(recipe["robot"])
    mode = recipe["control"]["mode"]
    typical = np.maximum(typical_torque(recipe), 0.01 * np.where(np.isfinite(robot.effort), robot.effort, 0.0))
    slide = np.array([0.3 if p else 1.0 for p in robot.prismatic])
    sigma_q = float(rng.choice([5.0e-6, 1.0e-5, 3.0e-5])) * slide
    share = float(rng.choice([0.003, 0.006, 0.012]))
    sigma = {
        "q": sigma_q.tolist(),
        "dq": (float(rng.choice([1.0e-4, 5.0e-4])) * slide).tolist(),
        "tau": [float(f"{x:.2g}") for x in share * typical],
        "tau_link": [float(f"{x:.2g}") for x in 0.7 * share * typical],
        "q_link": (1.0e-5 * slide).tolist(),
        "ee": float(rng.choice([3.0e-5, 5.0e-5, 1.0e-4])),
        "ee_rot": 2.0e-4,
    }
    channels = ["q"]
    if rng.random() < 0.35:
        channels.append("dq")
    if group != "positions" and (mode in ("motion", "unknown") or rng.random() < 0.9):
        channels.append("tau")
    if mode == "motion" and "tau" not in channels:
        channels.append("tau")
    if rng.random() < (0.35 if mode != "motion" else 0.7):
        channels.append("ee")
    if rng.random() < 0.12:
        channels.append("q_link")
    if rng.random() < 0.12:
        channels.append("tau_link")
    if mode == "unknown":
        channels = [c for c in channels if c in ("q", "dq", "tau")]
    return {
        "channels": channels,
        "sigma": sigma,
        "colour": float(rng.choice([0.0, 0.95])),
        "steps": {"q": float(rng.choice([0.0, 1.0, 2.0])), "tau": float(rng.choice([0.0, 0.5, 2.0]))},
        "jitter": float(rng.choice([0.0, 0.0, 0.0, 1.0e-5])),
        "gap": [0.3, float(rng.uniform(0.01, 0.1))] if rng.random() < 0.1 else None,
        "csv": bool(rng.random() < 0.1),
        "stated": bool(rng.random() < 0.6),
        "loop": bool(rng.random() < 0.5),
        "every": 1 if mode == "torque" else 2 if recipe["control"]["rate"] == 1000.0 else int(rng.choice([1, 2])),
        "orientation": bool(rng.random() < 0.5),
    }


def loop_noise(recipe: dict, row: dict, ticks: int) -> np.ndarray:
    """What the sensors of the loop add, (ticks, 2, n); the same noise is in the record."""
    sensors = recipe["sensors"]
    n = robot_named(recipe["robot"]).n
    rng = np.random.default_rng([row["noise"], 1])
    noise = np.zeros((ticks, 2, n))
    noise[:, 0] = coloured(rng, (ticks, n), sensors["colour"] ** (1.0 / sensors["every"])) * sensors["sigma"]["q"]
    # a controller whose speeds are not in the record has them without noise: nobody could know it
    if "dq" in sensors["channels"]:
        noise[:, 1] = rng.normal(size=(ticks, n)) * sensors["sigma"]["dq"]
    return noise


def coloured(rng: np.random.Generator, shape: tuple[int, int], a: float) -> np.ndarray:
    """AR(1) noise of unit variance, (m, n); a = 0: white."""
    from scipy.signal import lfilter

    white = rng.normal(size=shape)
    if a == 0.0:
        return white
    first = white[0].copy()
    white *= math.sqrt(1.0 - a * a)
    white[0] = first
    return lfilter([1.0], [1.0, -a], white, axis=0)


# --------------------------------------------------------------------------------------------------- sizes of the gaps


@dataclass
class Judge:
    """Runs a recipe's first seconds and tells how far a gap stands above the noise floor."""

    recipe: dict
    seconds: float = 2.6

    def __post_init__(self) -> None:
        recipe = self.recipe
        self.rows = [recipe["runs"][0], recipe["runs"][-1]]
        self.laws = [law_of(recipe, row) for row in self.rows]
        self.calm = self.signals([], drawn=recipe["drawn"])
        sensors = recipe["sensors"]
        rng = np.random.default_rng(whole_number(recipe["robot"], recipe["runs"][0]["seed"]))
        robot = robot_named(recipe["robot"])
        known = self.signals([], drawn=None)
        spread = []
        for _ in range(TOLERANCE_DRAWS):
            other = self.signals([], drawn=draw_tolerance(rng, robot, recipe["tolerance"]))
            spread.append(self.difference(other, known))
        way = np.zeros_like(spread[0])
        if recipe["control"]["mode"] == "pd" and sensors["loop"]:
            way = self.difference(self.signals([], drawn=recipe["drawn"], noisy=True), self.calm)
        self.floor = np.sqrt(self.sensor_noise() ** 2 + np.mean([s**2 for s in spread], axis=0) + way**2)

    def channels(self) -> list[str]:
        """What can be compared: behind an unknown controller motions cannot, but what torque they take."""
        if self.recipe["control"]["mode"] == "unknown":
            return ["tau"]
        return [c for c in self.recipe["sensors"]["channels"] if c != "dq"]

    def sensor_noise(self) -> np.ndarray:
        n = robot_named(self.recipe["robot"]).n
        sensors = self.recipe["sensors"]
        parts = []
        for name in self.channels():
            sigma = np.broadcast_to(np.array(sensors["sigma"][name], dtype=float), (3,) if name == "ee" else (n,))
            step = sensors["steps"].get(name, 0.0)
            parts.append(sigma * math.sqrt(1.0 + step**2 / 12.0))
        return np.concatenate(parts)

    def signals(self, effects: list[dict], drawn: dict | None, *, noisy: bool = False) -> list:
        """Signals of the judged runs; torque and unknown modes are judged under their hidden controller."""
        recipe = self.recipe
        hidden = as_simulated(recipe)
        world = world_of(recipe, effects, drawn=drawn)
        out = []
        for row, law in zip(self.rows, self.laws, strict=True):
            seconds = min(self.seconds, row["duration"])
            ticks = int(seconds * recipe["control"]["rate"] + 1.0e-6) + 1
            noise = loop_noise(recipe, row, ticks) if noisy else None
            out.append(simulate(hidden, world, law, seconds, noise=noise))
        return out

    def difference(self, one: list, other: list) -> np.ndarray:
        """Root mean square difference of every channel over the runs, (channels,)."""
        parts = []
        for name in self.channels():
            with np.errstate(over="ignore", invalid="ignore"):
                square = [
                    np.mean((a.channel(name) - b.channel(name)) ** 2, axis=0) for a, b in zip(one, other, strict=True)
                ]
                parts.append(np.sqrt(np.mean(square, axis=0)))
        value = np.concatenate(parts)
        # a robot that its controller cannot hold
        return np.where(np.isfinite(value), value, np.inf)

    def too_stiff(self, effects: list[dict]) -> bool:
        """Whether the generator would need steps below a tenth of a millisecond."""
        rate = self.recipe["control"]["rate"]
        speed = np.max([np.max(np.abs(c.dq), axis=0) for c in self.calm], axis=0)
        needed = substeps_needed(world_of(self.recipe, effects, drawn=self.recipe["drawn"]), rate, speed)
        return needed * rate > FINEST

    def held(self, effects: list[dict], signals: list) -> bool:
        """Whether the controller holds the robot."""
        if self.recipe["control"]["mode"] == "motion":
            return True
        world = world_of(self.recipe, effects, drawn=self.recipe["drawn"])
        if quickness(world, self.recipe["control"]) > QUICKEST:
            return False
        rate = self.recipe["control"]["rate"]
        for law, s in zip(self.laws, signals, strict=True):
            if not np.max(np.abs(s.q - sampled(law, len(s.q), rate)[0])) < LOST:
                return False
        return True

    def ratio(self, effects: list[dict]) -> float:
        """The largest gap of any channel in units of its noise floor; inf where the controller cannot hold it."""
        signals = self.signals(effects, self.recipe["drawn"])
        if not self.held(effects, signals):
            return math.inf
        return float(np.max(self.difference(signals, self.calm) / self.floor))


def as_simulated(recipe: dict) -> dict:
    """The recipe with the controller that truly ran: modes torque and unknown hide a PD controller."""
    if recipe["control"]["mode"] in ("torque", "unknown"):
        return {**recipe, "control": {**recipe["control"], "mode": "pd"}}
    return recipe


def sized(judge: Judge, make, target: float) -> tuple[list[dict], float] | None:
    """Effects make(s) whose gap is `target` times the noise floor; None where no size in its bounds reaches it."""
    s, best = 0.3, None
    low, high = 1.0e-5, 1.0
    for _ in range(8):
        effects = make(s)
        if judge.too_stiff(effects):
            if s >= 0.9 * high or best is not None:
                break
            s = min(high, 4.0 * s)
            continue
        ratio = judge.ratio(effects)
        if best is None or abs(math.log(max(ratio, 1e-9) / target)) < abs(math.log(max(best[1], 1e-9) / target)):
            best = (effects, ratio)
        if 0.85 < ratio / target < 1.18:
            break
        if not math.isfinite(ratio):
            s *= 0.2
            continue
        step = min(30.0, max(1.0 / 30.0, target / max(ratio, 1.0e-6)))
        new = min(high, max(low, s * step))
        if new == s:
            break
        s = new
    if best is None or not 0.7 < best[1] / target < 1.45:
        return None
    return best


# ------------------------------------------------------------------------------------------------- effects with a size


def maker(rng: np.random.Generator, judge: Judge, name: str, at: int, form: int):
    """make(s) -> effects, for s from near 0 to 1 (the largest of such a robot); None: it cannot be here."""
    recipe = judge.recipe
    robot = robot_named(recipe["robot"])
    i = at - 1
    inertia, rotor = home_inertia(robot), rotors(recipe["robot"])
    fc, fv = (np.array(x) for x in typical_friction(recipe["robot"]))
    calm = judge.calm
    load = np.max([np.max(np.abs(c.tau_link), axis=0) for c in calm], axis=0) + 1.0e-9
    peak = np.max([np.max(np.abs(c.tau), axis=0) for c in calm], axis=0)
    fast = np.max([np.max(np.abs(c.dq), axis=0) for c in calm], axis=0)
    slide = bool(0 < at <= robot.n and robot.prismatic[i])
    u = rng.uniform

    def one(parameters, other=None, **more):
        """The effect; `other` are the numbers of its other form, `more` of both."""
        return [{"effect": name, "at": at, "parameters": {**parameters, **(other or {} if form else {})}, "form": form}]

    if name in OUTSIDE:
        return outside_maker(rng, recipe, name, at, fc, load, inertia + rotor, fast)
    if name == "coulomb_friction":
        a = float(u(0.05, 0.2) * rng.choice([-1, 1]))
        return lambda s: one({"torque": s * 3.0 * fc[i]}, {"asymmetry": a})
    if name == "viscous_friction":
        return lambda s: one({"coefficient": s * 4.0 * fv[i]}, {"bend": 0.4 / max(fast[i], 0.05)})
    if name == "stribeck_friction":
        vs = float(u(0.05, 0.2)) * max(fast[i], 0.02)
        return lambda s: one({"torque": s * 2.0 * fc[i], "velocity": vs}, {"exponent": 1.0})
    if name == "load_friction":
        return lambda s: one({"coefficient": 0.4 * s}, {"asymmetry": 0.15})
    if name == "hysteresis":
        width = float(u(0.004, 0.02)) * (0.1 if slide else 1.0)
        return lambda s: one({"torque": s * 2.0 * fc[i], "stiffness": s * 2.0 * fc[i] / width}, {"dahl": 1.0})
    if name == "rotor_inertia":
        # the database lacks it or has too little
        return lambda s: one({"inertia": s * 2.0 * rotor[i]})
    if name == "joint_compliance":
        reduced = rotor[i] * inertia[i] / (rotor[i] + inertia[i])
        softest = max(8.0 * inertia[i] * (2 * math.pi) ** 2 * 4.0, 5.0 * load[i])
        zeta = float(u(0.03, 0.12))

        def compliance(s):
            k = softest / s
            stretch = load[i] / k
            return one(
                {"stiffness": k, "damping": 2.0 * zeta * math.sqrt(k * reduced)},
                {"stiffening": 0.5 / stretch**2},
            )

        return compliance
    if name == "joint_compliance_6d":
        if slide or i == robot.n - 1:
            return None
        softest = max(50.0 * inertia[i] * (2 * math.pi) ** 2, 5.0 * load[i])

        def bearing(s):
            k = softest / s
            b = 0.1 * math.sqrt(k * inertia[i])
            return one({"krx": k, "kry": k, "brx": b, "bry": b}, {"stiffening": 0.3 / (load[i] / k) ** 2})

        return bearing
    if name == "backlash":
        widest = 0.001 if slide else 0.02
        return lambda s: one({"gap": s * widest}, {"soft": 0.15})
    if name == "transmission_error":
        cycles = float(rng.integers(6, 60)) * (20.0 if slide else 1.0)
        phase = float(u(-3.0, 3.0))
        return lambda s: one({"amplitude": s * 0.2 / cycles, "cycles": cycles, "phase": phase}, {"second": 0.35})
    if name == "torque_ripple":
        cycles = float(rng.integers(4, 60)) * (20.0 if slide else 1.0)
        phase = float(u(-3.0, 3.0))
        return lambda s: one({"amplitude": s * 2.0 * fc[i], "cycles": cycles, "phase": phase}, {"second": 0.4})
    if name == "torque_constant":
        side = float(rng.choice([-1.0, 1.0]))
        return lambda s: one({"gain": 1.0 + 0.5 * side * s}, {"droop": 0.1 / (peak[i] + 1.0e-9) ** 2 * s})
    if name == "torque_offset":
        side = float(rng.choice([-1.0, 1.0]))
        return lambda s: one({"torque": side * s * peak[i]})
    if name == "torque_limit":
        return lambda s: one({"torque": peak[i] * (1.0 - 0.7 * s)}, {"soft": 1.0})
    if name == "encoder_offset":
        side = float(rng.choice([-1.0, 1.0])) * (0.1 if slide else 1.0)
        return lambda s: one({"offset": side * 0.2 * s})
    if name == "delay":
        return lambda s: one({"time": 0.012 * s})
    if name == "controller_gain":
        p, d = (float(x) for x in rng.choice([-1.0, 1.0, 0.3], size=2))
        return lambda s: one({"kp": math.exp(0.7 * s * p), "kd": math.exp(0.7 * s * d)})
    if name == "joint_spring":
        k = load[i] * 2.0 / (0.05 if slide else 0.6)
        rest = float(robot.home[i] + u(-0.5, 0.5) * (0.1 if slide else 1.0))
        return lambda s: one({"stiffness": s * k, "rest": rest}, {"bend": 25.0 if slide else 0.25})
    if name == "payload":
        total = sum(arm.mass for arm in robot.arms)
        x, y, z = (float(v) for v in u(-0.08, 0.08, size=3))
        return lambda s: one(
            {
                "mass": s * 0.15 * total,
                "x": x,
                "y": y,
                "z": z,
                "Ixx": s * 0.15 * total * 1.0e-3,
                "Iyy": s * 0.15 * total * 1.2e-3,
                "Izz": s * 0.15 * total * 0.9e-3,
            }
        )
    if name == "link_inertia":
        arm = robot.arms[i]
        m = 0.5 * arm.mass
        c = arm.com + u(-0.05, 0.05, size=3)
        r = 0.03

        def link(s):
            tensor = s * m * (r * r * np.eye(3) + float(c @ c) * np.eye(3) - np.outer(c, c))
            return one(
                {
                    "mass": s * m,
                    "mx": float(s * m * c[0]),
                    "my": float(s * m * c[1]),
                    "mz": float(s * m * c[2]),
                    "Ixx": float(tensor[0, 0]),
                    "Iyy": float(tensor[1, 1]),
                    "Izz": float(tensor[2, 2]),
                    "Ixy": float(tensor[0, 1]),
                    "Ixz": float(tensor[0, 2]),
                    "Iyz": float(tensor[1, 2]),
                }
            )

        return link
    if name == "kinematic_error":
        which = rng.choice(["alpha", "a", "theta", "d", "beta"], size=2, replace=False)
        size = {
            k: (0.1 if k in ("alpha", "theta", "beta") else 0.05) * float(u(0.4, 1.0) * rng.choice([-1, 1]))
            for k in which
        }
        return lambda s: one({str(k): s * v for k, v in size.items()})
    if name == "base_tilt":
        a, b = (float(v) for v in u(-0.2, 0.2, size=2))
        return lambda s: one({"roll": s * a, "pitch": s * b})
    if name == "link_flexibility":
        if np.linalg.norm(robot.arms[i].transform()[:3, 3]) < 0.05:
            return None
        softest = 60.0 * float(np.max(inertia[: i + 1][-2:])) * (2 * math.pi) ** 2 * 4.0
        at_fraction = float(u(0.3, 0.7))
        twist = float(u(0.6, 1.6))

        def bend(s):
            k = softest / s
            b = 0.06 * math.sqrt(k * float(inertia[i]))
            return one(
                {"ku": k, "kv": twist * k, "bu": b, "bv": b, "at": at_fraction},
                {"stiffening": 0.3 / (load[i] / k) ** 2},
            )

        return bend
    raise KeyError(name)


def outside_maker(rng, recipe, name, at, fc, load, inertia, fast):
    """As `maker`, for what no catalogue has."""
    i, n = at - 1, len(fc)
    u = rng.uniform

    def one(parameters):
        return [{"effect": name, "at": at, "parameters": parameters, "form": 1}]

    if name in ("outside_coupling", "outside_cable"):
        if n < 2:
            return None
        partner = at + 1 if at < n else at - 1
        if robot_named(recipe["robot"]).prismatic[i] or robot_named(recipe["robot"]).prismatic[partner - 1]:
            return None
        if name == "outside_coupling":
            return lambda s: one({"partner": partner, "torque": s * 2.0 * float(min(fc[i], fc[partner - 1]))})
        ratio = float(u(0.5, 1.0))
        return lambda s: one({"partner": partner, "torque": s * 2.0 * float(fc[i]), "ratio": ratio})
    if name in ("outside_warming", "outside_wavy_friction"):
        if "coulomb_friction" not in recipe["database"]:
            return None
        if name == "outside_warming":
            time = float(u(1.0, 3.0))
            return lambda s: one({"share": 0.8 * s, "time": time})
        cycles, phase = float(u(2.0, 8.0)), float(u(-3.0, 3.0))
        return lambda s: one({"share": 0.9 * s, "cycles": cycles, "phase": phase})
    if name == "outside_drag":
        return lambda s: one({"coefficient": s * 3.0 * float(fc[i]) / max(float(fast[i]), 0.05) ** 2})
    if name == "outside_motor_lag":
        return lambda s: one({"time": max(0.025 * s, 5.0e-4)})
    if name == "outside_slosh":
        load_known = recipe["payload"]
        if not load_known:
            return None

        def slosh(s):
            w = 2.0 * math.pi * (1.5 + 3.0 * (1.0 - s))
            m = load_known["mass"]
            return [
                {
                    "effect": name,
                    "at": 0,
                    "form": 1,
                    "parameters": {**load_known, "stiffness": m * w * w, "damping": 0.1 * m * w},
                }
            ]

        return slosh
    if name == "outside_mount":
        total = sum(arm.mass for arm in robot_named(recipe["robot"]).arms)
        k0 = 40.0 * float(np.max(inertia)) * (2 * math.pi) ** 2

        def mount(s):
            k = k0 / s
            m = 0.3 * total
            return [
                {
                    "effect": name,
                    "at": 0,
                    "form": 1,
                    "parameters": {
                        "mass": m,
                        "inertia": 0.05 * m,
                        "stiffness": k,
                        "damping": 0.05 * math.sqrt(k * float(np.max(inertia))),
                    },
                }
            ]

        return mount
    raise KeyError(name)


NOT_IN_MOTION = {"torque_constant", "torque_limit", "delay", "controller_gain"}
# in mode unknown only torque at the measured motion is compared
ONLY_COMMANDED = {"delay", "controller_gain", "torque_limit"}


def allowed(recipe: dict, name: str) -> bool:
    """Whether these signals can show an effect at all."""
    mode, channels = recipe["control"]["mode"], recipe["sensors"]["channels"]
    if mode == "motion" and name in NOT_IN_MOTION | {"outside_motor_lag"}:
        return False
    if mode in ("unknown", "torque") and name in ONLY_COMMANDED | {"outside_motor_lag"}:
        return False
    if name == "torque_offset" and "tau" not in channels:
        return False
    if mode == "torque" and name in ("encoder_offset",):
        return False
    return not (recipe["robot"] == "pendulum" and name in ("link_flexibility", "joint_compliance_6d", "base_tilt"))


def place_of(rng: np.random.Generator, name: str, n: int) -> int:
    if name in ("delay", "payload", "base_tilt", "outside_slosh", "outside_mount"):
        return 0
    return int(rng.integers(1, n + 1))


# --------------------------------------------------------------------------------------------------------------- cases


def recipe_of(which: str, group: str, index: int, duration: float | None = None) -> dict:
    """The recipe of one case; deterministic."""
    for attempt in range(40):
        rng = np.random.default_rng([SEEDS[which], whole_number(group), index, attempt])
        recipe = attempt_recipe(rng, which, group, index, attempt, duration)
        if recipe is not None:
            recipe["case"] = {"set": which, "class": group, "index": index, "attempt": attempt}
            return recipe
    raise RuntimeError(f"{group} {index}: no effect could be sized")


def attempt_recipe(
    rng: np.random.Generator, which: str, group: str, index: int, attempt: int, duration: float | None
) -> dict | None:
    # robots and strengths go round, so that every class has all of them
    name = ROBOTS[index % len(ROBOTS)]
    strength = list(STRENGTHS)[(index // len(ROBOTS)) % 3]
    recipe = base_recipe(rng, name, group, duration)
    recipe["effects"], recipe["strength"], recipe["ratio"], recipe["numerical"] = [], None, 0.0, None
    if group == "nothing":
        return recipe
    if group == "numerical":
        recipe["numerical"] = NUMERICAL[(index // len(ROBOTS)) % len(NUMERICAL)]
        return recipe
    if group in ("single", "positions"):
        chosen = CATALOGUE[(FIRST[which] + index + attempt // 4) % len(CATALOGUE)]
        return with_single(rng, recipe, chosen, strength)
    if group == "outside":
        outside = OUTSIDE[(FIRST[which] + index + attempt // 6) % len(OUTSIDE)]
        if outside == "outside_slosh":
            if name == "pendulum":
                return None
            total = sum(arm.mass for arm in robot_named(name).arms)
            mass = float(f"{0.06 * total:.3g}")
            recipe["payload"] = {"mass": mass, "x": 0.0, "y": 0.0, "z": 0.06}
        strength = ("strong", "medium")[(index // len(ROBOTS)) % 2]
        return with_single(rng, recipe, outside, strength)
    return with_several(rng, recipe, {"pair": 2, "triple": 3}[group], index)


def with_single(rng: np.random.Generator, recipe: dict, name: str, strength: str) -> dict | None:
    if not allowed(recipe, name):
        return None
    judge = Judge(recipe)
    n = robot_named(recipe["robot"]).n
    at = place_of(rng, name, n)
    form = int(name in HAS_OTHER_FORM and rng.random() < 0.6)
    if prepare(rng, recipe, name, at, form):
        judge = Judge(recipe)
    if not judge.held([], judge.calm):
        return None
    make = maker(rng, judge, name, at, form)
    found = sized(judge, make, STRENGTHS[strength]) if make else None
    if found is None:
        return None
    recipe["effects"], recipe["ratio"], recipe["strength"] = found[0], found[1], strength
    return recipe


def prepare(rng: np.random.Generator, recipe: dict, name: str, at: int, form: int) -> bool:
    """Take rows out of the database that the effect stands for; whether its robot became another one.

    A missing rotor is missing in the database too, half of the time. Friction of another form has bristles of its own,
    which what the database has of friction would take over: none is there.
    """
    if name == "rotor_inertia" and rng.random() < 0.5:
        return recipe["database"]["rotor_inertia"].pop(str(at), None) is not None
    if name in OTHER_FRICTION and form:
        return recipe["database"].get("coulomb_friction", {}).pop(str(at), None) is not None
    return False


def with_several(rng: np.random.Generator, recipe: dict, count: int, index: int) -> dict | None:
    judge = Judge(recipe)
    if not judge.held([], judge.calm):
        return None
    n = robot_named(recipe["robot"]).n
    chosen: list[dict] = []
    gaps: list[np.ndarray] = []
    usual = [c for c in CATALOGUE if c != "rotor_inertia"]
    ratios = []
    for _ in range(8 * count):
        if len(chosen) == count:
            break
        name = str(rng.choice(usual))
        at = place_of(rng, name, n)
        clash = any(
            (e["effect"] == name and e["at"] == at) or (e["effect"] in ELASTIC_LIKE and name in ELASTIC_LIKE)
            for e in chosen
        )
        if clash or not allowed(recipe, name):
            continue
        form = int(name in HAS_OTHER_FORM and rng.random() < 0.5)
        if name in OTHER_FRICTION and str(at) in recipe["database"].get("coulomb_friction", {}):
            form = 0
        make = maker(rng, judge, name, at, form)
        found = sized(judge, make, float(rng.choice([20.0, 10.0, 6.0]))) if make else None
        if found is None:
            continue
        gap = signature(judge, found[0])
        if any(abs(gap @ other) > 0.9 for other in gaps):
            continue
        chosen += found[0]
        gaps.append(gap)
        ratios.append(found[1])
    if len(chosen) < count:
        return None
    total = judge.ratio(chosen)
    if not math.isfinite(total) or total > 200.0:
        return None
    recipe["effects"], recipe["ratio"], recipe["strength"], recipe["ratios"] = chosen, total, "mixed", ratios
    return recipe


def signature(judge: Judge, effects: list[dict]) -> np.ndarray:
    """The gap in units of the noise floor as one vector of length 1."""
    signals = judge.signals(effects, judge.recipe["drawn"])
    parts = []
    for a, b in zip(signals, judge.calm, strict=True):
        parts.append(np.concatenate([a.channel(c) - b.channel(c) for c in judge.channels()], axis=1) / judge.floor)
    vector = np.concatenate(parts)[::5].ravel()
    return vector / (np.linalg.norm(vector) + 1.0e-300)


def true_world(recipe: dict) -> World:
    return world_of(recipe, recipe["effects"], drawn=recipe["drawn"])
