"""What tests of several parts share: a small valid robot as text, and a diagnosis made by hand.

The diagnosis stands around two real simulations: a paper arm with friction, held against one without.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

# the same examples in every run: `--hypothesis-profile=default` draws others
settings.register_profile("fixed", derandomize=True)
settings.load_profile("fixed")

SMALL = {
    "robot.yaml": "name: small\n",
    "kinematics.dat": "arm alpha[deg] a[m] theta[deg] d[m]\n1 90 0.3 0 0.2\n2 0 0 0 0.1\n",
    "inertia.dat": "arm mass x y z Ixx Iyy Izz\n1 4 -0.1 0 0 0.02 0.03 0.03\n2 2 0 0 0.1 0.01 0.01 0.005\n",
    "joints.dat": "joint type lower[deg|m] upper[deg|m]\n1 revolute -170 170\n2 prismatic -0.1 0.4\n",
}


@pytest.fixture
def small(tmp_path: Path) -> Callable[..., Path]:
    """Writes the small robot with some files replaced (None: left out) and gives its folder."""

    def make(files: Mapping[str, str | bytes | None] | None = None, name: str = "robot") -> Path:
        folder = tmp_path / name
        for file, text in {**SMALL, **(files or {})}.items():
            if text is not None:
                path = folder / file
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return folder

    return make


FRICTION = {"torque": 12.1}


@pytest.fixture(scope="session")
def paper_arm():
    from mbexport.core.database import load

    return load("imece2013")


@pytest.fixture(scope="session")
def measured_and_simulated(paper_arm):
    """The paper's arm under control: measured with friction in one engine, simulated without and with it in another."""
    from mbexport.core.build import build
    from mbexport.core.control.gains import default_pd
    from mbexport.core.database import FrozenMap, with_effects
    from mbexport.core.effects import EffectRow
    from mbexport.core.motion import motion_named
    from mbexport.core.simulation import simulate

    bare = replace(paper_arm, effects=FrozenMap())
    nominal = build(bare)
    rows = {"coulomb_friction": (EffectRow(2, FrozenMap(FRICTION)),)}
    corrected = with_effects(bare, rows)
    motion = motion_named(nominal, "greca")
    control = default_pd(nominal, feedforward="inverse_dynamics")

    def run(robot, backend):
        return simulate(robot, backend, motion, control, duration=2.0, rate=250.0, nominal=nominal)

    noise = {"q": [2e-5] * 6, "tau": [0.3] * 6, "ee": [2e-5]}
    measured = run(
        build(with_effects(bare, {"coulomb_friction": (EffectRow(2, FrozenMap({"torque": 12.0})),)})), "urdf"
    )
    return corrected, rows, measured.with_noise(noise, 3), run(nominal, "mjcf"), run(build(corrected), "mjcf")


