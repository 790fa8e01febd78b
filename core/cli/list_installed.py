"""mbexport list: what is installed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from .. import plugins
from ..errors import PluginError
from .common import json_option, print_json

if TYPE_CHECKING:
    from ..effects import Effect

KINDS = ("backends", "effects", "robots")
# what numbers and letters mean, for people
_SAID = {"order": "order {}", "gate_class": "gates {}", "key": "by {}", "joints": "{} joints", "levels": "levels {}"}
_UNSAID = ("name", "runs")


@click.command("list", epilog="\b\nExample:\n  mbexport list backends")
@click.argument("what", type=click.Choice(KINDS), required=False)
@json_option
def command(what: str | None, as_json: bool) -> None:
    """Backends, effects and robots; a broken plugin is listed with its reason and breaks nothing else."""
    tables = {kind: _TABLES[kind]() for kind in (KINDS if what is None else (what,))}
    if as_json:
        print_json(tables)
        return
    for kind, rows in tables.items():
        click.echo(f"{kind}:")
        for row in rows:
            facts = (_SAID.get(key, "{}").format(value) for key, value in row.items() if key not in _UNSAID and value)
            click.echo(f"  {row['name']:<20} {'; '.join(facts)}")


def _backends() -> list[dict[str, Any]]:
    from ..simulation.backends import backend_named

    rows: list[dict[str, Any]] = []
    for report in plugins.report(plugins.BACKENDS):
        row: dict[str, Any] = {"name": report.name, "distribution": report.distribution}
        if report.problem is not None:
            rows.append({**row, "problem": report.problem})
            continue
        try:
            backend = backend_named(report.name)
            row |= {
                "does": "emits and runs" if backend.runs else "emits only",
                "runs": backend.runs,
                "engine": backend.engine,
                "version": backend.version(),
                "integrator": backend.integrator,
                "order": backend.order,
                "gate_class": backend.gate_class,
            }
        except PluginError as error:
            row["problem"] = str(error)
        except Exception as error:
            # a stranger's code; most of all the engine's metadata where the engine is not installed
            row["problem"] = f"its version cannot be asked: {type(error).__name__}: {error}"
        rows.append(row)
    return rows


def _effects() -> list[dict[str, Any]]:
    from ..effects import built_in_names, effect_named, effect_reports

    reports = effect_reports()
    rows = [_effect_row(name, effect_named(name)) for name in built_in_names()]
    for report in reports:
        row = {"name": report.name, "distribution": report.distribution}
        if report.problem is not None:
            rows.append({**row, "problem": report.problem})
        else:
            rows.append({**_effect_row(report.name, effect_named(report.name)), **row})
    return sorted(rows, key=lambda row: row["name"])


def _effect_row(name: str, effect: Effect) -> dict[str, Any]:
    columns = ", ".join(
        f"{column.name}[{column.unit or '1'}]" + ("" if column.default is None else f"({column.default!r})")
        for column in effect.columns
    )
    law = ((type(effect).__doc__ or "").strip().splitlines() or [""])[0]
    realised = "common law, compiled" if effect.laws else "in the model"
    return {"name": name, "key": effect.key, "columns": columns, "law": law, "realised": realised}


def _robots() -> list[dict[str, Any]]:
    from ..database import built_in, load

    rows: list[dict[str, Any]] = []
    for name in built_in():
        database = load(name)
        levels = ", ".join(sorted({"full", "rigid", *database.levels}))
        rows.append({"name": name, "joints": database.n, "levels": levels, "source": database.source})
    return rows


_TABLES = {"backends": _backends, "effects": _effects, "robots": _robots}
