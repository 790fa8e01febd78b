import pytest

import mbexport
from mbexport.core.studio import Bench, Session


@pytest.fixture
def bench():
    return Bench.of(mbexport.load("planar2r"))


@pytest.fixture
def session(bench, tmp_path):
    made = Session(bench, backend="urdf", motion="hold", output=tmp_path / "out")
    yield made
    made.close()
