"""What the paper says, statement by statement, and what ours says to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from .case import TICK
from .closed_loop import NEGLIGIBLE_DUMMY, OTHER_DUMMY
from .modes import Mode

if TYPE_CHECKING:
    from .reproduction import Reproduction

Verdict = Literal["input", "reproduced", "not reproduced", "differs", "cannot be compared"]
"""input: the paper's numbers that all of this starts from."""

# of the choices along the first key
OPEN_LOOP, AS_RUN = 0, 1
# tips that are this near each other are one for whoever reads a figure [m]
EQUAL = 1.0e-4


@dataclass(frozen=True, slots=True)
class Statement:
    """One statement of the paper beside ours.

    Attributes:
        where: Section, equation, table or figure.
        says: What the paper says, in short.
        ours: What ours says, with its numbers.
        verdict: How they compare.
    """

    where: str
    says: str
    ours: str
    verdict: Verdict

    def to_json(self) -> dict[str, str]:
        """As plain data."""
        return {"where": self.where, "says": self.says, "ours": self.ours, "verdict": self.verdict}


def statements(study: Reproduction) -> tuple[Statement, ...]:
    """All of them, in the paper's order."""
    return (
        *_geometry(study),
        *_models(study),
        _desired(study),
        *_compliant(study),
        *_derived(study),
        *_controlled(study),
        Statement(
            "section 8",
            "the closed loop is macroscopically similar to the real robot; experiments are in progress",
            "the paper shows no measurement, so that there is nothing to hold ours against",
            "cannot be compared",
        ),
    )


def _met(holds: bool) -> Verdict:
    return "reproduced" if holds else "not reproduced"


def length(metres: float) -> str:
    """A length for people."""
    size = abs(metres)
    if size < 1.0e-9:
        return f"{metres:.1e} m"
    unit, factor = ("um", 1.0e6) if size < 1.0e-4 else ("mm", 1.0e3) if size < 1.0 else ("m", 1.0)
    return f"{metres * factor:.3g} {unit}"


def _geometry(study: Reproduction) -> list[Statement]:
    frames, beta = study.frames, study.misalignment
    elbow, wrist = frames.chain[3, :3, 3], frames.real[3, :3, 3]
    degree = np.linalg.norm(beta.per_degree, axis=2)
    worst = int(np.argmax(np.max(degree, axis=1)))
    largest = ", ".join(f"{1e3 * value:.2f}" for value in np.max(degree, axis=1))
    moved = [f"joint {k + 1} by {1e3 * shift:.0f} mm" for k, shift in enumerate(frames.shifts) if shift > 0.0]
    return [
        Statement(
            "tables 1 to 6",
            "the arm's parameters, corrections, masses, inertias, stiffnesses and dampings",
            "the built-in database imece2013 holds every cell as printed; a test compares them",
            "input",
        ),
        Statement(
            "section 2, equations 1 to 3",
            "for beta = 0 Veitschegger-Wu becomes Denavit-Hartenberg",
            f"no element of the six transforms is further than {frames.equation_1:.0e} from equation 1 written out",
            _met(frames.equation_1 < 1e-14),
        ),
        Statement(
            "section 2",
            "beta models an axis that is misaligned in assembly or by wear; no numbers",
            f"1 deg in arms 1 to 6 moves the tip by up to {largest} mm along the path: most in arm {worst + 1}, not at "
            "all in arm 6, whose origin is the tip",
            "cannot be compared",
        ),
        Statement(
            "figures 3 and 4",
            "the fourth frame, the wrist's first, stands on the common normal of joints 3 and 4, and with corrections "
            "in "
            "the wrist's real place",
            f"it stands at x = {elbow[0]:.3f} m, on joint 3's axis, and with corrections at x = {wrist[0]:.3f} m; the "
            f"corrections move {', '.join(moved)}",
            _met(bool(np.linalg.norm(elbow - frames.chain[2, :3, 3]) < 1e-12 and wrist[0] - elbow[0] > 0.4)),
        ),
        Statement(
            "section 3",
            "the correct geometry is crucial for dynamics, so as to analyse effects such as flexible joints",
            "not for joints that give about their own axes, as the paper's do: a correction slides a joint along its "
            f"axis, and mass matrix and gravity stay the same to {frames.same_motion:.0e}. For bearings that tilt, "
            f"yes: "
            f"tilting as easily as table 6's joints turn, the tip sags by {1e3 * frames.bearing_sag:.2f} mm and the "
            f"corrections are {1e3 * frames.bearings:.2f} mm of it",
            "differs",
        ),
    ]


