"""Writes what the documentation takes from the code: the regions between `<!-- generated: NAME -->` and `<!-- end -->`.

    python docs/generate.py

A test holds the pages against what this gives.
"""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import click

from mbexport.core.agreement.gates import GATES
from mbexport.core.agreement.quantities import STATICS
from mbexport.core.agreement.scenarios import SCENARIOS
from mbexport.core.build import build
from mbexport.core.cli import VERBS, program
from mbexport.core.database import FrozenMap, load
from mbexport.core.database.schema import CORRECTIONS, INERTIA, JOINTS, KINEMATICS, Choice
from mbexport.core.effects import Column, Effect, EffectRow, catalogue, effect_named
from mbexport.core.errors import RefusedError
from mbexport.core.export import emit
from mbexport.core.representation import Robot, VeitscheggerWu
from mbexport.core.simulation import Concept, backend_named, backend_names

DOCS = Path(__file__).resolve().parent
REGION = re.compile(r"(<!-- generated: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
BUILT_IN = "mbexport.core.effects."
BACKENDS = "mbexport.backends."
FIXED_TABLES = (KINEMATICS, CORRECTIONS, INERTIA, JOINTS)


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown; bars within cells are escaped."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines) + "\n"


def number(value: float) -> str:
    """A number as a person writes it."""
    return str(int(value)) if math.isfinite(value) and value == int(value) and abs(value) < 1e6 else repr(value)


def bounds(column: Column) -> str:
    """What may stand in a column, in words; empty where any number may."""
    words: list[str] = []
    if math.isfinite(column.minimum):
        words.append(f"{'above' if column.exclusive else 'at least'} {number(column.minimum)}")
    if math.isfinite(column.maximum):
        words.append(f"{'below' if column.exclusive else 'at most'} {number(column.maximum)}")
    if column.infinite:
        words.append("inf allowed")
    return ", ".join(words)


def column_line(column: Column | Choice) -> list[str]:
    """Name, unit, default and bounds of a column as cells."""
    if isinstance(column, Choice):
        return [f"`{column.name}`", "", column.default, ", ".join(column.words)]
    default = "required" if column.default is None else number(column.default)
    # in code, for the asterisks of units are no emphasis
    return [f"`{column.name}`", f"`{column.unit}`" if column.unit else "", default, bounds(column)]


def column_table(name: str, columns: Iterable[Column | Choice]) -> str:
    """The columns of a table, with what a reader must know beyond their bounds."""
    rows: list[list[str]] = []
    for column in columns:
        *cells, limits = column_line(column)
        note = NOTES.get((name, column.name), "")
        rows.append([*cells, "; ".join(text for text in (limits, note) if text)])
    return table(["column", "SI unit", "default", "what may stand there"], rows)


NOTES = {
    ("kinematics", "theta"): "the variable of a revolute joint adds to it",
    ("kinematics", "d"): "the variable of a prismatic joint adds to it",
    ("kinematics", "beta"): "misalignment about y; 0 is plain Denavit-Hartenberg",
    ("inertia", "mass"): "above 0; 0 with `inertia_check: warn`",
    ("inertia", "x"): "center of mass in the arm's own frame",
    ("inertia", "Ixx"): "about the center of mass, axes parallel to the arm's frame",
    ("inertia", "Ixy"): "sign: robot.yaml's `products_of_inertia`",
    ("joints", "home"): "the limits' middle where 0 is outside",
    ("backlash", "gap"): "the whole clearance",
    ("backlash", "stiffness"): "inf: joint_compliance's, else 500 Hz on the reduced inertia of both sides",
    ("backlash", "damping"): "inf: joint_compliance's, else a damping ratio of 0.15",
    ("link_inertia", "mx"): "mass times center of mass",
    ("link_inertia", "Ixx"): "about the frame's origin",
    ("payload", "x"): "center of mass in the last arm's frame",
    ("payload", "Ixx"): "about the center of mass",
    ("rotor_inertia", "inertia"): "already multiplied by the gear ratio squared",
    ("stribeck_friction", "torque"): "what break-away has above Coulomb",
    ("torque_ripple", "cycles"): "per turn of the joint; prismatic: per metre times 2 pi",
    ("transmission_error", "cycles"): "per turn of the joint; prismatic: per metre times 2 pi",
}


def tables() -> str:
    """The fixed tables of a database with their columns."""
    keys = {
        KINEMATICS: "Rows 1 to n, all of them.",
        CORRECTIONS: "Rows 1 to n; row 0 (optional) places joint 1 in the base, row n the flange, which is drawn only.",
        INERTIA: "Rows 1 to n, all of them.",
        JOINTS: "Rows 1 to n, all of them.",
    }
    parts: list[str] = []
    for fixed in FIXED_TABLES:
        parts.append(
            f"### {fixed.name}.dat\n\nKey: `{fixed.key}`. {keys[fixed]}\n\n{column_table(fixed.name, fixed.columns)}"
        )
    return "\n" + "\n".join(parts) + "\n"


def built_in_effects() -> list[Effect]:
    """The effects of this distribution, sorted; what others have installed is no part of the documentation."""
    effects = [effect_named(name) for name in catalogue()]
    return [effect for effect in effects if type(effect).__module__.startswith(BUILT_IN)]


def sentences(text: str | None) -> str:
    """A docstring as one paragraph."""
    return " ".join((text or "").split())


def effects() -> str:
    """The catalogue: a section an effect."""
    parts: list[str] = []
    for effect in built_in_effects():
        kind = type(effect)
        module = sys.modules[kind.__module__]
        _, _, summary = sentences(module.__doc__).partition(": ")
        part = [
            f"### {effect.name}",
            "",
            summary[:1].upper() + summary[1:],
            "",
            f"`effects/{effect.name}.dat`, key `{effect.key}`: {sentences(kind.__doc__)}",
            "",
        ]
        for law in effect.laws:
            source = sentences(law.function.__doc__)
            part += [f"Law `{law.name}`, {_MEANING[law.kind]}: {source}", ""]
        part.append(column_table(effect.name, effect.columns))
        parts.append("\n".join(part))
    return "\n" + "\n".join(parts) + "\n"


_MEANING = {
    "level": "a level of sticking friction",
    "resistance": "a torque against the motor side",
    "arm": "a torque on the arm",
    "error": "an angle that the arm follows",
    "error_slope": "that angle's slope",
}


def verbs() -> str:
    """Every verb with its options, as the program itself has them."""
    parts: list[str] = []
    with click.Context(program, info_name="mbexport", **program.context_settings) as context:
        for name in VERBS:
            command = program.get_command(context, name)
            if command is None:
                raise LookupError(name)
            with click.Context(command, parent=context, info_name=name) as inner:
                usage = " ".join(command.get_usage(inner).removeprefix("Usage: ").split())
                rows = [_option(parameter, inner) for parameter in command.get_params(inner)]
                example = re.sub("\b|Examples?:", "", command.epilog or "").strip("\n ")
            part = [f"### mbexport {name}", "", sentences(command.help), "", f"    {usage}", ""]
            part.append(table(["option", "what it does"], [row for row in rows if row]))
            part += ["```sh", *(line.strip() for line in example.splitlines()), "```", ""]
            parts.append("\n".join(part))
    return "\n" + "\n".join(parts) + "\n"


def _option(parameter: click.Parameter, context: click.Context) -> list[str]:
    if isinstance(parameter, click.Argument):
        default = f" (default: {parameter.default})" if isinstance(parameter.default, str) else ""
        return [f"`{parameter.make_metavar(context)}`", f"{_ARGUMENTS[parameter.name or '']}{default}"]
    record = parameter.get_help_record(context)
    return [] if record is None else [f"`{record[0]}`", record[1]]


_ARGUMENTS = {
    "robot": "A database: a folder, a YAML file, or the name of a built-in robot.",
    "file": "A URDF or MJCF file.",
    "what": "What to list; all of it where nothing is said.",
    "runs": "Recorded runs: a run's folder or data file each, or a folder of runs.",
    "folder": "A folder of robots and their runs.",
}


def backends() -> str:
    """The backends of this distribution and how they integrate."""
    rows: list[list[str]] = []
    for name in backend_names():
        backend = backend_named(name)
        if type(backend).__module__.startswith(BACKENDS) and backend.runs:
            rows.append(
                [
                    f"`{name}`",
                    backend.engine,
                    backend.integrator,
                    str(backend.order),
                    backend.gate_class,
                    number(1e3 * backend.largest_step),
                    number(backend.stable),
                ]
            )
    header = [
        "backend",
        "engine",
        "integrator",
        "order",
        "class",
        "longest step [ms]",
        "stable up to step x eigenvalue",
    ]
    return "\n" + table(header, rows) + "\n"


def gates() -> str:
    """The gates of agreement."""
    rows: list[list[str]] = []
    for gate in GATES.values():
        limits = [f"{value:.1e}" for value in (gate.explicit, gate.implicit, gate.first, gate.extrapolated)]
        if gate.first_step:
            limits[2] += f" at {number(1e3 * gate.first_step)} ms"
        if len({gate.explicit, gate.implicit, gate.first, gate.extrapolated}) == 1:
            limits = [limits[0], "same", "same", "same"]
        extra = f" + {gate.absolute:.0e} rad" if gate.absolute else ""
        unit = "relative" if gate.unit == "1" else gate.unit
        rows.append([f"`{gate.signal}`", unit + extra, *limits, gate.reached])
    header = ["signal", "unit", "explicit", "implicit", "first order", "extrapolated", "what was reached"]
    return "\n" + table(header, rows) + "\n"


# one robot with joints of both kinds, limits, corrections and a tool
BARE = "scara"
PLACED = VeitscheggerWu(theta=0.1, d=0.02)
STATUS = {"exact": "exact", "approximated": "*approximated*", "impossible": "**no**", "refused": "*refused*"}


def sample(column: Column) -> float:
    """A value that says something, within the column's bounds."""
    # a body stays a body with these
    if column.name in {"Ixy", "Ixz", "Iyz", "mx", "my", "mz"}:
        return 0.0
    if "N*m" in column.unit or "N/m" in column.unit:
        return 10.0 if "*s" in column.unit else 1.0e5
    default = column.default
    if default is not None and math.isfinite(default) and default not in {0.0, 1.0}:
        return default
    return min(max(0.5 if default == 1.0 else 0.01, column.minimum), column.maximum)


def rows_of(effect: Effect, n: int) -> tuple[EffectRow, ...]:
    """The effect at every place where it can be."""
    values = FrozenMap((column.name, sample(column)) for column in effect.columns)
    return tuple(EffectRow(at, values) for at in ((0,) if effect.key == "robot" else range(1, n + 1)))


def robots() -> dict[str, Robot]:
    """The bare robot, under "", and one with each effect, by its name."""
    bare = replace(load(BARE), effects=FrozenMap(), levels=FrozenMap(), motions=FrozenMap())
    # every arm long enough to bend
    links = tuple(replace(link, a=link.a or 0.1) for link in bare.kinematics)
    bare = replace(bare, kinematics=links, corrections=(PLACED,) * (bare.n + 1))
    made = {"": build(bare)}
    for effect in built_in_effects():
        made[effect.name] = build(replace(bare, effects=FrozenMap({effect.name: rows_of(effect, bare.n)})))
    return made


Fates = dict[str, dict[str, list[Concept]]]
"""Datum -> backend -> what became of it."""


def fates() -> tuple[Fates, dict[str, list[str]]]:
    """What becomes of every datum in every backend; and the data that an effect only changes, by the effect's name."""
    found: Fates = {}
    changed: dict[str, list[str]] = {}
    names = [name for name in backend_names() if type(backend_named(name)).__module__.startswith(BACKENDS)]
    made = robots()
    for effect, robot in made.items():
        for name in names:
            try:
                concepts = emit(robot, backend_named(name)).concepts
            except RefusedError as refusal:
                found.setdefault(effect, {})[name] = [Concept(effect, "robot", "impossible", f"refused: {refusal}")]
                continue
            known = {concept.datum for backends in found.values() for concept in backends.get(name, ())}
            for concept in concepts:
                if effect == "" or concept.datum not in known:
                    found.setdefault(concept.datum, {}).setdefault(name, []).append(concept)
        if effect and not any(datum.split(".")[0] == effect for datum in found):
            changed[effect] = _what_changed(made[""], robot)
    return found, changed


def _what_changed(bare: Robot, robot: Robot) -> list[str]:
    """Names of data of the neutral robot that differ."""
    stages = list(zip(bare.stages, robot.stages, strict=True))
    differs = {
        "base": bare.base != robot.base,
        "kinematics": any(a.arm.link != b.arm.link for a, b in stages),
        "inertia": any(a.arm.inertia != b.arm.inertia for a, b in stages),
        "further joints": any((a.mount, a.bend) != (b.mount, b.bend) for a, b in stages),
    }
    return [name for name, is_so in differs.items() if is_so]


def _worst(concepts: list[Concept]) -> str:
    order = ("exact", "approximated", "impossible")
    return max((concept.status for concept in concepts), key=order.index)


def concept_map() -> str:
    """What each format can say of every datum, at a glance and in words."""
    found, changed = fates()
    names = list(next(iter(found.values())))
    glance: list[list[str]] = []
    for datum, backends in found.items():
        glance.append([f"`{datum}`", *(STATUS[_worst(backends[n])] if n in backends else "" for n in names)])
    for effect, data in changed.items():
        glance.append([f"`{effect}`", *(f"in {' and '.join(data)}" if data else "" for _ in names)])
    parts = ["## At a glance\n", table(["datum", *(f"`{name}`" for name in names)], glance)]
    for name in names:
        rows: list[list[str]] = []
        for datum, backends in found.items():
            told: dict[tuple[str, str], list[str]] = {}
            for concept in backends.get(name, []):
                told.setdefault((concept.status, concept.how), []).append(concept.at)
            for (status, how), places in told.items():
                at = "" if len(told) == 1 else f" ({', '.join(places)})"
                rows.append([f"`{datum}`{at}", STATUS[status], how])
        parts += [f"## {name} ({backend_named(name).engine})\n", table(["datum", "", "where, or how"], rows)]
    return "\n" + "\n".join(parts) + "\n"


def quantities() -> str:
    """Names that `--only` knows."""
    return "\n" + ", ".join(f"`{name}`" for name in (*STATICS, *SCENARIOS, "convergence")) + ".\n\n"


def limits() -> str:
    """The bounds of what is read, with the numbers that the code has."""
    from mbexport.core import data_file
    from mbexport.core.control import unit_file
    from mbexport.core.database import problems, settings, sources, yaml_tree
    from mbexport.core.database import table as tables_of
    from mbexport.core.importing import mjcf_settings, xml_file
    from mbexport.core.study.design import MOST_VARIANTS

    def size(count: int) -> str:
        scale, unit = next(
            (s, u) for s, u in ((2**30, "GiB"), (2**20, "MiB"), (2**10, "KiB"), (1, "bytes")) if count >= s
        )
        return f"{number(count / scale)} {unit}"

    rows = [
        ["a table of a database", f"{size(tables_of.LARGEST_FILE)}, {tables_of.MOST_ROWS} rows, "
         f"{tables_of.MOST_COLUMNS} columns"],
        ["a YAML file (database, log, controller)", f"{size(yaml_tree.LARGEST_YAML)}, {yaml_tree.MOST_NODES} values "
         f"once its anchors are unfolded, {yaml_tree.DEEPEST} levels deep"],
        ["files of a database in one folder", f"{sources.MOST_FILES}"],
        ["a text in a database", f"{settings.LONGEST_TEXT} characters, none of them for controlling a terminal"],
        ["a mesh", size(settings.LARGEST_MESH)],
        ["faults that one file is told", f"{problems.MOST}"],
        ["a URDF or MJCF file", f"{size(xml_file.LARGEST_FILE)}, {xml_file.MOST_ELEMENTS} elements (includes counted), "
         f"{xml_file.DEEPEST} levels deep, {mjcf_settings.INCLUDES} includes"],
        ["a run's data, CSV or Parquet", f"{size(data_file.LARGEST_DATA)}, {data_file.MOST_SAMPLES} rows, "
         f"{data_file.MOST_CELLS} numbers, lines of {size(data_file.LONGEST_LINE)}"],
        ["a controller's FMU", f"{size(unit_file.LARGEST_ARCHIVE)} unpacked, its description "
         f"{size(unit_file.LARGEST_DESCRIPTION)}"],
        ["variants of a study", f"{MOST_VARIANTS}"],
    ]  # fmt: skip
    return "\n" + table(["what", "at most"], rows) + "\n"


STUDY = DOCS / "pictures" / "study.json"


def study() -> str:
    """What a finished study found, a row a parameter: shares of the error's variance, or its mean changes."""
    kept = json.loads(STUDY.read_text(encoding="utf-8"))
    found = {one["figure"]: one["values"] for one in kept["sensitivity"]}
    names = {"tip_rms": "root mean square", "tip_max": "maximum", "tip_end": "at the end"}
    shares = "total" in found["tip_rms"]
    rows: list[list[str]] = []
    for k, parameter in enumerate(kept["sensitivity"][0]["parameters"]):
        cells = [f"`{parameter}`"]
        for name in names:
            values = {index: float(value[k]) for index, value in found[name].items()}
            if shares:
                cells.append(f"{values['total']:.3f} +- {values['total_ci']:.3f} ({values['first']:.3f})")
            else:
                changes = (f"{1e3 * values[index]:.4f}" for index in ("mean_effect", "spread_effect"))
                cells.append(" +- ".join(changes))
        rows.append(cells)
    stands = (f"{1e3 * kept['nominal'][name]:.4f}" for name in names)
    rows.append(["the error as the database stands [mm]", *stands])
    meaning = (
        "total share of the error's variance with half its 95 % interval, in brackets the share that it explains alone"
        if shares
        else "mean change of the error over the parameter's whole range, and its spread over the trajectories [mm]"
    )
    facts = kept["facts"]
    said = f"{facts['variants']} variants of {facts['duration']} s in {kept['engine']}, {kept['failed']} failed:"
    return f"\n{said}\n{meaning}.\n\n" + table(["tip's error", *names.values()], rows) + "\n"


REGIONS: dict[str, Callable[[], str]] = {
    "tables": tables,
    "effects": effects,
    "verbs": verbs,
    "backends": backends,
    "gates": gates,
    "quantities": quantities,
    "concepts": concept_map,
    "study": study,
    "limits": limits,
}


def filled(text: str) -> str:
    """A page's text with its generated regions written anew."""
    return REGION.sub(lambda match: match[1] + REGIONS[match[2]]() + match[3], text)


def main() -> None:
    """Write every page that has generated regions."""
    for page in sorted(DOCS.glob("*.md")):
        text = page.read_text(encoding="utf-8")
        page.write_text(filled(text), encoding="utf-8")


if __name__ == "__main__":
    main()
