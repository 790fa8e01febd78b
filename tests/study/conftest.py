"""A small robot and small studies of it."""

from __future__ import annotations

import pytest

from mbexport.core.database import load
from mbexport.core.study import plan_study


@pytest.fixture(scope="session")
def planar():
    return load("planar2r")


@pytest.fixture
def small(planar):
    """small(vary..., options) -> a study of few, short variants."""

    def make(*vary, **options):
        chosen = vary or ("joint_compliance.stiffness@joint_1=0.5:2:3", "joint_compliance.stiffness@joint_2=0.5:2:3")
        return plan_study(planar, chosen, **{"level": "compliant", "motion": "hold", "duration": 0.01, **options})

    return make
