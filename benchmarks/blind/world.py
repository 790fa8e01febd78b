"""A recipe (plain data) becomes robots: the nominal one and the true one, ready to run.

A recipe names everything that a case is made of, so that whoever opens the truth can make the same robot again.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

import numpy as np
from bodies import (
    PRISMATIC,
    REVOLUTE,
    Extras,
    Robot,
    build_chain,
    inverse_dynamics,
    mass_and_bias,
    node_frames,
    read_robot,
    turn,
)
from integrate import Command, Control, Plant, run
from laws import COLUMN, NAMES

ROBOTS = Path(__file__).resolve().parents[2] / "examples" / "robots"
# steps a tick of an integrator of first order
EULER_STEPS = {"euler": 1, "fine_euler": 5}
# the paper's arm has no rotors in its tables; these are usual for its size
PAPER_ROTORS = (60.0, 60.0, 25.0, 3.0, 1.5, 0.5)
BRISTLE, LUGRE_BRISTLE = 5.0e-6, 3.0e-4
BEARING = ("kx", "ky", "kz", "krx", "kry")


@cache
def robot_named(name: str) -> Robot:
    return read_robot(ROBOTS / name)


@dataclass
class World:
    """A robot with its effects, still changeable."""

    robot: Robot
    drives: np.ndarray
    extras: Extras = field(default_factory=Extras)
    springs: dict = field(default_factory=dict)  # hidden place -> [(k, b, stiffening), ...]
    delay: float = 0.0
    kp_factor: np.ndarray = field(default_factory=lambda: np.ones(1))
    kd_factor: np.ndarray = field(default_factory=lambda: np.ones(1))
    encoder: np.ndarray = field(default_factory=lambda: np.zeros(1))
    torque_bias: np.ndarray = field(default_factory=lambda: np.zeros(1))

    def chain(self):
        return build_chain(self.robot, self.extras)


def column(world: World, joint: int, name: str, value: float) -> None:
    world.drives[joint, COLUMN[name]] = value


def plus(world: World, joint: int, name: str, value: float) -> None:
    world.drives[joint, COLUMN[name]] += value


def rotors(name: str) -> np.ndarray:
    robot = robot_named(name)
    table = robot.tables.get("rotor_inertia")
    if table is None:
        return np.array(PAPER_ROTORS[: robot.n])
    return np.array([table[i + 1]["inertia"] for i in range(robot.n)])


def home_inertia(robot: Robot) -> np.ndarray:
    """Diagonal of the arms' mass matrix at home, shape (n,)."""
    chain, _, _, _ = build_chain(robot)
    return np.diag(mass_and_bias(chain, robot.home.copy(), np.zeros(robot.n))[0]).copy()


def usual_load(robot: Robot) -> np.ndarray:
    """A torque that a joint has to pass, to size what hangs on the load by, shape (n,)."""
    chain, _, _, _ = build_chain(robot)
    held = np.abs(mass_and_bias(chain, robot.home.copy(), np.zeros(robot.n))[1])
    return np.maximum(held, 0.3 * np.where(np.isfinite(robot.effort), robot.effort, 0.0))


def nominal_tables(recipe: dict) -> dict[str, dict[int, dict]]:
    """The effects that the database of a case states."""
    return {
        effect: {int(at): dict(values) for at, values in rows.items()}
        for effect, rows in recipe["database"].items()
        if rows
    }


