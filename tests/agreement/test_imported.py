"""Imported robots are held to the same gates as built-in ones, engines and the text of their tables alike."""

import importlib.util
from pathlib import Path

import pytest

from mbexport.core.agreement import agree
from mbexport.core.agreement.quantities import STATICS
from mbexport.core.database import write
from mbexport.core.importing import import_model

DATA = Path(importlib.util.find_spec("pybullet_data").submodule_search_locations[0])
MODELS = {
    "panda": ("franka_panda/panda.urdf", "panda_hand"),
    "iiwa": ("kuka_iiwa/model.urdf", None),
    "xarm6": ("xarm/xarm6_robot.urdf", None),
}


@pytest.mark.parametrize("name", MODELS)
def test_all_voices_agree(name, tmp_path):
    file, tip = MODELS[name]
    # two of xArm's links are no possible bodies, which no engine takes
    robot = import_model(DATA / file, tip=tip, repair=True).database
    write(robot, tmp_path / name)
    agreement = agree(tmp_path / name, level="rigid", quantities=[*STATICS, "rigid_motion"], duration=0.3, states=10)
    assert agreement.agreed, agreement.sentences
    assert len(agreement.voices) == 5
