"""Numbers from simulation: what tolerances may do is taken out of them."""

import numpy as np
import pytest

from mbexport.core.diagnosis.polish import _Loose

RANDOM = np.random.default_rng(4)
# two runs of some rows and channels, three tolerances
COLUMNS = [RANDOM.normal(size=(m, 2, 3)) for m in (7, 5)]


def flat(values):
    """Rows and channels of all runs, one after the other."""
    return np.concatenate([one.reshape(-1, *one.shape[2:]) for one in values])


def test_what_lies_along_tolerances_is_taken_out_as_their_prior_allows():
    loose = _Loose.of(COLUMNS)
    whole = flat(COLUMNS)
    dense = np.linalg.inv(np.eye(len(whole)) + whole @ whole.T)
    left = [RANDOM.normal(size=one.shape[:2]) for one in COLUMNS]
    slopes = [RANDOM.normal(size=(*one.shape[:2], 4)) for one in COLUMNS]
    np.testing.assert_allclose(flat(loose.without(left)), dense @ flat(left), rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(flat(loose.without(slopes)), dense @ flat(slopes), rtol=1e-10, atol=1e-12)
    assert loose.energy(left) == pytest.approx(flat(left) @ dense @ flat(left))


def test_without_tolerances_nothing_is_taken_out():
    loose = _Loose.of([one[..., :0] for one in COLUMNS])
    left = [RANDOM.normal(size=one.shape[:2]) for one in COLUMNS]
    np.testing.assert_array_equal(flat(loose.without(left)), flat(left))
    assert loose.energy(left) == pytest.approx(float(flat(left) @ flat(left)))
