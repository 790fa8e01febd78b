"""Agreement of every built-in robot at every level: the worst figure of each signal beside its gate.

    python benchmarks/agreement.py [ROBOT ...]

A figure's gate depends on who is compared (class A, class B, extrapolated) and on the robot's size; the worst is the
one that takes most of its gate. Exit status 1 where anything is beyond.
"""

from __future__ import annotations

import sys
import time

import mbexport
from mbexport.core.agreement import Agreement, Figure
from mbexport.core.agreement.quantities import STATICS
from mbexport.core.agreement.scenarios import SCENARIOS
from mbexport.core.database import built_in


def levels(robot: str) -> tuple[str, ...]:
    """Names of a robot's levels, full and rigid among them."""
    return ("full", "rigid", *sorted(mbexport.load(robot).levels))


def tell(agreement: Agreement) -> None:
    """A line a signal: the pair that takes most of its gate."""
    print(f"  {len(agreement.figures)} comparisons of {', '.join(voice.name for voice in agreement.voices)}")
    for left in agreement.left_out:
        print(f"  left out: {left.voice} in {left.scenario}: {left.reason}")
    worst: dict[tuple[str, str, str], Figure] = {}
    for figure in agreement.figures:
        key = (figure.scenario, figure.signal, figure.manner)
        if key not in worst or figure.value / figure.gate > worst[key].value / worst[key].gate:
            worst[key] = figure
    for (scenario, signal, manner), figure in sorted(worst.items()):
        state = "" if figure.passed else "  BEYOND"
        share = f"{figure.value:>9.1e} of {figure.gate:>8.1e}"
        print(f"    {scenario:<18} {signal:<18} {manner:<14} {share}  {' - '.join(figure.voices)}{state}")
    for order in agreement.orders:
        judged = "" if order.judged else " (too near its floor to judge)"
        print(f"    {order.scenario:<18} order of {order.voice:<8} {order.order:.3f}{judged}")


def main() -> None:
    """Print everything; exit with 1 where an engine disagrees."""
    agreed = True
    for robot in sys.argv[1:] or built_in():
        for level in levels(robot):
            began = time.perf_counter()
            agreement = mbexport.agree(robot, level=level, quantities=(*STATICS, *SCENARIOS))
            print(f"{robot} at level {level}: {'agrees' if agreement.agreed else 'DISAGREES'}")
            tell(agreement)
            for sentence in agreement.sentences:
                print(f"  {sentence}")
            print(f"  {time.perf_counter() - began:.0f} s", flush=True)
            agreed = agreed and agreement.agreed
    sys.exit(not agreed)


if __name__ == "__main__":
    main()
