"""The drives' equations along a whole recorded motion; plain text that Numba compiles, as the kernel it calls."""

from __future__ import annotations

from typing import Any

from ..simulation.drive_law import ERROR, call_law, drive_torques, flat_memory


def drives_along(
    numbers: Any, counts: Any, t: Any, q: Any, dq: Any, theta: Any, dtheta: Any, load: Any, friction: Any, on_arm: Any
) -> None:
    """Friction of the motor sides and torque on the arms beside T at every sample, memory of friction included.

    Args:
        numbers: Flat memory of drives, all of them rigid there: what they pass is `load`.
        counts: Its integers.
        t: Times [s], shape (m,).
        q: Arm sides, shape (m, n).
        dq: Their speeds.
        theta: Motor sides, shape (m, n).
        dtheta: Their speeds.
        load: Torque that each drive passes to its arm, shape (m, n).
        friction: Out, shape (m, n).
        on_arm: Out, shape (m, n).
    """
    memory = flat_memory(numbers, counts)
    table, stick_anchor, slip_anchor = memory.table, memory.stick_anchor, memory.slip_anchor
    transmitted, reaction = memory.transmitted, memory.reaction
    for k in range(len(t)):
        drive_torques(
            table,
            stick_anchor,
            slip_anchor,
            t[k],
            q[k],
            dq[k],
            theta[k],
            dtheta[k],
            load[k],
            transmitted,
            reaction,
            friction[k],
            on_arm[k],
            True,
        )


def errors_along(numbers: Any, counts: Any, t: Any, theta: Any, dtheta: Any, error: Any) -> None:
    """Transmission error e of every drive at every sample, into error (m, n) [rad or m]."""
    table = flat_memory(numbers, counts).table
    for k in range(len(t)):
        for i in range(theta.shape[1]):
            total = 0.0
            for j in range(table.first[i], table.first[i + 1]):
                if table.kinds[j] == ERROR:
                    total += call_law(
                        table.laws[j],
                        table.parameters[j],
                        t[k],
                        theta[k, i],
                        dtheta[k, i],
                        theta[k, i],
                        dtheta[k, i],
                        0.0,
                    )
            error[k, i] = total