@pytest.fixture(scope="session")
def explained(measured_and_simulated):
    """What a diagnosis of it would say: friction of joint 2, which two other names resemble."""
    from mbexport.core.database import MotionTable
    from mbexport.core.diagnosis import diagnosis as d

    corrected, rows, measured, before, after = measured_and_simulated

    def signals(trace, names):
        return {**{name: trace.joints[name] for name in names}, "ee": trace.tip}

    simulated = ("q", "dq", "tau")
    noise = {"q": np.full(6, 2e-5), "tau": np.full(6, 0.3), "ee": np.full(3, 2e-5)}
    seen = signals(measured, ("q_cmd", "dq_cmd", *simulated))
    seen["tau"] = seen["tau"].copy()
    seen["tau"][100:110, 2] = np.nan
    overlay = d.Overlay(
        "run-02", measured.t, seen, signals(before, simulated), signals(after, simulated), noise, held_out=True
    )
    shares = {1: 0.02, 2: 0.9, 3: 0.05, 4: 0.01, 5: 0.02, 6: 0.0}
    t = np.linspace(0.0, 4.0, 81)
    swing = np.sin(np.pi * t[:, None] * np.array([0.5, 1.0, 1.5, 0.5, 1.0, 2.0])) * 0.6
    motion = MotionTable(tuple(t.tolist()), tuple(tuple(row) for row in swing.tolist()))
    scores = [
        d.Score(effect, f"joint_{i}", share * (0.97 if i == 2 else 0.02), 0.97 * share if i == 2 else 0.001)
        for effect, share in (("coulomb_friction", 1.0), ("viscous_friction", 0.4), ("backlash", 0.1))
        for i in range(1, 7)
    ]
    scores += [d.Score("link_inertia", f"arm_{i}", 0.01 * i, 0.0) for i in range(1, 7)]
    scores += [d.Score("delay", "robot", 0.06, 0.01), d.Score("torque_offset", "joint_4", 0.0, 0.0)]
    return d.Diagnosis(
        robot="imece2013",
        verdict="explained",
        where=d.Where(
            signals={
                "tau": d.SignalGap(2.31, 0.31, 7.4, "N*m"),
                "q": d.SignalGap(4.1e-4, 2.2e-5, 18.6, "rad"),
                "ee": d.SignalGap(5.2e-4, 2.4e-5, 21.6, "m"),
            },
            joints={f"joint_{i}": d.JointShare(s, 20 * s**0.5, (17 * s**0.5, 23 * s**0.5)) for i, s in shares.items()},
            when=(
                d.Phase("reversal", 0.55),
                d.Phase("acceleration", 0.3),
                d.Phase("constant_speed", 0.1),
                d.Phase("standstill", 0.05),
            ),
            bands=(d.Band(0.0, 1.0, 0.6), d.Band(1.0, 5.0, 0.3), d.Band(5.0, 25.0, 0.08), d.Band(25.0, 125.0, 0.02)),
            depends_on=(d.Dependence("sign(dq_2)", 0.93), d.Dependence("dq_2", 0.61)),
        ),
        which=(
            d.Finding(
                "coulomb_friction",
                "joint_2",
                0.98,
                {"torque": d.Parameter(FRICTION["torque"], (11.7, 12.5), "N*m")},
                (
                    d.Rival("stribeck_friction", "joint_2", "joint 2 never moves slower than 0.2 rad/s for long"),
                    d.Rival("hysteresis", "joint_2", "joint 2 never moves slower than 0.2 rad/s for long"),
                ),
            ),
        ),
        rejected=(
            d.Rejected("viscous_friction", "joint_2", "no gain on held-out data"),
            d.Rejected("delay", "robot", "no gain on held-out data"),
            *(d.Rejected("backlash", f"joint_{i}", "not excited by these runs") for i in range(1, 7)),
        ),
        how_far=d.HowFar(
            before={"tau": 2.31, "q": 4.1e-4, "ee": 5.2e-4},
            after={"tau": 0.33, "q": 3.6e-5, "ee": 4.4e-5},
            noise={"tau": 0.31, "q": 2.2e-5, "ee": 2.4e-5},
            shrinks_by=0.93,
            ci95=(0.91, 0.95),
            signals={"tau": 0.95, "q": 0.92, "ee": 0.92},
            by_effect=(d.EffectShare("coulomb_friction", "joint_2", 0.93),),
            backends={"urdf": 0.93, "mjcf": 0.93, "exudyn": 0.92, "pybullet": None},
            refused={"pybullet": "PyBullet is not installed."},
            without={"coulomb_friction joint_2": 0.0},
        ),
        unexplained=d.Unexplained(0.01, {"joint_2": 0.6, "joint_3": 0.4}, "nothing known"),
        next_experiment=d.NextExperiment(
            "separates Coulomb from Stribeck friction at joint 2: slow and fast passes in both directions", motion
        ),
        runs=("run-01", "run-03"),
        holdout=("run-02",),
        left_out=(d.LeftOutSamples("run-02", "tau_3", "stuck", "run-02: tau_3 is stuck from 0.4 to 0.44 s."),),
        effects=rows,
        corrected=corrected,
        notes=("Measured positions were differentiated after a zero-phase filter of 40 Hz.",),
        scores=tuple(scores),
        overlays=(overlay,),
    )


@pytest.fixture(scope="session")
def no_gap(explained):
    """The same robot and runs where nothing is wrong."""
    from mbexport.core.database import FrozenMap
    from mbexport.core.diagnosis import diagnosis as d

    (overlay,) = explained.overlays
    quiet = replace(overlay, before=overlay.after, after={})
    return replace(
        explained,
        verdict="no_gap",
        where=d.Where(
            {"tau": d.SignalGap(0.305, 0.31, 0.0, "N*m"), "q": d.SignalGap(2.2e-5, 2.2e-5, 0.0, "rad")},
            {f"joint_{i}": d.JointShare(0.0, 0.0) for i in range(1, 7)},
        ),
        which=(),
        rejected=(),
        how_far=d.HowFar({"tau": 0.305}, {"tau": 0.305}, {"tau": 0.31}, None, None, {"tau": None}),
        unexplained=d.Unexplained(0.0, {}, ""),
        next_experiment=None,
        left_out=(),
        effects=FrozenMap(),
        scores=(),
        overlays=(quiet,),
    )


@pytest.fixture(scope="session")
def unexplained(explained):
    """The same gap where no effect earns its place."""
    from mbexport.core.database import FrozenMap
    from mbexport.core.diagnosis import diagnosis as d

    (overlay,) = explained.overlays
    return replace(
        explained,
        verdict="unexplained",
        which=(),
        rejected=(*explained.rejected, d.Rejected("coulomb_friction", "joint_2", "no gain on held-out data")),
        how_far=replace(
            explained.how_far,
            after=explained.how_far.before,
            shrinks_by=0.0,
            ci95=(0.0, 0.0),
            signals={"tau": 0.0, "q": 0.0, "ee": 0.0},
            by_effect=(),
            backends={},
            refused={},
            without={},
        ),
        unexplained=d.Unexplained(
            1.0, {"joint_2": 0.9, "joint_3": 0.1}, "a torque that goes with the direction of motion of joint 2"
        ),
        next_experiment=None,
        effects=FrozenMap(),
        overlays=(replace(overlay, after={}),),
    )