def world_of(recipe: dict, effects: list[dict], *, drawn: dict | None = None) -> World:
    """A robot of a recipe: its database, its known payload, and more effects.

    Args:
        recipe: The case.
        effects: {"effect", "at", "parameters", "form"} each; parameters are ADDED to what the database has.
        drawn: Tolerances' draw: per arm factors and shifts (see design.draw_tolerance); None: the nominal numbers.
    """
    robot = robot_named(recipe["robot"])
    if drawn:
        robot = disturbed(robot, drawn)
    n = robot.n
    drives = np.zeros((n, len(NAMES)))
    drives[:, COLUMN["gain"]] = 1.0
    drives[:, COLUMN["velocity"]] = 0.05
    drives[:, COLUMN["exponent"]] = 2.0
    drives[:, COLUMN["bristle"]] = BRISTLE
    world = World(robot, drives, Extras(), {}, 0.0, np.ones(n), np.ones(n), np.zeros(n), np.zeros(n))
    for effect, rows in nominal_tables(recipe).items():
        for at, values in rows.items():
            add_effect(world, {"effect": effect, "at": at, "parameters": values, "form": 0})
    if recipe.get("payload"):
        load = recipe["payload"]
        if not any(e["effect"] == "outside_slosh" for e in effects):
            world.extras = replace(
                world.extras, load=(load["mass"], (load["x"], load["y"], load["z"]), np.zeros((3, 3)))
            )
    for effect in effects:
        add_effect(world, effect)
    inertia, load = home_inertia(robot), usual_load(robot)
    for i in range(n):
        d = world.drives[i]
        column(world, i, "bristle_inertia", inertia[i] + d[COLUMN["inertia"]])
        if d[COLUMN["elastic"]]:
            column(world, i, "bristle_inertia", d[COLUMN["inertia"]] or inertia[i])
            if d[COLUMN["inertia"]] == 0.0:
                column(world, i, "inertia", inertia[i])
            if d[COLUMN["stiffness"]] == 0.0:
                motor = d[COLUMN["inertia"]]
                reduced = motor * inertia[i] / (motor + inertia[i])
                column(world, i, "stiffness", (2.0 * math.pi * 500.0) ** 2 * reduced)
                column(world, i, "damping", 0.3 * math.sqrt(d[COLUMN["stiffness"]] * reduced))
        if robot.prismatic[i]:
            column(world, i, "bristle", d[COLUMN["bristle"]] * 0.3)
        dry = d[COLUMN["coulomb"]] + d[COLUMN["stribeck"]] + d[COLUMN["load"]] * load[i]
        if dry > 0.0:
            lead = 1.8 * math.sqrt(d[COLUMN["bristle"]] * d[COLUMN["bristle_inertia"]] / dry)
            column(world, i, "bristle_lead", lead)
    return world


def disturbed(robot: Robot, drawn: dict) -> Robot:
    """The robot with the numbers that this one example of it has."""
    arms = []
    for arm, row in zip(robot.arms, drawn["arms"], strict=True):
        scale = np.sqrt(np.outer(1.0 + np.array(row["inertia"]), 1.0 + np.array(row["inertia"])))
        arms.append(
            replace(
                arm,
                mass=arm.mass * (1.0 + row["mass"]),
                com=arm.com + np.array(row["com"]),
                tensor=arm.tensor * scale,
                alpha=arm.alpha + row["angle"][0],
                theta=arm.theta + row["angle"][1],
                beta=arm.beta + row["angle"][2],
                a=arm.a + row["length"][0],
                d=arm.d + row["length"][1],
            )
        )
    return replace(robot, arms=tuple(arms))


def add_effect(world: World, effect: dict) -> None:
    """Put one effect into a world; `form` 1 is another law than the catalogue's, with its own numbers in parameters."""
    name, at, p, other = effect["effect"], int(effect["at"]), effect["parameters"], effect.get("form", 0)
    i = at - 1
    if other and name in OTHER_FRICTION:
        column(world, i, "form", 1.0)
        column(world, i, "bristle", LUGRE_BRISTLE)
    EFFECTS[name](world, i, p)


OTHER_FRICTION = ("coulomb_friction", "load_friction")


# what a database's row and an effect beside it make together
TOGETHER = {"inertia", "coulomb", "asymmetry", "viscous", "stribeck", "load"}


def on_drive(**columns: str | tuple[str, float]) -> Callable[[World, int, dict], None]:
    """An effect that is numbers of its joint's drive: column=parameter, or (parameter, what it is where not given)."""

    def put(world: World, i: int, p: dict) -> None:
        for name, source in columns.items():
            value = p[source] if isinstance(source, str) else p.get(*source)
            (plus if name in TOGETHER else column)(world, i, name, value)

    return put


