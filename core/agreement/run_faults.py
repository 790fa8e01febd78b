"""What differences of runs look like: shifts in time, steps, and orders of convergence."""

from __future__ import annotations

import numpy as np

from .compare import Order
from .look import Look, brief
from .runs import Run
from .scenarios import Scenario

# a shift must explain this part of the energy of the difference
_SHIFTED = 0.9


def run_look(scenario: Scenario, odd: Run, trusted: Run) -> Look:
    """What the run of an odd voice looks like beside a trusted one."""
    if not np.isfinite(odd.tip).all():
        k = int(np.argmin(np.isfinite(odd.tip).all(axis=1)))
        return Look("unknown", "robot", f"its motion is no longer finite at t = {brief(float(odd.t[k]))} s")
    late = time_shift(odd, trusted)
    if late is not None:
        return Look("time shift", "robot", shift_text(late, scenario, odd.step))
    distance = np.linalg.norm(odd.tip - trusted.tip, axis=1)
    k = int(distance.argmax())
    moved = np.max(np.abs(odd.q_link - trusted.q_link), axis=0)
    i = int(moved.argmax())
    growth = "grows with time" if k > 0.9 * len(distance) else "comes and goes"
    text = (
        f"its tool is off by up to {brief(float(distance[k]))} m at t = {brief(float(odd.t[k]))} s, most of it at "
        f"joint_{i + 1}; the difference {growth} and is no shift in time"
    )
    return Look("unknown", f"joint_{i + 1}", text)


def time_shift(odd: Run, trusted: Run) -> float | None:
    """By how much the odd run is late [s] (early: negative), where that explains the difference."""
    for seen, expected in ((odd.theta, trusted.theta), (odd.q_link, trusted.q_link)):
        # the mean of both stands in the middle of the shift, where its first order is all there is of it
        speed = np.gradient(0.5 * (seen + expected), trusted.t, axis=0)
        weight = 1.0 / np.maximum(np.max(np.abs(speed), axis=0), 1e-300)
        difference, by = ((seen - expected) * weight).ravel(), (speed * weight).ravel()
        energy = float(difference @ difference)
        if energy <= 1e-24 * float(by @ by) or not np.isfinite(energy):
            continue
        late = -float(by @ difference) / float(by @ by)
        left = difference + late * by
        if float(left @ left) < (1.0 - _SHIFTED) * energy:
            return late
    return None


def shift_text(late: float, scenario: Scenario, step: float) -> str:
    """A shift in words, with the step that it equals."""
    sense = "late" if late > 0 else "early"
    size = abs(late)
    told = f"the reference comes {brief(float(f'{size:.3g}'))} s {sense}"
    periods = [("an integration step", "integration steps", step)]
    if not scenario.imposed:
        periods.insert(0, ("a tick of the controller", "ticks of the controller", 1.0 / scenario.control.rate))
    for one, many, period in periods:
        for count, words in ((1.0, one.replace("an ", "one ").replace("a ", "one ")), (2.0, f"two {many}")):
            if abs(size / period - count) < 0.1 * count:
                return f"{told}: {words}"
        if abs(size / period - 0.5) < 0.05:
            return f"{told}: half {one}"
    return told


def order_look(order: Order) -> Look:
    """What a wrong order of convergence looks like."""
    text = (
        f"its error at the tool goes from {brief(order.errors[0])} to {brief(order.errors[1])} m as the step goes from "
        f"{brief(order.steps[0])} to {brief(order.steps[1])} s: order {brief(round(order.order, 2))} instead of 1"
    )
    meaning = "it converges to another robot" if order.order < 1.0 else "it is not the integrator it says it is"
    return Look("order", "robot", f"{text}; {meaning}")
