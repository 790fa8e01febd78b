"""mbexport import: a database from a URDF or an MJCF model."""

from __future__ import annotations

from pathlib import Path

import click

from .common import force_option, json_option, print_json


@click.command("import", epilog="\b\nExample:\n  mbexport import panda.urdf -o panda --tip panda_link8")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="Folder, or a .yaml file.")
@click.option("--tip", metavar="LINK", help="Last link of the chain, where the tree branches.")
@click.option("--repair", is_flag=True, help="Replace inertias that no body can have by the nearest that can.")
@force_option
@json_option
def command(file: Path, output: Path, tip: str | None, repair: bool, force: bool, as_json: bool) -> None:
    """Make a database from a serial chain of a URDF or an MJCF model."""
    from ..database import write
    from ..importing import import_model

    imported = import_model(file, tip=tip, repair=repair)
    form = "yaml" if output.suffix in (".yaml", ".yml") else "folder"
    write(imported.database, output, form=form, force=force)
    if as_json:
        print_json({"robot": imported.database.name, "output": str(output), "remarks": list(imported.remarks)})
        return
    click.echo(f"{imported.database.name}: {len(imported.database.joints)} joints, written to {output}")
    for remark in imported.remarks:
        click.echo(f"  {remark}")
