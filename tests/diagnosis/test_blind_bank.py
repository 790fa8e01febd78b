"""The blind bank's generator is a stranger to the package, and its mechanics are right."""

import ast
import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

import mbexport
from mbexport.core.kinematics import dynamics

BANK = Path(__file__).resolve().parents[2] / "benchmarks" / "blind"
ROBOTS = BANK.parents[1] / "examples" / "robots"


def strangers(text):
    names = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names.append("." * node.level + (node.module or ""))
    return [name for name in names if name.startswith(("mbexport", ".", "core", "backends"))]


@pytest.mark.parametrize("path", sorted(BANK.glob("*.py")), ids=lambda path: path.name)
def test_the_bank_imports_nothing_of_ours(path):
    assert strangers(path.read_text(encoding="utf-8")) == []


def test_an_import_of_ours_would_be_seen():
    assert strangers("from mbexport.core import x\nimport mbexport\nfrom ..core import y") != []


@pytest.fixture(scope="module")
def bodies():
    sys.path.insert(0, str(BANK))
    try:
        yield importlib.import_module("bodies")
    finally:
        sys.path.remove(str(BANK))


@pytest.mark.parametrize("name", ["imece2013", "puma560", "arm7", "scara", "pendulum"])
def test_its_dynamics_are_pinocchios(bodies, name, tmp_path):
    robot = bodies.read_robot(ROBOTS / name)
    chain, _, _, _ = bodies.build_chain(robot)
    pin = importlib.import_module("pinocchio")
    mbexport.export(mbexport.build(mbexport.load(name), level="rigid"), ["urdf"], tmp_path / "urdf")
    (urdf,) = (tmp_path / "urdf").rglob("*.urdf")
    model = pin.buildModelFromUrdf(str(urdf))
    data = model.createData()
    ours = dynamics(mbexport.build(mbexport.load(name), level="rigid"))
    random = np.random.default_rng(1)
    for _ in range(3):
        q, dq = random.uniform(-1.0, 1.0, robot.n), random.uniform(-1.0, 1.0, robot.n)
        mass, bias = bodies.mass_and_bias(chain, q, dq)
        assert np.allclose(mass, ours.mass_matrix(q), rtol=0.0, atol=1.0e-12 * abs(mass).max())
        assert np.allclose(bias, ours.bias(q, dq), rtol=0.0, atol=1.0e-12 * (1.0 + abs(bias).max()))
        if model.nq == robot.n:
            upper = np.triu(pin.crba(model, data, q))
            assert np.allclose(np.triu(mass), upper, rtol=0.0, atol=1.0e-10 * abs(mass).max())


def test_a_free_swing_keeps_its_energy(bodies):
    robot = bodies.read_robot(ROBOTS / "arm7")
    chain, _, _, _ = bodies.build_chain(robot)

    def flow(state):
        mass, bias = bodies.mass_and_bias(chain, state[:7], state[7:])
        return np.concatenate([state[7:], -np.linalg.solve(mass, bias)])

    state = np.concatenate([robot.home, np.full(7, 0.1)])
    before = bodies.energy(chain, state[:7].copy(), state[7:].copy())
    h = 2.0e-4
    for _ in range(1000):
        a = flow(state)
        b = flow(state + 0.5 * h * a)
        c = flow(state + 0.5 * h * b)
        d = flow(state + h * c)
        state = state + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    kinetic = 0.5 * state[7:] @ bodies.mass_and_bias(chain, state[:7].copy(), state[7:].copy())[0] @ state[7:]
    assert kinetic > 1.0
    assert abs(bodies.energy(chain, state[:7].copy(), state[7:].copy()) - before) < 1.0e-6 * kinetic
