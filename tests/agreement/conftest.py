"""Random robots as text: what the reader, the engines and the fifth voice all start from."""

import numpy as np
import pytest

from mbexport.core.representation import Pose

EFFECTS = (
    "base_tilt", "coulomb_friction", "joint_compliance", "joint_spring", "kinematic_error", "link_inertia", "payload",
    "rotor_inertia", "stribeck_friction", "viscous_friction",
)  # fmt: skip


def table(header, rows):
    lines = [header, *(" ".join(cell if isinstance(cell, str) else repr(float(cell)) for cell in row) for row in rows)]
    return "\n".join(lines) + "\n"


def body(rng, mass, size):
    """(com, Ixx Iyy Izz Ixy Ixz Iyz) of a turned box with its center anywhere."""
    half = rng.uniform(0.2, 1.0, 3) * size
    turn = Pose.from_rpy((0.0, 0.0, 0.0), tuple(rng.uniform(-3.0, 3.0, 3))).rotation_matrix()
    tensor = turn @ np.diag(mass / 3 * (np.sum(half**2) - half**2)) @ turn.T
    i, j = [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]
    return rng.uniform(-1.0, 1.0, 3) * size, tensor[i, j]


def write_random(folder, seed, n, effects=EFFECTS, modified=False, integral=False, form="folder", friction="smooth"):
    """A database of n joints of both kinds with everything in it that the contract allows, in mixed units."""
    rng = np.random.default_rng(seed)
    kinds = ["prismatic" if rng.random() < 0.3 else "revolute" for _ in range(n)]
    sign = -1.0 if integral else 1.0
    size = rng.uniform(0.1, 0.5, n)
    text = {}
    angles = rng.uniform(-180, 180, (n, 2))
    lengths = rng.uniform(-1, 1, (n, 2)) * size[:, None]
    beta = rng.uniform(-5, 5, n)
    rows = [
        [str(i + 1), angles[i, 0], lengths[i, 0], angles[i, 1], 1e3 * lengths[i, 1]] + ([] if modified else [beta[i]])
        for i in range(n)
    ]
    text["kinematics.dat"] = table(f"arm alpha[deg] a theta[deg] d[mm]{'' if modified else ' beta[deg]'}", rows)
    if not modified:
        # a correction keeps the next joint's axis: revolute theta and d, prismatic a too
        rows = [
            [str(i), 0.3 * rng.uniform(-1, 1) * (i < n and kinds[i] == "prismatic"), *rng.uniform(-0.4, 0.4, 2)]
            for i in range(n + 1)
        ]
        text["corrections.dat"] = table("arm a theta d", rows)
    rows = []
    for i in range(n):
        mass = rng.uniform(1.0, 20.0) / (i + 1)
        com, moments = body(rng, mass, size[i])
        products = sign * moments[3:]
        rows.append([str(i + 1), mass, *com, *(1e6 * moments[:3]), *products])
    text["inertia.dat"] = table(
        "arm mass x y z Ixx[kg*mm^2] Iyy[kg*mm^2] Izz[kg*mm^2] Ixy[kg*m^2] Ixz[kg*m^2] Iyz", rows
    )
    rows = [[str(i + 1), kinds[i]] for i in range(n)]
    text["joints.dat"] = table("joint type", rows)
    text |= {f"effects/{name}.dat": content for name, content in effect_tables(rng, kinds, modified).items()}
    for path in [path for path in text if path.startswith("effects/") and path[8:-4] not in effects]:
        del text[path]
    xyz, rpy = rng.uniform(-1, 1, (2, 3)), rng.uniform(-3, 3, (2, 3))
    text["robot.yaml"] = "\n".join(
        [
            "name: random",
            f"gravity: {rng.uniform(-10, 10, 3).tolist()}",
            f"base: {{xyz: {xyz[0].tolist()}, rpy: {rpy[0].tolist()}}}",
            f"tool: {{xyz: {(0.2 * xyz[1]).tolist()}, rpy: {rpy[1].tolist()}}}",
            f"products_of_inertia: {'integral' if integral else 'tensor'}",
            f"kinematics_convention: {'modified' if modified else 'standard'}",
            f"friction: {{model: {friction}, velocity: 1.0e-2}}",
            "",
        ]
    )
    folder.mkdir(parents=True, exist_ok=True)
    for path, content in text.items():
        (folder / path).parent.mkdir(exist_ok=True)
        (folder / path).write_text(content)
    return folder


def effect_tables(rng, kinds, modified):
    """Every effect of statics at some of its places."""
    n = len(kinds)
    some = [i for i in range(n) if rng.random() < 0.6] or [0]
    other = [i for i in range(n) if rng.random() < 0.6] or [n - 1]
    pair = "N*m/rad|N/m"
    com, moments = body(rng, 2.0, 0.1)
    tables = {
        "payload": table("robot mass x y z Ixx Iyy Izz Ixy Ixz Iyz", [["robot", 2.0, *com, *moments]]),
        "rotor_inertia": table("joint inertia", [[str(i + 1), rng.uniform(0.1, 3.0)] for i in other]),
        "joint_compliance": table(
            f"joint stiffness[{pair}] damping", [[str(i + 1), *rng.uniform(1e4, 9e4, 1), 200.0] for i in some]
        ),
        "joint_spring": table("joint stiffness rest[deg|mm]", [[str(i + 1), *rng.uniform(10, 90, 2)] for i in other]),
        "viscous_friction": table("joint coefficient", [[str(i + 1), rng.uniform(1, 9)] for i in some]),
        "coulomb_friction": table("joint torque", [[str(i + 1), rng.uniform(1, 9)] for i in other]),
        "stribeck_friction": table("joint torque velocity", [[str(i + 1), rng.uniform(1, 4), 0.1] for i in other]),
        "base_tilt": table("robot roll[deg] pitch", [["robot", *rng.uniform(-0.3, 0.3, 2)]]),
    }
    if not modified:
        tables["kinematic_error"] = table(
            "arm alpha a theta[deg] d[mm] beta", [[str(i + 1), *rng.uniform(-0.01, 0.01, 5)] for i in some]
        )
        # a body more is always a possible one
        rows = []
        for i in other:
            com, (xx, yy, zz, xy, xz, yz) = body(rng, 0.5, 0.2)
            x, y, z = com
            steiner = [y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z]
            rows.append(
                [str(i + 1), 0.5, *(0.5 * com), *(np.array([xx, yy, zz, xy, xz, yz]) + 0.5 * np.array(steiner))]
            )
        tables["link_inertia"] = table("arm mass mx my mz Ixx Iyy Izz Ixy Ixz Iyz", rows)
    return tables


@pytest.fixture(scope="session")
def random_database():
    return write_random
