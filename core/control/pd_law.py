"""The law of a PD controller at its ticks, as text that Python runs and that engines compile into their loops."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np


class PdTable(NamedTuple):
    """All that a run's torques come from, beside what the robot reports; m ticks, n joints.

    Attributes:
        q_cmd, dq_cmd: The command, shape (m, n).
        feedforward: Added to the feedback, shape (m, n).
        kp, kd: Gains, shape (n,).
        lowest, highest: What the torque is cut to, shape (n,).
        limited: Something cuts it.
        differenced: Speeds are differences of positions over that many ticks; 0: they are reported.
        blend: Part of the way that they are so, from those that are reported, 0 to 1.
        ahead: For how long positions are seen ahead, by their speeds [s].
        rate: Of the ticks [Hz].
        seen: Positions of the ticks before, where speeds are differences of them, shape (m or 0, n).
        torques: Out: of each tick, shape (m, n).
        part: Workspace, shape (n,).
    """

    q_cmd: Any
    dq_cmd: Any
    feedforward: Any
    kp: Any
    kd: Any
    lowest: Any
    highest: Any
    limited: bool
    differenced: int
    blend: float
    ahead: float
    rate: float
    seen: Any
    torques: Any
    part: Any


def tick(table: PdTable, k: int, q: Any, dq: Any) -> None:
    """Tick k sees the motors' reported position and their speed, shapes (n,), and writes its torque."""
    feedback(table, k, q + table.ahead * dq, speed(table, k, q, dq))
    cut(table, k)


def speed(table: PdTable, k: int, q: Any, dq: Any) -> Any:
    """The speed that tick k goes by, shape (n,)."""
    if table.differenced > 0:
        table.seen[k] = q
        ticks = min(k, table.differenced)
        if ticks > 0:
            return dq + table.blend * (table.rate / ticks * (q - table.seen[k - ticks]) - dq)
    return dq


def feedback(table: PdTable, k: int, q: Any, dq: Any) -> None:
    """Torque of tick k before any limit."""
    part, tau = table.part, table.torques[k]
    np.subtract(table.q_cmd[k], q, part)
    np.multiply(table.kp, part, tau)
    np.subtract(table.dq_cmd[k], dq, part)
    np.multiply(table.kd, part, part)
    np.add(tau, part, tau)
    np.add(tau, table.feedforward[k], tau)


def cut(table: PdTable, k: int) -> None:
    """The limits on tick k's torque."""
    if table.limited:
        tau = table.torques[k]
        tau[:] = np.maximum(np.minimum(tau, table.highest), table.lowest)