def compliance(world: World, i: int, p: dict) -> None:
    column(world, i, "elastic", 1.0)
    column(world, i, "stiffness", p["stiffness"])
    column(world, i, "damping", p.get("damping", 0.0))
    column(world, i, "stiffening", p.get("stiffening", 0.0))


def bearing(world: World, i: int, p: dict) -> None:
    directions, springs = [], []
    for number, name in enumerate(BEARING):
        if math.isfinite(p.get(name, math.inf)):
            kind, axis = (PRISMATIC, number) if number < 3 else (REVOLUTE, number - 3)
            directions.append((kind, axis))
            springs.append((p[name], p.get("b" + name[1:], 0.0), p.get("stiffening", 0.0)))
    world.extras = replace(world.extras, bearings={**world.extras.bearings, i: directions})
    world.springs["bearing", i] = springs
    if math.isfinite(p.get("krz", math.inf)):
        compliance(world, i, {"stiffness": p["krz"], "damping": p.get("brz", 0.0)})


def backlash(world: World, i: int, p: dict) -> None:
    column(world, i, "elastic", 1.0)
    column(world, i, "gap", p["gap"])
    column(world, i, "soft", p.get("soft", 0.0))
    for name in ("stiffness", "damping"):
        if math.isfinite(p.get(name, math.inf)):
            column(world, i, name, p[name])


def torque_offset(world: World, i: int, p: dict) -> None:
    world.torque_bias[i] += p["torque"]


def encoder_offset(world: World, i: int, p: dict) -> None:
    world.encoder[i] += p["offset"]


def delay(world: World, i: int, p: dict) -> None:
    world.delay += p["time"]


def controller_gain(world: World, i: int, p: dict) -> None:
    world.kp_factor[i] *= p.get("kp", 1.0)
    world.kd_factor[i] *= p.get("kd", 1.0)


def tensor_of(p: dict) -> np.ndarray:
    xy, xz, yz = p.get("Ixy", 0.0), p.get("Ixz", 0.0), p.get("Iyz", 0.0)
    return np.array(
        [[p.get("Ixx", 0.0), xy, xz], [xy, p.get("Iyy", 0.0), yz], [xz, yz, p.get("Izz", 0.0)]], dtype=float
    )


def payload(world: World, i: int, p: dict) -> None:
    if p["mass"] == 0.0:
        return
    center = np.array([p.get("x", 0.0), p.get("y", 0.0), p.get("z", 0.0)])
    arm = world.robot.arms[-1]
    put_arm(world, world.robot.n - 1, with_body(arm, p["mass"], p["mass"] * center, tensor_of(p), about_center=True))


def link_inertia(world: World, i: int, p: dict) -> None:
    moment = np.array([p.get("mx", 0.0), p.get("my", 0.0), p.get("mz", 0.0)])
    put_arm(world, i, with_body(world.robot.arms[i], p.get("mass", 0.0), moment, tensor_of(p), about_center=False))


def with_body(arm, mass: float, moment: np.ndarray, tensor: np.ndarray, *, about_center: bool):
    """An arm with more inertia: mass, first moment, and tensor about its own center or about the frame's origin."""
    from bodies import steiner

    if about_center and mass:
        tensor = tensor + mass * steiner(moment / mass)
    whole = arm.tensor + arm.mass * steiner(arm.com) + tensor
    m = arm.mass + mass
    com = (arm.mass * arm.com + moment) / m
    return replace(arm, mass=m, com=com, tensor=whole - m * steiner(com))


def put_arm(world: World, i: int, arm) -> None:
    arms = list(world.robot.arms)
    arms[i] = arm
    world.robot = replace(world.robot, arms=tuple(arms))


def kinematic_error(world: World, i: int, p: dict) -> None:
    arm = world.robot.arms[i]
    put_arm(
        world, i, replace(arm, **{k: getattr(arm, k) + p.get(k, 0.0) for k in ("alpha", "a", "theta", "d", "beta")})
    )


def base_tilt(world: World, i: int, p: dict) -> None:
    tilt = (turn(0, p.get("roll", 0.0)) @ turn(1, p.get("pitch", 0.0)))[:3, :3]
    world.robot = replace(world.robot, gravity=tilt.T @ world.robot.gravity)


