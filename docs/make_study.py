"""Takes the picture and the numbers of docs/studies.md from a finished study, as `mbexport sweep` left it.

    examples/studies/compliance.sh STUDY && python docs/make_study.py STUDY && python docs/generate.py

The page's table is then made of the numbers that this keeps.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

PICTURES = Path(__file__).resolve().parent / "pictures"
PICTURE, NUMBERS = PICTURES / "study.png", PICTURES / "study.json"


def main(folder: str) -> None:
    """Keep what the page shows of a study."""
    study = Path(folder)
    facts = json.loads((study / "study.json").read_text(encoding="utf-8"))
    found = json.loads((study / "sensitivity.json").read_text(encoding="utf-8"))
    kept = {
        "facts": {name: facts[name] for name in ("study", "robot", "sampling", "seed", "variants", "duration")},
        "engine": f"{facts['engine']} {facts['engine_version']}",
        "nominal": {
            name: value for name, value in found["nominal"].items() if name in ("tip_rms", "tip_max", "tip_end")
        },
        "sensitivity": found["sensitivity"],
        "failed": found["failed"],
    }
    NUMBERS.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    PICTURE.write_bytes((study / "study.png").read_bytes())


if __name__ == "__main__":
    main(*sys.argv[1:])
