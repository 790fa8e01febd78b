"""Frequencies and damping of a record that dies away, without any model of what made it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .modes import Mode, modes_of

Array = NDArray[np.float64]

# singular values below this part of the largest are noise
NOISE = 1.0e-6
# longest window of delays over the record's length, and how many samples the fit is given at most
WINDOW = 0.4
SAMPLES = 200
# a part of the record that counts for less than this of the strongest is none
FAINT = 0.02
# what is damped more than this creeps back rather than rings
RINGING = 0.5


def ringing(t: Array, values: Array) -> tuple[Mode, ...]:
    """The oscillations that a record is made of, the strongest first.

    The eigensystem realisation algorithm (Juang and Pappa, 1985) on the record as a free response: a Hankel matrix of
    the channels, cut at its noise; the eigenvalues of the shift by one sample are exp(s dt).

    Args:
        t: Times [s], evenly spaced, shape (m,).
        values: What dies away to zero, a column a channel, shape (m, c); channels of one unit.
    """
    every = max(1, len(t) // SAMPLES)
    data, dt = values[::every], float(every * (t[1] - t[0]))
    rows = max(2, int(WINDOW * len(data)))
    columns = len(data) - rows
    hankel = np.concatenate([data[k : k + columns].T for k in range(rows)])
    shifted = np.concatenate([data[k + 1 : k + 1 + columns].T for k in range(rows)])
    left, sizes, right = np.linalg.svd(hankel, full_matrices=False)
    order = int(np.sum(sizes > NOISE * sizes[0]))
    root = np.sqrt(sizes[:order])
    shift = (left[:, :order] / root).T @ shifted @ (right[:order].T / root)
    factors, vectors = np.linalg.eig(shift)
    # how much of the first sample each is
    seen = (left[: data.shape[1], :order] * root) @ vectors
    begin = np.linalg.solve(vectors, (right[:order, 0] * root).astype(np.complex128))
    strength = np.linalg.norm(seen, axis=0) * np.abs(begin)
    with np.errstate(divide="ignore"):
        eigenvalues = np.asarray(np.log(factors.astype(np.complex128)) / dt, dtype=np.complex128)
    kept = (eigenvalues.imag > 0.0) & (eigenvalues.real < 0.0) & (strength > FAINT * float(np.max(strength)))
    found = np.flatnonzero(kept)
    strongest = found[np.argsort(-strength[found], kind="stable")]
    modes = [modes_of(eigenvalues[k : k + 1])[0] for k in strongest]
    return tuple(mode for mode in modes if mode.damping_ratio < RINGING)