def link_flexibility(world: World, i: int, p: dict) -> None:
    world.extras = replace(world.extras, bends={**world.extras.bends, i: p.get("at", 0.5)})
    stiffening = p.get("stiffening", 0.0)
    world.springs["bend", i] = [
        (p["ku"], p.get("bu", 0.0), stiffening),
        (p["kv"], p.get("bv", 0.0), stiffening),
    ]


# what no catalogue has


def outside_coupling(world: World, i: int, p: dict) -> None:
    column(world, i, "partner", p["partner"] - 1)
    column(world, i, "coupling", p["torque"])


def outside_cable(world: World, i: int, p: dict) -> None:
    column(world, i, "partner", p["partner"] - 1)
    column(world, i, "cable", p["torque"])
    column(world, i, "cable_ratio", p["ratio"])


def outside_slosh(world: World, i: int, p: dict) -> None:
    world.extras = replace(world.extras, load=None, slosh=(p["mass"], (p["x"], p["y"], p["z"])))
    world.springs["slosh", 0] = [(p["stiffness"], p["damping"], 0.0)] * 2


def outside_mount(world: World, i: int, p: dict) -> None:
    world.extras = replace(world.extras, mount=(p["mass"], p["inertia"]))
    world.springs["mount", 0] = [(p["stiffness"], p["damping"], 0.0)] * 2


EFFECTS = {
    "joint_compliance": compliance,
    "joint_compliance_6d": bearing,
    "rotor_inertia": on_drive(inertia="inertia"),
    "coulomb_friction": on_drive(coulomb="torque", asymmetry=("asymmetry", 0.0)),
    "viscous_friction": on_drive(viscous="coefficient", viscous_bend=("bend", 0.0)),
    "stribeck_friction": on_drive(stribeck="torque", velocity="velocity", exponent=("exponent", 2.0)),
    "load_friction": on_drive(load="coefficient", load_asymmetry=("asymmetry", 0.0)),
    "hysteresis": on_drive(hysteresis="torque", hysteresis_stiffness="stiffness", hysteresis_form=("dahl", 0.0)),
    "backlash": backlash,
    "transmission_error": on_drive(
        error="amplitude", error_cycles="cycles", error_phase="phase", error_second=("second", 0.0)
    ),
    "torque_ripple": on_drive(
        ripple="amplitude",
        ripple_cycles="cycles",
        ripple_phase="phase",
        ripple_second=("second", 0.0),
        ripple_growth=("growth", 0.0),
    ),
    "torque_constant": on_drive(gain="gain", gain_droop=("droop", 0.0)),
    "torque_offset": torque_offset,
    "torque_limit": on_drive(limit="torque", limit_form=("soft", 0.0)),
    "encoder_offset": encoder_offset,
    "delay": delay,
    "controller_gain": controller_gain,
    "joint_spring": on_drive(spring="stiffness", spring_rest="rest", spring_bend=("bend", 0.0)),
    "payload": payload,
    "link_inertia": link_inertia,
    "kinematic_error": kinematic_error,
    "base_tilt": base_tilt,
    "link_flexibility": link_flexibility,
    "outside_coupling": outside_coupling,
    "outside_cable": outside_cable,
    "outside_warming": on_drive(warm="share", warm_time="time"),
    "outside_wavy_friction": on_drive(wavy="share", waves="cycles", wavy_phase="phase"),
    "outside_drag": on_drive(drag="coefficient"),
    "outside_motor_lag": on_drive(lag="time"),
    "outside_slosh": outside_slosh,
    "outside_mount": outside_mount,
}
CATALOGUE = tuple(name for name in EFFECTS if not name.startswith("outside_"))


# ------------------------------------------------------------------------------------------------------------- running


@dataclass(frozen=True)
class Signals:
    """What sensors without noise would report at every tick, (m, n) each; ee (m, 3, 4): rotation and position."""

    q: np.ndarray
    dq: np.ndarray
    q_link: np.ndarray
    tau: np.ndarray
    tau_cmd: np.ndarray
    tau_link: np.ndarray
    ee: np.ndarray

    def channel(self, name: str) -> np.ndarray:
        return self.ee[:, :, 3] if name == "ee" else getattr(self, name)


