"""`testbed encounters`: scenario files of recorded encounters, and of encounters that it generates."""

from __future__ import annotations

import json
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from testbed.cli.common import JsonOption, OverwriteOption

if TYPE_CHECKING:
    from testbed.encounters.encounter import Encounter
    from testbed.encounters.scenarios import Choices

app = typer.Typer(no_args_is_help=True, help="Scenario files of recorded and of generated encounters.")

OutOption = Annotated[Path, typer.Option("--out", metavar="DIR", help="folder to write")]
OthersOption = Annotated[
    str,
    typer.Option(
        "--others",
        help="what the other aircraft do: track (intruders on their track, legs or course), keep-course"
        " (intruders that keep course, speed and climb rate), filter (they fly under the filter too)",
    ),
]


@app.command(
    "import",
    short_help="Read encounters of other programs.",
    epilog="Examples: testbed encounters import head-on.daa --format daa --out runs/head-on;"
    " testbed encounters import tracks/ --format table --others keep-course --out runs/tracks",
)
def import_(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="files, or folders of files")],
    format_: Annotated[
        str,
        typer.Option(
            "--format",
            help="daa (NASA DAIDALUS), scn (BlueSky), table (trajectories east, north, altitude, ...), csv",
        ),
    ],
    out: OutOption,
    others: OthersOption = "track",
    own: Annotated[
        str,
        typer.Option("--own", help="what the own (first) aircraft wants: track, or goal, its track's end"),
    ] = "track",
    speed: Annotated[
        float, typer.Option("--speed", help="m/s that the own aircraft's speed is scaled to")
    ] = 20.0,
    as_recorded: Annotated[
        bool,
        typer.Option("--as-recorded", help="keep speeds and lengths; scale limits, manoeuvre and Ds to them"),
    ] = False,
    duration: Annotated[
        float | None, typer.Option("--duration", help="s of the encounter to fly, before it is scaled")
    ] = None,
    skip_unknown: Annotated[
        bool, typer.Option("--skip-unknown", help="scn: leave out commands that are not read, and name them")
    ] = False,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Write a scenario file for each encounter in files of NASA DAIDALUS, BlueSky, trajectory tables or CSV.

    The first aircraft is the own vehicle, under the filter. Units are read from the file and checked: they
    have to be of the right kind, and positions have to move as the recorded speeds say.
    """
    from testbed.encounters.importing import read
    from testbed.encounters.scenarios import Choices

    choices = Choices(others, own, None if as_recorded else speed, duration)
    found = read(files, format_, skip_unknown)
    said = f"testbed encounters import {' '.join(shlex.quote(f.name) for f in files)} --format {format_}"
    _write(found, choices, out, said, overwrite, as_json)


@app.command(
    short_help="Generate encounters from a seed.",
    epilog="Examples: testbed encounters generate crossing --seed 1 --count 20 --out runs/crossing;"
    " testbed encounters generate random --vehicles 20 --density 5 --seed 1 --out runs/traffic",
)
def generate(
    kind: Annotated[
        str,
        typer.Argument(
            metavar="KIND", help="head-on, crossing, overtaking, converging, circle, wall or random"
        ),
    ],
    out: OutOption,
    seed: Annotated[int, typer.Option("--seed", help="of everything drawn")] = 1,
    count: Annotated[int, typer.Option("--count", help="how many encounters")] = 1,
    vehicles: Annotated[int, typer.Option("--vehicles", help="of circle, wall and random")] = 8,
    density: Annotated[
        float, typer.Option("--density", help="of random: vehicles per square kilometre")
    ] = 10.0,
    miss: Annotated[
        float, typer.Option("--miss", help="m, largest miss distance of two that meet, if nobody evades")
    ] = 20.0,
    others: OthersOption = "filter",
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Write scenario files of encounters drawn from a seed; every start is in the safe set.

    Encounter number k of a seed is the same whatever --count is.
    """
    from testbed.encounters.generating import Settings
    from testbed.encounters.generating import generate as make
    from testbed.encounters.scenarios import Choices

    found = make(kind, seed, count, Settings(vehicles, density, miss))
    said = f"testbed encounters generate {kind} --seed {seed} --count {count}"
    _write(found, Choices(others, "goal", matched=False), out, said, overwrite, as_json)


def _write(
    found: Sequence[Encounter], choices: Choices, out: Path, command: str, overwrite: bool, as_json: bool
) -> None:
    from testbed.encounters.writing import write

    files = write(found, choices, out, command, overwrite)
    notes = [f"{e.name}: {note}" for e in found for note in e.notes]
    if as_json:
        print(json.dumps({"folder": str(out), "files": files, "notes": notes}, indent=2))
        return
    for note in notes[:20]:
        print(f"note: {note}")
    if len(notes) > 20:
        print(f"note: and {len(notes) - 20} more, in {out / 'encounters.json'}")
    print(
        f"{len(files)} scenario file{'s' if len(files) != 1 else ''} in {out};"
        f" next: testbed run {out / files[0]}"
    )
