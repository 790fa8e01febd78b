"""Controllers as units: a PD in C, written by hand and packed here with a description of its own."""

import shutil
import subprocess
import zipfile
from pathlib import Path

import numpy as np
import pytest

from mbexport.core.build import build
from mbexport.core.database import load
from mbexport.core.motion import point_to_point

SOURCE = Path(__file__).parent / "units" / "pd.c"
GUID = "{6b1f6f0c-pd}"
BLOCKS = ("q", "dq", "q_cmd", "dq_cmd", "tau", "kp", "kd", "fault")
PLACE = "binaries/linux64/pd.so"


def description(n, names=None, version="2.0", kind="CoSimulation", step=None):
    """modelDescription.xml of pd.c for n joints; `names` renames variables."""
    lines, outputs = [], []
    for block, signal in enumerate(BLOCKS):
        for i in range(n):
            own = f"{signal}_{i + 1}"
            name = (names or {}).get(own, own)
            reference = block * n + i
            if signal == "tau":
                outputs.append(reference + 1)
                rest = 'causality="output"><Real/>'
            elif signal in ("kp", "kd", "fault"):
                value = {"kp": 40.0, "kd": 3.0, "fault": 0.0}[signal]
                rest = f'causality="parameter" variability="tunable"><Real start="{value}"/>'
            else:
                rest = 'causality="input"><Real start="0.0"/>'
            lines.append(f'<ScalarVariable name="{name}" valueReference="{reference}" {rest}</ScalarVariable>')
    experiment = f'<DefaultExperiment stepSize="{step}"/>' if step else ""
    told = "".join(f'<Unknown index="{k}"/>' for k in outputs)
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="{version}" modelName="pd" '
        f'guid="{GUID}" generationTool="by hand"><{kind} modelIdentifier="pd"/>{experiment}'
        f"<ModelVariables>{''.join(lines)}</ModelVariables><ModelStructure><Outputs>"
        f"{told}</Outputs></ModelStructure></fmiModelDescription>"
    )


@pytest.fixture(scope="session")
def fmpy():
    return pytest.importorskip("fmpy", reason="FMPy, which runs units, is not installed (pip install mbexport[fmi])")


@pytest.fixture(scope="session")
def library(tmp_path_factory):
    """library(n): bytes of pd.c compiled for n joints."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        # the unit must be native code that nothing of the package made
        pytest.skip("no C compiler to make the controller's unit with")
    kept = {}

    def make(n):
        if n not in kept:
            out = tmp_path_factory.mktemp("unit") / "pd.so"
            options = ["-std=c99", "-O1", "-ffp-contract=off", "-shared", "-fPIC", f"-DN={n}", f'-DGUID="{GUID}"']
            subprocess.run([compiler, *options, str(SOURCE), "-o", str(out), "-lm"], check=True)
            kept[n] = out.read_bytes()
        return kept[n]

    return make


@pytest.fixture
def pd_unit(fmpy, library, tmp_path):
    """pd_unit(n, names=..., place=...): path of the unit for n joints."""

    def pack(n, place=PLACE, name="pd.fmu", **changes):
        if fmpy.platform != "linux64":
            # a unit holds its library in a folder named after the platform, and this one is built for one
            pytest.skip("the test's unit is packed for Linux")
        path = tmp_path / name
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("modelDescription.xml", description(n, **changes))
            archive.writestr(place, library(n))
        return path

    return pack


@pytest.fixture(scope="module")
def robot():
    """Two joints that give: what units drive."""
    return build(load("planar2r"), "compliant")


@pytest.fixture(scope="module")
def law(robot):
    """A short way from home."""
    return point_to_point(robot.home(), np.array(robot.home()) + 0.3, 0.2)
