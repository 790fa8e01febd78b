"""What the catalogue's parameters of a case are: exactly, or the catalogue's law that is nearest to another form.

Nearest: least squares over the states that the runs visited.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import least_squares
from world import World

# forms whose nearest catalogue parameters are not one set of numbers
LOOSE = {"hysteresis", "backlash", "joint_compliance_6d", "link_flexibility", "torque_limit"}
CATALOGUE_COLUMNS = {
    "joint_compliance": ("stiffness", "damping"),
    "coulomb_friction": ("torque",),
    "viscous_friction": ("coefficient",),
    "stribeck_friction": ("torque", "velocity"),
    "load_friction": ("coefficient",),
    "hysteresis": ("torque", "stiffness"),
    "backlash": ("gap",),
    "transmission_error": ("amplitude", "cycles", "phase"),
    "torque_ripple": ("amplitude", "cycles", "phase"),
    "torque_constant": ("gain",),
    "torque_limit": ("torque",),
    "joint_spring": ("stiffness", "rest"),
    "link_flexibility": ("ku", "kv", "bu", "bv", "at"),
    "joint_compliance_6d": ("krx", "kry", "brx", "bry"),
}


def stated(recipe: dict, world: World, signals: list) -> list[dict]:
    """For each effect: {"effect", "at", "form", "exact", "total": catalogue parameters with the database's share}."""
    out = []
    for effect in recipe["effects"]:
        name, at = effect["effect"], effect["at"]
        columns = CATALOGUE_COLUMNS.get(name, effect["parameters"])
        place = "robot" if at == 0 else f"{'arm' if name in ARMS else 'joint'}_{at}"
        exact = not effect["form"]
        row = recipe["database"].get(name, {}).get(str(at), {})
        # what the database knows of it has its form as well
        p = {key: value + (row.get(key, 0.0) if key in columns else 0.0) for key, value in effect["parameters"].items()}
        total = {key: float(p[key]) for key in columns if key in p}
        if effect["form"] and not name.startswith("outside_"):
            total.update(nearest(name, at - 1, p, world, signals))
        out.append(
            {
                "effect": name,
                "at": place,
                "form": "catalogue" if exact else "other",
                "exact": exact,
                "scored": exact or name not in LOOSE,
                "total": total,
            }
        )
    return out


ARMS = ("link_inertia", "kinematic_error", "link_flexibility")


def nearest(name: str, i: int, p: dict, world: World, signals: list) -> dict:
    """Catalogue parameters nearest to another form of a law, from what the runs visited."""
    v = np.concatenate([s.dq[::10, i] for s in signals])
    theta = np.concatenate([s.q[::10, i] for s in signals]) - world.encoder[i]
    passed = np.concatenate([s.tau_link[::10, i] for s in signals])
    tau = np.concatenate([s.tau[::10, i] for s in signals])
    arm = np.concatenate([s.q_link[::10, i] for s in signals])
    moving = np.abs(v) > 1.0e-3 * (0.1 if world.robot.prismatic[i] else 1.0)
    if not moving.any() and name.endswith("friction"):
        return {}
    if name == "coulomb_friction":
        return {"torque": p["torque"] * (1.0 + p["asymmetry"] * float(np.mean(np.sign(v[moving]))))}
    if name == "viscous_friction":
        force = p["coefficient"] * v / (1.0 + p["bend"] * np.abs(v))
        return {"coefficient": float(force @ v / (v @ v))}
    if name == "stribeck_friction":
        speed = np.abs(v[moving])
        force = p["torque"] * np.exp(-((speed / p["velocity"]) ** p["exponent"]))

        def left(x):
            return x[0] * np.exp(-((speed / x[1]) ** 2)) - force

        found = least_squares(left, [p["torque"], p["velocity"]], x_scale=[p["torque"], p["velocity"]]).x
        return {"torque": float(found[0]), "velocity": abs(float(found[1]))}
    if name == "load_friction":
        pushes = np.where(passed[moving] * v[moving] >= 0.0, 1.0, -1.0)
        weight = passed[moving] ** 2
        share = float(np.sum(weight * pushes) / np.sum(weight))
        return {"coefficient": p["coefficient"] * (1.0 + p["asymmetry"] * share)}
    if name == "joint_compliance":
        top = float(np.max(np.abs(passed)))
        stretch = np.interp(passed, *stretch_table(p, top))
        return {"stiffness": float(passed @ stretch / (stretch @ stretch))}
    if name in ("transmission_error", "torque_ripple"):
        angle = p["cycles"] * theta
        wave = p["amplitude"] * (np.sin(angle + p["phase"]) + p["second"] * np.sin(2.0 * (angle + p["phase"]) + 0.7))
        a, b = np.linalg.lstsq(np.column_stack([np.sin(angle), np.cos(angle)]), wave, rcond=None)[0]
        return {"amplitude": math.hypot(a, b), "phase": math.atan2(b, a)}
    if name == "torque_constant":
        given = p["gain"] * tau / np.sqrt(1.0 + 2.0 * p["droop"] * tau**2)
        return {"gain": float(given @ tau / (tau @ tau))}
    if name == "joint_spring":
        x = arm - p["rest"]
        force = p["stiffness"] * x * (1.0 + p["bend"] * x * x)
        slope, constant = np.linalg.lstsq(np.column_stack([arm, np.ones_like(arm)]), force, rcond=None)[0]
        return {"stiffness": float(slope), "rest": float(-constant / slope)}
    return {}


def stretch_table(p: dict, top: float) -> tuple[np.ndarray, np.ndarray]:
    """(torque, stretch) of a stiffening spring up to a torque."""
    x = np.linspace(0.0, 1.0, 4001) ** 2 * top / p["stiffness"]
    torque = p["stiffness"] * x * (1.0 + p.get("stiffening", 0.0) * x * x)
    return np.concatenate([-torque[:0:-1], torque]), np.concatenate([-x[:0:-1], x])