def _models(study: Reproduction) -> list[Statement]:
    opened, case = study.open_loop, study.case
    slow = min(opened.predicted, key=lambda mode: mode.frequency, default=None)
    seen = "; ".join(f"{m.frequency:.2f} Hz with damping ratio {m.damping_ratio:.3f}" for m in opened.measured)
    return [
        Statement(
            "section 5",
            "the dummy part's mass and inertia are negligible",
            "imposed motion does not depend on it at all. Under torque it must have one: ours is "
            f"{case.database.dummy_inertia!r} of the arm's own, because a controller of 1 kHz cannot hold a "
            f"negligible one (at "
            f"{NEGLIGIBLE_DUMMY!r} the loop grows {study.closed_loop.negligible:.1f} times a tick); at "
            f"{OTHER_DUMMY!r} the tip's "
            f"oscillation is {_times(study, 'dummy', AS_RUN)} as large",
            "differs",
        ),
        Statement(
            "table 6",
            "the damping constants give an adequate level of damping; no numbers",
            f"the arm at rest after the motion rings at {seen or 'nothing that lasts'}"
            + (" (eigenvalues agree)" if slow and opened.measured else ""),
            "cannot be compared",
        ),
    ]


def _times(study: Reproduction, word: str, than: int) -> str:
    """How many times another choice's oscillation is that of one of the choices along the first key."""
    choices = study.closed_loop.choices
    chosen = next(choice for choice in choices if choice.what.startswith(word))
    return f"{chosen.oscillation / choices[than].oscillation:.2f} times"


def _desired(study: Reproduction) -> Statement:
    path = study.path
    worst = max(path.engines.values())
    return Statement(
        "figure 11",
        "the desired trajectory Greca, with rigid joints and imposed motion; no numbers",
        f"{len(path.corners) - 1} straight edges in {path.corners[-1]:.2f} s; the path is within "
        f"{length(path.crooked)} of "
        f"its straight lines, and every engine within {length(worst)} of the path",
        "cannot be compared",
    )


def _compliant(study: Reproduction) -> list[Statement]:
    opened = study.open_loop
    data = opened.to_json()
    shift, sag = data["shift_z_m"], data["static_sag_z_m"]
    level, apart, high = data["in_plane_m"], data["engines_apart_m"], data["engines_of_high_order_apart_m"]
    corner = study.path.places[opened.corner]
    return [
        Statement(
            "figure 12, above",
            "elastic joints shift the path along z, as expected; no numbers",
            f"by {1e3 * shift['mean']:.2f} mm in the mean ({1e3 * shift['least']:.2f} to {1e3 * shift['most']:.2f}); "
            f"at rest "
            f"in every point K^-1 g would give {1e3 * sag['mean']:.2f} mm",
            _met(shift["most"] < 0.0 and abs(shift["mean"] / sag["mean"] - 1.0) < 0.2),
        ),
        Statement(
            "figure 12, below",
            "the paths differ in the x-y plane, most at a corner; no numbers",
            f"by {1e3 * level['rms']:.2f} mm rms, {1e3 * level['largest']:.2f} at most; the path's shape suffers most "
            f"about the corner at "
            f"({corner[0]:.3f}, {corner[1]:.3f}) m",
            _met(level["largest"] > EQUAL),
        ),
        Statement(
            "section 8, conclusions",
            "both codes give an equal estimate of the compliance",
            f"{len(opened.tips)} engines are at most {length(apart['largest'])} apart ({apart['between']}), those of "
            f"high "
            f"order {length(high['largest'])}"
            if len(opened.tips) > 1
            else "one engine ran alone",
            _met(apart["largest"] < EQUAL) if len(opened.tips) > 1 else "cannot be compared",
        ),
    ]


