"""The blind bank's generator is a stranger to the package, and its mechanics are right."""

import ast
import importlib
import json
import os
import shutil
import subprocess
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
    return [name for name in names if name.startswith(("mbexport", ".", "core", "backends", *OURS))]


# what runs the diagnosis or holds its model against the truth, and the rivals, who read runs and simulate corrected
# robots as it does
OURS = ("diagnose", "given", "head_to_head", "perfect", "rival_regressor", "rival_sysid")


@pytest.mark.parametrize(
    "path", [path for path in sorted(BANK.glob("*.py")) if path.stem not in OURS], ids=lambda path: path.name
)
def test_the_bank_imports_nothing_of_ours(path):
    assert strangers(path.read_text(encoding="utf-8")) == []


def test_an_import_of_ours_would_be_seen():
    assert len(strangers("from mbexport.core import x\nimport mbexport\nfrom ..core import y\nimport given")) == 4


@pytest.fixture(scope="module")
def bodies(bank_module):
    return bank_module("bodies")


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


def tiny(what):
    program = [sys.executable, str(Path(__file__).with_name("blind_bank_cases.py")), what]
    plain = {**os.environ, "NUMBA_DISABLE_JIT": "1", "OMP_NUM_THREADS": "1"}
    done = subprocess.run(program, capture_output=True, text=True, env=plain, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_a_perfect_model_leaves_what_the_log_states():
    for left in tiny("perfect").values():
        for name, mean_square in left.items():
            # 200 values that are normal: 0.1 is one standard deviation
            assert 0.6 < mean_square < 1.45, (name, left)


def test_rows_that_come_late_say_so_and_are_so():
    error = tiny("stamps")
    assert error["late"] > 1.0e-4
    assert error["q_cmd"] < 1.0e-8
    # to first order in the lateness; the tick's values at these stamps would be far off
    assert error["q"] < 0.1 * error["ticks"]


def test_runs_begin_at_rest_in_equilibrium():
    """As the contract of a log says; a spring that stiffens rests elsewhere than a straight one under the same load."""
    moved = tiny("settled")
    assert len(moved) == 4
    assert max(moved.values()) < 1.0e-3, moved


def test_friction_under_load_and_the_load_come_together():
    """Near no load they may answer each other with more and more: the arm jumped."""
    answer = tiny("load")
    assert abs(answer["passed"]) < 0.5
    assert answer["off"] < 1.0e-9


def test_a_rotor_is_like_its_link_and_nothing_like_friction():
    left = tiny("apart")
    assert left["rotor_inertia"] < 1.0e-9
    assert left["link_inertia"] < 1.0e-9
    assert left["payload"] < 1.0e-9
    assert min(left[name] for name in ("coulomb_friction", "viscous_friction", "base_tilt", "encoder_offset")) > 0.5


def test_one_body_is_like_a_body_and_an_encoder_together():
    alike = tiny("together")
    assert "payload" in alike
    assert {"encoder_offset", "coulomb_friction", "rotor_inertia"}.isdisjoint(alike)


def test_another_name_counts_where_its_numbers_leave_next_to_nothing():
    said = tiny("same")
    assert said["link"]
    assert not said["right"]
    # twice as far from the truth as nothing is, and four times the energy
    assert said["less"] == pytest.approx(4.0, rel=1.0e-3)


@pytest.fixture(scope="module")
def score(bank_module):
    return bank_module("score")


def case(
    score,
    wanted,
    found,
    *,
    group="single",
    strength="strong",
    alike=None,
    fitted=1e3,
    verdict="explained",
    total=None,
    same=False,
):
    stated = [
        {"effect": e, "at": at, "exact": True, "scored": True, "total": total or {"torque": 1.0}} for e, at in wanted
    ]
    truth = {
        "case": {"class": group}, "stated": stated, "strength": strength, "robot": "scara", "numerical": None,
        "sensors": {"colour": 0.0, "channels": ["q", "tau"]}, "control": {"mode": "pd"},
    }  # fmt: skip
    which = [
        {
            "effect": e,
            "at": at,
            "probability": 0.95,
            "parameters": {"torque": {"value": 1.1, "ci95": [1.05, 1.2]}},
            "indistinguishable_from": [{"effect": o, "at": p, "because": ""} for o, p in others],
        }
        for e, at, *others in found
    ]
    said = {"verdict": verdict, "which": which, "how_far": {}}
    apart = alike and [
        {
            "effect": own[0],
            "at": own[1],
            "fitted": fitted,
            "alike": [{"effect": effect, "at": at} for effect, at in sorted(names - {own})],
        }
        for own, names in zip(wanted, alike, strict=True)
    ]
    return score.Case("a", truth, said, apart, 10.0, same=same)


def figure(score, cases, name):
    return next(f for f in score.figures(cases) if f.name.startswith(name)).answers


COULOMB, VISCOUS = ("coulomb_friction", "joint_1"), ("viscous_friction", "joint_1")


def test_a_name_counts_as_far_as_it_can_be_told_apart(score):
    right = case(score, [COULOMB], [COULOMB])
    wrong = case(score, [COULOMB], [VISCOUS], alike=[{COULOMB}])
    twin = case(score, [COULOMB], [VISCOUS], alike=[{COULOMB, VISCOUS}])
    assert figure(score, [right, wrong, twin], "single effect: effect and place right") == [True, False]
    assert figure(score, [right, wrong, twin], "... by its name or one") == [True, False, True]
    # fits of the other may miss that it shows the same, where its own numbers tell
    same = case(score, [COULOMB], [VISCOUS], alike=[{COULOMB}], same=True)
    assert figure(score, [right, same], "single effect: effect and place right") == [True]
    assert figure(score, [right, same], "... by its name or one") == [True, True]
    # what the runs do not show that a fit may see counts, and is told beside
    hidden = case(score, [COULOMB], [], alike=[{COULOMB}], fitted=1.0)
    assert figure(score, [right, hidden], "single effect: effect and place right") == [True, False]
    assert figure(score, [right, hidden], "... and the fitted runs show it") == [True]
    in_set = case(score, [COULOMB], [(*VISCOUS, COULOMB)])
    assert figure(score, [wrong, in_set], "single effect: truth in the reported set") == [False, True]
    both = case(score, [COULOMB, VISCOUS], [VISCOUS, COULOMB], group="pair")
    half = case(score, [COULOMB, VISCOUS], [VISCOUS], group="pair")
    more = case(score, [COULOMB, VISCOUS], [VISCOUS, COULOMB, ("delay", "robot")], group="pair")
    assert figure(score, [both, half, more], "pairs: exact") == [True, False, False]
    assert figure(score, [both, half, more], "pairs: findings").count(False) == 1
    # one name that says what both say, and the same beside another
    load = ("payload", "robot")
    alone, beside = (
        case(score, [COULOMB, VISCOUS], found, group="pair", alike=[{COULOMB}, {VISCOUS}])
        for found in ([load], [load, COULOMB])
    )
    for one in (alone, beside):
        one.apart[0]["together"] = [{"effect": load[0], "at": load[1]}]
    assert figure(score, [alone, beside], "pairs: exact") == [True, False]


def test_blaming_something_is_seen(score):
    blamed = case(score, [], [COULOMB], group="nothing", strength=None, alike=[])
    calm = case(score, [], [], group="nothing", strength=None, alike=[], verdict="no_gap")
    assert figure(score, [blamed, calm], "nothing missing: an effect named") == [True, False]
    faint = case(score, [COULOMB], [("delay", "robot")], strength="weak")
    assert figure(score, [faint], "barely visible: a wrong name") == [True]
    outside = [
        case(score, [("outside_drag", "joint_1")], [], group="outside", verdict=v) for v in ("unexplained", "explained")
    ]
    assert figure(score, outside, "not in the catalogue: called unexplained") == [True, False]
    assert case(score, [COULOMB], [COULOMB]).covers() == [False]
    assert case(score, [COULOMB], [COULOMB], total={"torque": 1.1}).covers() == [True]


def test_intervals_are_wilsons(score):
    low, high = score.wilson(0, 300)
    assert low == 0.0
    assert abs(high - 0.01264) < 1.0e-4
    assert score.wilson(0, 0) == (0.0, 1.0)


def test_probabilities_are_held_against_the_truth(score):
    # said with 0.95: one right, one wrong, and one on a robot that lacks nothing
    right, wrong = case(score, [COULOMB], [COULOMB]), case(score, [COULOMB], [VISCOUS])
    blamed = case(score, [], [COULOMB], group="nothing", strength=None, alike=[])
    rows = {row[0]: row[1:] for row in score.reliability(score.claims([right, wrong, blamed]))}
    assert rows["0.95 to 0.99"][:2] == ["0.950", score.Figure("", "", [True, False]).shown()]
    assert rows["0.95 to 0.99"][2:] == ["0.950", score.Figure("", "", [True, False, False]).shown()]
    assert rows["0.9 to 0.95"][1] == "no case"
    assert rows["Brier score"][0] == f"{(0.05**2 + 0.95**2) / 2:.4f}"


def test_positions_alone_are_held_against_torque(score):
    # Newcombe's example of 56 of 70 against 48 of 80
    words = score.difference([True] * 56 + [False] * 14, [True] * 48 + [False] * 32)
    assert words == "-20.0 points [-33.4, -5.2] (80 against 70)"


SAMPLE = Path(__file__).with_name("blind_sample")


def scored(score, name, robot=None):
    """A case of the sample, diagnosed, its truth opened."""
    folder = SAMPLE / "cases" / name
    runs, holdout = (sorted((folder / part).iterdir()) for part in ("runs", "holdout"))
    said = mbexport.diagnose(robot or folder / "robot", runs, holdout, backends=[]).to_json()
    truth = json.loads((SAMPLE / "sealed" / f"{name}.json").read_text(encoding="utf-8"))
    return score.Case(name, truth, said, None, 0.0)


def sampled(group):
    """Names of the sample's cases of a class."""
    sealed = [json.loads(path.read_text(encoding="utf-8")) for path in sorted((SAMPLE / "sealed").iterdir())]
    names = [path.stem for path in sorted((SAMPLE / "sealed").iterdir())]
    return [name for name, truth in zip(names, sealed, strict=True) if truth["case"]["class"] == group]


@pytest.mark.parametrize("name", sampled("single"))
def test_a_single_effect_of_the_sample_is_found(score, name):
    found = scored(score, name)
    assert found.said["verdict"] == "explained"
    assert figure(score, [found], "single effect: effect and place right") == [True]
    # a scorer that believes everything would be no scorer: what was found as the truth, turned round, and elsewhere
    (effect,), (finding,) = found.truth["stated"], found.said["which"]
    values = {key: finding["parameters"][key]["value"] for key in effect["total"]}
    for key, value in values.items():
        assert value == pytest.approx(effect["total"][key], rel=0.1)

    def as_if(**truth):
        return score.Case(name, {**found.truth, "stated": [{**effect, **truth}]}, found.said, None, 0.0)

    assert as_if(total=values).covers() == [True] * len(values)
    assert as_if(total={key: -value for key, value in values.items()}).covers() == [False] * len(values)
    assert figure(score, [as_if(at="joint_2")], "single effect: effect and place right") == [False]


@pytest.mark.parametrize("name", sampled("nothing"))
def test_nothing_is_blamed_in_the_sample(score, name):
    found = scored(score, name)
    assert figure(score, [found], "nothing missing: an effect named") == [False]
    assert figure(score, [found], "nothing missing: verdict no_gap") == [True]


@pytest.mark.parametrize("name", sampled("nothing"))
def test_a_wrong_robot_is_not_called_right(score, name, tmp_path):
    robot = tmp_path / "robot"
    shutil.copytree(SAMPLE / "cases" / name / "robot", robot)
    table = robot / "inertia.dat"
    text = table.read_text(encoding="utf-8")
    assert text.count("1.2") == 1
    table.write_text(text.replace("1.2", "1.5"), encoding="utf-8")
    found = scored(score, name, robot)
    assert figure(score, [found], "nothing missing: verdict no_gap") == [False]


@pytest.mark.parametrize("name", sampled("outside"))
def test_an_outsider_of_the_sample_is_not_explained_away(score, name):
    found = scored(score, name)
    assert figure(score, [found], "not in the catalogue: called unexplained") == [True]


@pytest.mark.parametrize("case", ["b067ba048e", "b3ee24e65d", "e034235786"])
def test_a_case_leaves_noise_once_its_truth_is_put_in(bank_module, case):
    perfect = bank_module("perfect")
    truth = json.loads((SAMPLE / "sealed" / f"{case}.json").read_text(encoding="utf-8"))
    assert perfect.scored(truth)
    left = perfect.left_of(SAMPLE / "cases" / case, truth, "mjcf")
    # of runs of 1.5 s slow noise is known badly
    assert max(left.along, left.channel, left.simulated) < 3.0
    for stated in truth["stated"]:
        (name,) = stated["total"]
        stated["total"][name] *= 1.5
        wrong = perfect.left_of(SAMPLE / "cases" / case, truth, "mjcf")
        assert min(wrong.channel, wrong.simulated) > 5.0


def test_other_laws_than_the_catalogues_are_put_in_nowhere(bank_module):
    truth = json.loads((SAMPLE / "sealed" / "2804dc2458.json").read_text(encoding="utf-8"))
    assert not bank_module("perfect").scored(truth)