def feedforward_of(recipe: dict, law: Command, ticks: int) -> np.ndarray:
    """Torque (ticks, n) of the nominal rigid bodies at the command."""
    kind = recipe["control"]["feedforward"]
    q, dq, ddq = sampled(law, ticks, recipe["control"]["rate"])
    if kind == "none":
        return np.zeros_like(q)
    bodies_only = {e: r for e, r in recipe["database"].items() if e in ("link_inertia", "kinematic_error", "base_tilt")}
    world = world_of({**recipe, "database": bodies_only}, [])
    chain, _driven, _, _ = world.chain()
    still = np.zeros_like(q)
    return inverse_dynamics(chain, q, still if kind == "gravity" else dq, still if kind == "gravity" else ddq)


def sampled(law: Command, ticks: int, rate: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Command at the ticks, (ticks, n) each."""
    t = np.arange(ticks) / rate
    k = np.minimum((t / law.spacing + 1.0e-9).astype(int), len(law.coefficients) - 1)
    x = (t - k * law.spacing)[:, None]
    c = law.coefficients[k].transpose(2, 0, 1)
    q = ((((c[5] * x + c[4]) * x + c[3]) * x + c[2]) * x + c[1]) * x + c[0]
    dq = (((5 * c[5] * x + 4 * c[4]) * x + 3 * c[3]) * x + 2 * c[2]) * x + c[1]
    ddq = ((20 * c[5] * x + 12 * c[4]) * x + 6 * c[3]) * x + 2 * c[2]
    return q, dq, ddq


def plant_of(world: World, imposed: bool):
    chain, driven, hidden, tool = world.chain()
    N = len(chain.kind)
    k, b, kappa = np.zeros(N), np.zeros(N), np.zeros(N)
    for node, place, number in hidden:
        k[node], b[node], kappa[node] = world.springs[place][number]
    return chain, Plant(np.array(driven, dtype=np.int64), world.drives, k, b, kappa, imposed), tool


def substeps_needed(world: World, rate: float, speed: np.ndarray) -> int:
    """Integration steps a tick: a millisecond, a third of one where forces have kinks, less where springs, bristles or
    contacts are fast."""
    chain, plant, _ = plant_of(world, False)
    q = np.zeros(len(chain.kind))
    q[plant.driven] = world.robot.home
    M = mass_and_bias(chain, q, np.zeros(len(q)))[0]
    rigid = np.array([d[COLUMN["inertia"]] if not d[COLUMN["elastic"]] else 0.0 for d in world.drives])
    M[plant.driven, plant.driven] += rigid
    mobility = np.diag(np.linalg.inv(M))
    load = usual_load(world.robot)
    fastest = 0.0
    kinks = any(np.any(world.drives[:, COLUMN[name]]) for name in ("hysteresis", "gap", "coupling", "drag"))
    for j in range(len(q)):
        fastest = max(
            fastest, math.sqrt(plant.hidden_stiffness[j] * mobility[j]), plant.hidden_damping[j] * mobility[j]
        )
    for i, d in enumerate(world.drives):
        free = mobility[plant.driven[i]]
        if d[COLUMN["elastic"]]:
            soft = free + 1.0 / d[COLUMN["inertia"]]
            # contacts open and close; what follows an impact hangs on where it was
            finer = 2.0 if d[COLUMN["gap"]] and not d[COLUMN["soft"]] else 1.0
            fastest = max(fastest, finer * math.sqrt(d[COLUMN["stiffness"]] * soft), d[COLUMN["damping"]] * soft)
            free = 1.0 / d[COLUMN["inertia"]]
        dry = d[COLUMN["coulomb"]] + d[COLUMN["stribeck"]] + d[COLUMN["load"]] * load[i]
        if dry > 0.0:
            kinks = True
            fastest = max(fastest, math.sqrt(dry / d[COLUMN["bristle"]] * free))
            if d[COLUMN["form"]]:
                fastest = max(fastest, 0.3 * speed[i] / d[COLUMN["bristle"]])
        if d[COLUMN["lag"]]:
            fastest = max(fastest, 1.0 / d[COLUMN["lag"]])
    return max(math.ceil((3000.0 if kinks else 1000.0) / rate), math.ceil(fastest / 0.8 / rate))


def quickness(world: World, control: dict) -> float:
    """How much of a joint's speed its controller's damping takes away within a tick, at most; above 2 none is held."""
    chain, plant, _ = plant_of(world, False)
    q = np.zeros(len(chain.kind))
    q[plant.driven] = world.robot.home
    M = mass_and_bias(chain, q, np.zeros(len(q)))[0][np.ix_(plant.driven, plant.driven)]
    motor, elastic = world.drives[:, COLUMN["inertia"]], world.drives[:, COLUMN["elastic"]] != 0.0
    M[elastic] = M[:, elastic] = 0.0
    M[np.diag_indices(len(motor))] += motor
    kd = np.array(control["kd"]) * world.kd_factor * world.drives[:, COLUMN["gain"]]
    return float(np.max(np.linalg.eigvals(np.linalg.solve(M, np.diag(kd))).real)) / control["rate"]


def simulate(
    recipe: dict,
    world: World,
    law: Command,
    duration: float,
    *,
    noise: np.ndarray | None = None,
    finer: int = 1,
    given: np.ndarray | None = None,
    numerical: str = "",
) -> Signals:
    """Run one robot of a recipe.

    Args:
        recipe: The case: its control.
        world: The robot.
        law: The command.
        duration: [s].
        noise: What the controller sees beside the truth, (ticks, 2, n).
        finer: Factor on the integration's steps (for measuring its error).
        given: Commanded torques (ticks, n), mode torque.
        numerical: A suspect that is no physics: "euler", "fine_euler", "held_command" or "continuous".
    """
    control = recipe["control"]
    rate = control["rate"]
    ticks = int(duration * rate + 1.0e-6) + 1
    imposed = control["mode"] == "motion"
    n = world.robot.n
    chain, plant, (tool_node, tool) = plant_of(world, imposed)
    feedforward = feedforward_of(recipe, law, ticks)
    speed = np.max(np.abs(sampled(law, ticks, rate)[1]), axis=0)
    substeps = substeps_needed(world, rate, speed) * finer
    followed, seen = law, world.encoder
    if imposed:
        # drives follow what the encoders report
        moved = law.coefficients.copy()
        moved[:, :, 0] -= world.encoder[None, :]
        followed, seen = Command(law.spacing, moved), np.zeros(n)
    every = 8 if numerical == "continuous" else 1
    if every > 1:
        fine = np.arange((ticks - 1) * every + 1) / every
        feedforward = np.stack([np.interp(fine, np.arange(ticks), f) for f in feedforward.T], axis=1)
        noise = None if noise is None else np.repeat(noise, every, axis=0)[: len(fine)]
    m = len(feedforward)
    settings = Control(
        np.array(control["kp"]) * world.kp_factor,
        np.array(control["kd"]) * world.kd_factor,
        feedforward,
        np.array(control.get("torque_limit") or [0.0] * n, dtype=float),
        world.delay,
        np.asarray(seen, dtype=float),
        np.zeros((m, 2, n)) if noise is None else noise,
        rate * every,
        max(1, round(rate / 200.0)) if numerical == "held_command" else 1,
    )
    theta, dtheta, nodes, asked, tau, passed = run(
        chain,
        plant,
        followed,
        settings,
        m,
        EULER_STEPS.get(numerical, max(1, math.ceil(substeps / every))),
        numerical in EULER_STEPS,
        np.zeros((0, n)) if given is None else given,
    )
    frames = node_frames(chain, nodes[::every], tool_node)
    ee = frames @ tool
    ee[:, :, :3] = frames[:, :, :3] @ tool[:3, :3]
    ee[:, :, 3] = frames[:, :, :3] @ tool[:3, 3] + frames[:, :, 3]
    return Signals(
        theta[::every] + world.encoder,
        dtheta[::every],
        nodes[::every][:, plant.driven],
        tau[::every] + world.torque_bias,
        asked[::every],
        passed[::every],
        ee,
    )
