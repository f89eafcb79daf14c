"""Writes encounters as a folder of scenario files, with the tracks that they name beside them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import tomli_w

from testbed.encounters.encounter import Encounter
from testbed.encounters.scenarios import Choices, made
from testbed.records.store import staged, write_json

_ROW = "{:.6f},{:.6f},{:.6f},{:.6f}".format


def write(
    found: Sequence[Encounter], choices: Choices, out: Path, command: str, overwrite: bool = False
) -> list[str]:
    """Write `out`: NAME.toml per encounter, tracks/NAME-2.csv per track, encounters.json.

    command  how the folder was made
    Returns the names of the scenario files. Each was checked as `testbed run` checks it.
    Raises   UserError
    """
    files = []
    with staged(out, overwrite) as folder:
        (folder / "tracks").mkdir()
        for e in found:
            one = made(e, choices)
            one.scenario()
            for name, rows in one.tracks.items():
                lines = ["t_s,x_m,y_m,z_m", *(_ROW(*row) for row in rows.tolist())]
                (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
            files.append(f"{e.name}.toml")
            (folder / files[-1]).write_text(tomli_w.dumps(one.data), encoding="utf-8")
        if not any((folder / "tracks").iterdir()):
            (folder / "tracks").rmdir()
        listed = [
            {
                "file": file,
                "source": e.source,
                "aircraft": [a.name for a in e.aircraft],
                "notes": list(e.notes),
            }
            for file, e in zip(files, found, strict=True)
        ]
        write_json(
            folder / "encounters.json", {"command": command, "choices": vars(choices), "encounters": listed}
        )
    return files
