"""Adopts the models of `adopted_models`, and tabulates the verdicts.

    cd tests && python -m benchmarks.user_models ../docs/guide/data/user-models.json [NAME ...]

keeps the rows that the file has, as `aircraft.adopt.fleet` does. About ten seconds of processor time each.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path
from typing import Any

from adopted_models import MODELS

from aircraft.adopt.fleet import row, table


def main(path: Path, names: list[str]) -> None:
    """Adopt what is not in the file yet; print the table."""
    rows: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    for name in names or MODELS:
        if name in rows:
            continue
        with tempfile.TemporaryDirectory() as folder:
            model = MODELS[name](Path(folder) / name)
            rows[name] = row(str(model))
        path.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    print(table({name: rows[name] for name in MODELS if name in rows}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
