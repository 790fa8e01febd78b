"""Tiny cases of the blind bank, run by tests as a process of their own: not compiled, for that would take longer."""

import json
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks" / "blind"))


def recipe(mode, **sensors):
    from design import base_recipe

    made = base_recipe(np.random.default_rng(3), "pendulum", "positions", 0.4)
    made |= {"effects": [], "numerical": None, "strength": None, "ratio": 0.0}
    made["control"] |= {"mode": mode, "rate": 500.0, "feedforward": "none"}
    made["database"].pop("coulomb_friction", None)
    made["database"].pop("viscous_friction", None)
    made["runs"] = made["runs"][:1]
    made["runs"][0]["kind"] = "rich"
    made["sensors"] |= {
        "channels": ["q", "dq", "tau"],
        "colour": 0.0,
        "steps": {"q": 1.0, "tau": 0.5},
        "jitter": 0.0,
        "gap": None,
        "stated": True,
        "loop": False,
        "every": 1,
    } | sensors
    return made


def perfect():
    """Mean squares, in units of what the log states, that the generator's own truth leaves."""
    from record import log_file, measured
    from ruamel.yaml import YAML

    out = {}
    for loop in (False, True):
        case = recipe("pd", loop=loop)
        columns, truth = measured(case, case["runs"][0])
        stated = YAML(typ="safe").load(log_file(case))["noise"]
        out[str(loop)] = {
            name: float(np.mean(((columns[f"{name}_1"] - truth.channel(name)[:, 0]) / stated[name][0]) ** 2))
            for name in ("q", "dq", "tau")
        }
    return out


def stamps():
    """Largest error of positions and commands at their own, jittering stamps, and the error of ticks in their place."""
    from design import law_of
    from record import measured

    quiet = {name: [0.0] for name in ("q", "dq", "tau")}
    case = recipe("motion", jitter=1.0e-4, steps={})
    case["sensors"]["sigma"] = {**case["sensors"]["sigma"], **quiet}
    columns, truth = measured(case, case["runs"][0])
    law = law_of(case, case["runs"][0])
    ticks = np.arange(len(truth.q)) / 500.0
    k = np.minimum((columns["t"] / law.spacing).astype(int), len(law.coefficients) - 1)
    c, x = law.coefficients[k, 0], columns["t"] - k * law.spacing
    at_stamps = sum(c[:, power] * x**power for power in range(6))
    return {
        "late": float(np.max(columns["t"] - ticks)),
        "q": float(np.max(np.abs(columns["q_1"] - at_stamps))),
        "q_cmd": float(np.max(np.abs(columns["q_cmd_1"] - at_stamps))),
        "ticks": float(np.max(np.abs(truth.q[:, 0] - at_stamps))),
    }


def apart():
    """What a pendulum's rotor is like, where its drive follows the motion: what each other leaves."""
    from apart import MOST, Scene, candidates

    case = recipe("motion", channels=["tau"])
    case["effects"] = [{"effect": "rotor_inertia", "at": 1, "parameters": {"inertia": 0.02}, "form": 0}]
    scene = Scene(case, 0)
    left = {}
    for name, _, columns in candidates(scene):
        left[name] = min(left.get(name, 1.0), scene.left(columns, MOST.get(name, np.inf))[0])
    return left


def together():
    """What alone shows the same as a pendulum's body and encoder that are off."""
    from apart import alike_together

    case = recipe("motion", channels=["tau"])
    case["runs"][0]["duration"] = 0.2
    case["effects"] = [
        {"effect": "link_inertia", "at": 1, "parameters": {"mass": 0.1, "mx": 0.02, "Izz": 0.01}, "form": 0},
        {"effect": "encoder_offset", "at": 1, "parameters": {"offset": 0.01}, "form": 0},
    ]
    # what stays of no more than noise is nothing
    rows = [{"rms": 1.0}]
    alike_together(case, rows)
    return [one["effect"] for one in rows[0]["together"]]


