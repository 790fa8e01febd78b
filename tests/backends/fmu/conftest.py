"""Units as a tool that imports them sees them: read and simulated by FMPy, never by code of ours."""

import shutil
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from mbexport.backends.fmu import FmuBackend
from mbexport.backends.fmu_unit import compiler
from mbexport.core.build import build
from mbexport.core.control import Controller
from mbexport.core.database import FrozenMap, load
from mbexport.core.effects import EffectRow, effect_named
from mbexport.core.export import emit

fmpy = pytest.importorskip("fmpy", reason="FMPy, which imports units, is not installed (pip install mbexport[fmi])")
POSE = ("ee_x", "ee_y", "ee_z", "ee_qw", "ee_qx", "ee_qy", "ee_qz")


@pytest.fixture(scope="session")
def needs_compiler():
    if compiler() is None:
        # what is tested then is the compiled unit; its sources are tested without
        pytest.skip("no C compiler: units are emitted as sources only")


@pytest.fixture(scope="session")
def robot_with():
    """robot_with("pendulum", backlash={1: {"gap": 0.01}}, ...): a built-in robot with these effects and no others."""

    def make(name, **tables):
        effects = {}
        for effect, table in tables.items():
            defaults = {column.name: column.default for column in effect_named(effect).columns}
            effects[effect] = tuple(EffectRow(at, {**defaults, **values}) for at, values in sorted(table.items()))
        return build(replace(load(name), effects=FrozenMap(effects), levels=FrozenMap({})))

    return make


@pytest.fixture(scope="session")
def emitted():
    """emitted(robot, motion, control): the bytes of the unit; the same one is compiled once."""
    kept = {}

    def make(robot, motion=None, control=None):
        key = (repr(robot), motion, control)
        if key not in kept:
            emission = emit(robot, FmuBackend(), motion, control)
            kept[key] = emission.packed[emission.main]
        return kept[key]

    return make


@pytest.fixture
def opened(tmp_path, needs_compiler):
    """opened(unit's bytes, {parameter: value}): the unit, initialised, in a context."""

    @contextmanager
    def open_unit(content, start=None, inputs=None):
        path = tmp_path / "unit.fmu"
        path.write_bytes(content)
        description = fmpy.read_model_description(str(path))
        folder = fmpy.extract(str(path))
        unit = Slave(description, folder)
        try:
            unit.begin(start or {}, inputs or {})
            yield unit
        finally:
            unit.end()
            shutil.rmtree(folder, ignore_errors=True)

    return open_unit


class Slave:
    """A running unit; variables by name."""

    def __init__(self, description, folder):
        from fmpy.fmi2 import FMU2Slave

        self.variables = {variable.name: variable for variable in description.modelVariables}
        self.said = []
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="one",
        )
        self.fmu.instantiate()
        self.t = 0.0

    def begin(self, start, inputs):
        self.fmu.setupExperiment(startTime=0.0)
        self.set(start)
        self.fmu.enterInitializationMode()
        self.set(inputs)
        self.fmu.exitInitializationMode()

    def set(self, values):
        for name, value in values.items():
            setter = self.fmu.setReal if self.variables[name].type == "Real" else self.fmu.setInteger
            setter([self.variables[name].valueReference], [value])

    def get(self, *names):
        return np.array(self.fmu.getReal([self.variables[name].valueReference for name in names]))

    def joints(self, signal, n):
        return self.get(*(f"{signal}_{i + 1}" for i in range(n)))

    def step(self, duration):
        self.fmu.doStep(self.t, duration)
        self.t += duration

    def end(self):
        self.fmu.terminate()
        self.fmu.freeInstance()


@pytest.fixture(scope="session")
def controlled():
    """controlled(unit, robot, motion, control, duration): (q, tip), at every tick, torque from a controller outside."""

    def run(unit, robot, motion, control, duration):
        controller = Controller(robot, replace(robot, delay=0.0), control, motion, duration)
        q, tip = [], []
        for k in range(len(controller.tick_times)):
            seen = unit.joints("q", robot.n)
            q.append(seen)
            tip.append(unit.get(*POSE[:3]))
            controller.tick(k, seen, unit.joints("dq", robot.n))
            unit.set({f"tau_cmd_{i + 1}": tau for i, tau in enumerate(controller.held(k))})
            unit.step(1.0 / control.rate)
        return np.array(q), np.array(tip)

    return run