def _derived(study: Reproduction) -> list[Statement]:
    found = study.derivatives
    data = found.to_json()
    codes = data["two_codes_m"]
    operators = {operator.name: operator for operator in found.operators}
    akima = operators["akima"]
    same = [operator.engines for operator in found.operators if operator.engines is not None]
    high = study.open_loop.to_json()["engines_of_high_order_apart_m"]["largest"]
    return [
        Statement(
            "section 8",
            "the codes' small differences come from different derivative operators",
            f"rotations alone at the knots: a code that differentiates Akima's spline and one that takes differences "
            f"over "
            f"1 ms are {length(codes['largest'])} apart at most, at the start, "
            f"{length(codes['largest_after_the_start'])} later "
            f"({length(codes['rms'])} rms)"
            + (f"; two engines with one and the same law {length(max(same))}" if same else ""),
            _met(codes["largest"] > 100.0 * max([*same, 1e-12])),
        ),
        Statement(
            "section 8",
            "it is recommended to give rotation, speed and acceleration",
            f"so every run here has them; engines of high order are then {length(high)} apart. Akima's spline alone "
            f"leaves "
            f"the law by {akima.speed:.3f} rad/s and {akima.acceleration:.1f} rad/s^2: {length(akima.tip)} at the "
            f"tip, and "
            f"{akima.torque:.0f} N m of up to {found.largest_torque:.0f} in the torques of rigid joints",
            _met(high < codes["largest"]),
        ),
    ]


def _controlled(study: Reproduction) -> list[Statement]:
    closed, opened = study.closed_loop, study.open_loop
    data, open_data = closed.to_json(), opened.to_json()
    ratio = data["oscillation_m"] / open_data["oscillation_m"]
    agreement = closed.agreement_on_peaks()
    height = max((row["height_m"] for row in agreement.values() if row["height_m"] is not None), default=0.0)
    late = max((row["time_s"] for row in agreement.values() if row["time_s"] is not None), default=0.0)
    paired = min((row["peaks"] for row in agreement.values()), default=0)
    memory = [item.to_json() for item in closed.memory.values()]
    first = memory[0]
    spread = max(item["path_earlier_s"] for item in memory) - min(item["path_earlier_s"] for item in memory)
    peaks = first["peaks_earlier_s"]
    slow = [_slowest(modes) for modes in closed.predicted]
    torque = data["delay_on_torque"]["peaks_earlier_s"]
    return [
        Statement(
            "figure 13",
            "the control increases the oscillations of the trajectory; no numbers, no gains",
            f"{1e3 * data['oscillation_m']:.2f} mm rms about where the arm would rest, against "
            f"{1e3 * open_data['oscillation_m']:.2f} in the open loop: {ratio:.2f} times, what the motors lag behind "
            f"counted "
            "in. With other gains along the first key "
            + ", ".join(f"{_times(study, f'gains of {hz}', OPEN_LOOP)} ({hz})" for hz in ("5.0 Hz", "20.0 Hz"))
            + ": how much is a matter of the gains, which the paper does not give",
            _met(ratio > 1.0),
        ),
        Statement(
            "figure 13",
            "both models are in full agreement about the oscillation's peaks",
            f"{paired} of {data['peaks']['number']} peaks across the edges, up to "
            f"{1e3 * (data['peaks']['highest_m'] or 0.0):.2f} mm high: engines differ by {length(height)} and "
            f"{1e3 * late:.2g} ms at most"
            if agreement
            else "one engine ran alone",
            _met(bool(paired == data["peaks"]["number"] and height < EQUAL)) if agreement else "cannot be compared",
        ),
        Statement(
            "figure 13",
            'the model with the "Memory" block slightly anticipates the oscillations',
            f"feedback that is one step of {1e3 * TICK!r} ms old makes the whole path "
            f"{1e3 * first['path_earlier_s']:.3f} ms "
            f"earlier"
            + (f" (engines within {1e3 * spread:.1e} ms)" if len(memory) > 1 else "")
            + (
                f" and the peaks {1e3 * peaks['mean']:.2f} ms in the mean, {100 * peaks['share_earlier']:.0f} % of them"
                if peaks["mean"] is not None
                else ""
            )
            + ": the controller takes the arm for one step behind and drives it ahead"
            + (f"; the slowest lightly damped oscillation goes from {slow[0]} to {slow[1]}" if all(slow) else "")
            + (
                f". On the torque, the same delay leaves the path where it is ({_late_path(data)} ms), its peaks "
                f"earlier by {1e3 * torque['mean']:.2f} ms"
                if torque["mean"] is not None
                else ""
            ),
            _met(first["path_earlier_s"] > 0.0),
        ),
    ]


def _late_path(data: dict[str, dict[str, float]]) -> str:
    return f"{1e3 * data['delay_on_torque']['path_earlier_s']:+.3f}"


def _slowest(modes: Sequence[Mode]) -> str:
    if not modes:
        return ""
    mode = min(modes, key=lambda one: one.frequency)
    return f"{mode.frequency:.3f} Hz (damping ratio {mode.damping_ratio:.3f})"