def same():
    """What other names leave of a pendulum's rotor, with their numbers: its link's inertia, and less of that."""
    import design
    from score import shows_the_same
    from shrinkage import left_by

    # parts of a gap are of the same floor, whichever it is
    design.TOLERANCE_DRAWS = 1
    case = recipe("motion", channels=["tau"])
    case["runs"][0]["duration"] = 0.13
    case["effects"] = [{"effect": "rotor_inertia", "at": 1, "parameters": {"inertia": 0.02}, "form": 0}]
    case["stated"] = [{"effect": "rotor_inertia", "at": "joint_1", "exact": True, "scored": True, "total": {}}]

    def found(effect, place, name, value):
        return [{"effect": effect, "at": place, "parameters": {name: {"value": value}}}]

    link, less = (found("link_inertia", "arm_1", "Izz", value) for value in (0.02, -0.02))
    # a name that is right is not held against anything
    right = found("rotor_inertia", "joint_1", "inertia", 0.03)
    return {
        "link": shows_the_same(case, link, None),
        "right": shows_the_same(case, right, None),
        "less": left_by(case, less),
    }


def load():
    """By how much friction under a load is off from that load's, where it has as good as none and slides fast."""
    from integrate import Command, flow, workspace
    from laws import BRISTLE, bristle, level
    from world import plant_of, world_of

    parameters = {"coulomb_friction": {"torque": 0.08, "asymmetry": 0.15}, "load_friction": {"coefficient": 0.05}}
    effects = [{"effect": name, "at": 1, "parameters": p, "form": 1} for name, p in parameters.items()]
    chain, plant, _ = plant_of(world_of(recipe("pd"), effects), False)
    drive, speed = plant.drives[0], -2.0
    y, dy, out, work = np.zeros(14), np.zeros(14), np.zeros((4, 1)), workspace(1, 1)
    y[1], y[4] = speed, -drive[BRISTLE]
    flow(chain, plant, Command(1.0, np.zeros((1, 1, 6))), 0.0, y, np.array([-0.08]), dy, out, work)
    passed = out[0, 0]
    force, _ = bristle(drive, y[4], speed, level(drive, speed, 0.0, 0.0, passed))
    return {"off": float(abs(force - out[1, 0])), "passed": float(passed)}


def settled():
    """How far robots with what gives move before they are asked to [standard deviations of their sensor]."""
    from design import law_of
    from world import simulate, world_of

    case = recipe("pd")
    # as heavy as its controller is quick
    case["database"]["rotor_inertia"] = {"1": {"inertia": 0.5}}
    springs = {
        "joint_compliance": {"stiffness": 40.0, "damping": 0.1, "stiffening": 5e3},
        "joint_compliance_6d": {"krx": 40.0, "brx": 0.1, "kry": 60.0, "bry": 0.1, "stiffening": 5e3},
        "link_flexibility": {"ku": 40.0, "bu": 0.1, "kv": 60.0, "bv": 0.1, "at": 0.4, "stiffening": 5e3},
        "backlash": {"gap": 0.01, "soft": 1.0},
        "base_tilt": {"roll": 0.3, "pitch": 0.4},
    }
    tilt = {"effect": "base_tilt", "at": 0, "parameters": springs.pop("base_tilt"), "form": 0}
    out = {}
    for name, parameters in springs.items():
        # a tilted base loads every direction
        world = world_of(case, [tilt, {"effect": name, "at": 1, "parameters": parameters, "form": 1}])
        q = simulate(case, world, law_of(case, case["runs"][0]), 0.03).q[:, 0]
        out[name] = float(np.max(np.abs(q - q[0]))) / case["sensors"]["sigma"]["q"][0]
    return out


if __name__ == "__main__":
    cases = {
        "perfect": perfect,
        "stamps": stamps,
        "apart": apart,
        "together": together,
        "same": same,
        "load": load,
        "settled": settled,
    }
    print(json.dumps(cases[sys.argv[1]]()))
