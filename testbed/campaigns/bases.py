"""Reads what a campaign varies: one scenario, or the encounters in folders of scenario files."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from testbed.campaigns.file import Campaign
from testbed.campaigns.identity import content_id
from testbed.errors import NoteWarning, UserError
from testbed.scenario import scenario
from testbed.scenario.location import identity, moved, placed
from testbed.scenario.overrides import assign
from testbed.scenario.scenario import Scenario, field_path

# The axis of sets of encounters.
AXIS = "encounters"
ONE_EACH = "a campaign's workers step each run's aircraft alone, and share the processors among runs"


@dataclass(frozen=True)
class Base:
    """One scenario that the cells of a campaign vary.

    set     of encounters that it belongs to; "" without encounters
    file    its file's name; "" without encounters
    sha256  of that file
    """

    scenario: Scenario
    set: str = ""
    file: str = ""
    sha256: str = ""


def bases(campaign: Campaign, folder: Path) -> list[Base]:
    """The campaign's scenario, or the encounters of its sets in the order of their files' names.

    folder  where paths start: the campaign file's
    Raises  UserError naming the set or file
    """
    if not campaign.encounters:
        source = campaign.scenario
        if Path(source).suffix == ".toml":
            source = str(folder / source)
        return [Base(_scenario(campaign, source, folder))]
    found = []
    for name, pattern in campaign.encounters.items():
        for file in _files(pattern, folder, f"{campaign.name}: encounters {name}"):
            sha256 = hashlib.sha256(file.read_bytes()).hexdigest()
            found.append(Base(_scenario(campaign, str(file), folder), name, file.name, sha256))
    return found


def _files(pattern: str, folder: Path, where: str) -> list[Path]:
    there = folder / pattern
    if there.is_dir():
        files = sorted(there.glob("*.toml"))
    elif there.is_file():
        files = [there]
    else:
        files = sorted(f for f in there.parent.glob(there.name) if f.suffix == ".toml" and f.is_file())
    if not files:
        raise UserError(
            f"{where}: {pattern} has no scenario file; `testbed encounters import` and `generate` write them"
        )
    return files


def groups(bases: Sequence[Base]) -> dict[str, list[int]]:
    """Set -> the numbers of its bases."""
    found: dict[str, list[int]] = {}
    for k, base in enumerate(bases):
        found.setdefault(base.set, []).append(k)
    return found


def seeds_of(campaign: Campaign, base: Base) -> range:
    """The seeds that a base is flown from: those of an encounter are its own, the same in every cell.

    They come from its content, so that a file more in the folder changes no run of the others.
    """
    if not base.file:
        return campaign.seed_list
    first = campaign.first_seed + int(content_id(identity(base.scenario.model_dump(mode="json")))[:8], 16)
    return range(first, first + len(campaign.seed_list))


def kept(bases: Sequence[Base], out: Path) -> dict[str, Any]:
    """What a campaign's manifest says of its bases."""
    data = [moved(b.scenario.model_dump(mode="json"), out) for b in bases]
    if not bases[0].file:
        return {"base": data[0]}
    return {
        "encounters": [
            {"set": b.set, "file": b.file, "sha256": b.sha256, "scenario": d}
            for b, d in zip(bases, data, strict=True)
        ]
    }


def read_back(found: Mapping[str, Any], out: Path, where: str) -> list[Base]:
    """The bases as `kept` wrote them; the files need not be there any more."""

    def parsed(data: Mapping[str, Any]) -> Scenario:
        return scenario.parse(placed(data, out), where, keep_idle=True)

    if "encounters" not in found:
        return [Base(parsed(found["base"]))]
    return [Base(parsed(e["scenario"]), e["set"], e["file"], e["sha256"]) for e in found["encounters"]]


def path_within(name: str, where: str) -> tuple[str, ...]:
    """The path of a field that a table of the campaign names. Raises UserError."""
    path = field_path(name, f"{where}.")
    if path == ("seed",):
        raise UserError(f"{where}.seed: say seeds and first_seed")
    if path == ("rates", "workers"):
        raise UserError(f"{where}.rates.workers: {ONE_EACH}")
    return path


def _scenario(campaign: Campaign, source: str, folder: Path) -> Scenario:
    """A scenario with the campaign's [set]; a path in it is meant from `folder`."""
    said = scenario.tables(scenario.read(source), source)
    file = scenario.parse(placed(said, *scenario.homes(source)), source, keep_idle=True)
    if file.rates.workers != "auto":
        warnings.warn(NoteWarning(f"{source}: rates.workers is left out: {ONE_EACH}"), stacklevel=2)
    data = file.model_dump(mode="json")
    asked = [path_within(name, "set") for name in campaign.set]
    for path, value in zip(asked, campaign.set.values(), strict=True):
        assign(data, path, value)
    if named := _airframes(campaign):
        there = placed({"airframes": named}, folder, Path())
        data |= {"airframes_folder": there.get("airframes_folder", data["airframes_folder"])}
    # What has an effect in no cell is refused when all are known.
    data = scenario.without_foreign(data, asked)[0]
    return scenario.parse(data, "set" if campaign.set else source, keep_idle=True)


def _airframes(campaign: Campaign) -> list[str]:
    """The airframes that the campaign's own fields name: [set], the variants and the grid."""
    sets = (campaign.set, *campaign.variants.values())
    lists = [*(fields.get("airframes") for fields in sets), *campaign.grid.get("airframes", [])]
    return [name for names in lists if isinstance(names, list) for name in names]
