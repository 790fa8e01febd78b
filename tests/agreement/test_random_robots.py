"""All engines and the tables' text on random robots: 1 to 8 joints of both kinds, everything in them that may be."""

from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from mbexport.core.agreement import agree
from mbexport.core.agreement.quantities import STATICS

ENGINES = ("urdf", "mjcf", "exudyn", "pybullet")


def told(answer):
    lines = [
        f"{f.scenario} {f.signal} {f.voices} {f.value:.1e} gate {f.gate:.1e}" for f in answer.figures if not f.passed
    ]
    return "\n".join([*answer.sentences, *map(str, answer.left_out), *lines])


@settings(max_examples=12, deadline=None)
@given(st.integers(1, 8), st.integers(0, 2**32 - 1), st.booleans())
def test_statics(random_database, tmp_path_factory, n, seed, integral):
    folder = random_database(tmp_path_factory.mktemp("robot"), seed, n, integral=integral)
    answer = agree(folder, ENGINES, quantities=STATICS, states=12)
    assert answer.agreed and not answer.left_out, told(answer)
    assert len(answer.voices) == 5


@settings(max_examples=4, deadline=None)
@given(st.integers(1, 6), st.integers(0, 2**32 - 1))
def test_statics_of_modified_rows(random_database, tmp_path_factory, n, seed):
    effects = ("payload", "rotor_inertia", "joint_compliance")
    folder = random_database(tmp_path_factory.mktemp("robot"), seed, n, effects, modified=True)
    answer = agree(folder, ENGINES, quantities=STATICS, states=12)
    assert answer.agreed and not answer.left_out, told(answer)


@settings(max_examples=2, deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(st.integers(2, 4), st.integers(0, 2**32 - 1))
def test_runs(random_database, tmp_path_factory, n, seed):
    effects = ("payload", "rotor_inertia", "joint_compliance", "joint_spring", "viscous_friction")
    folder = random_database(tmp_path_factory.mktemp("robot"), seed, n, effects)
    answer = agree(folder, ENGINES, quantities=["rigid_loop", "compliant_motion"], duration=0.1)
    assert answer.agreed and not answer.left_out, told(answer)
    assert {figure.scenario for figure in answer.figures} == {"rigid_loop", "compliant_motion"}
