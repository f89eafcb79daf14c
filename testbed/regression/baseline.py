"""Baseline files: one JSON file each, a line per quantity, so that a re-recording reads well in a diff."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from aircraft.textfile import read_toml
from testbed.errors import UserError, nearest
from testbed.records.checksums import plain
from testbed.regression.quantities import Quantity, quantities
from testbed.requirements.requirement import Requirement
from testbed.scenario.location import moved, placed
from testbed.scenario.scenario import Scenario, builtin, parse
from testbed.scenario.variants import load_base
from testbed.studies.common.measure import Fields, default_starts

SCHEMA_VERSION = 1
DEFAULT_FOLDER = Path("tests") / "baselines"


@dataclass(frozen=True)
class Baseline:
    """What was recorded.

    source      built-in scenario, or its file relative to the baseline's folder
    overrides   FIELD=VALUE, applied to it when it was recorded
    scenario    as flown, starts perturbed
    rungs       name -> the scenario fields that make it
    seeds       in a block; block k, from 1, flies (k - 1) seeds + 1 to k seeds
    blocks      recorded, 1 to this
    tolerances  rung -> quantity -> its unit; nan where there is nothing to compare
    runs        rung -> quantity -> (blocks * seeds,), nan where a run has no value
    history     one entry per recording, oldest first: reason, versions of what numbers depend on, airframes
                (name -> SHA-256 of files and gains), the user's own parts, and what it changed
    requirements  name -> formula, whose robustness is a quantity
    """

    name: str
    source: str
    overrides: list[str]
    scenario: Scenario
    rungs: dict[str, Fields]
    seeds: int
    blocks: int
    tolerances: dict[str, dict[str, float]]
    runs: dict[str, dict[str, np.ndarray]]
    history: list[dict[str, Any]]
    requirements: dict[str, str] = field(default_factory=dict)

    @property
    def versions(self) -> dict[str, str]:
        return dict(self.history[-1]["versions"])

    @property
    def airframes(self) -> dict[str, str]:
        return dict(self.history[-1]["airframes"])

    @property
    def parts(self) -> dict[str, dict[str, Any]]:
        """Parts of the user's own that flew: role -> origin."""
        return dict(self.history[-1].get("parts", {}))

    @property
    def quantities(self) -> list[Quantity]:
        return quantities(self.scenario, "filter" in self.parts, self.requirements)


def folder(root: Path, asked: Path | None = None) -> Path:
    """Where baselines are: `asked`, or what `baselines` of [tool.testbed] in root/pyproject.toml says, or
    root/tests/baselines."""
    if asked is not None:
        return asked
    project = root / "pyproject.toml"
    if project.is_file():
        try:
            said = read_toml(project)
        except ValueError as error:
            raise UserError(f"{project}: {error}") from None
        chosen = said.get("tool", {}).get("testbed", {}).get("baselines", str(DEFAULT_FOLDER))
        if not isinstance(chosen, str):
            raise UserError(f"{project}: tool.testbed.baselines: give a folder, got {chosen!r}")
        return root / chosen
    return root / DEFAULT_FOLDER


def known(where: Path) -> list[str]:
    return sorted(f.stem for f in where.glob("*.json"))


def place(where: Path, name: str) -> Path:
    """The file of a baseline; UserError for a name that is no file name."""
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]*", name):
        raise UserError(f"baseline name {name!r}: use letters, digits, '-', '_' and '.'")
    return where / f"{name}.json"


def scenario_of(source: str, overrides: list[str], where: Path | None = None) -> Scenario:
    """The scenario a baseline flies: a built-in one, or a file relative to `where` (None: as it stands).

    Its starts are perturbed where it says nothing of that, because otherwise all seeds would fly the same
    run. The rungs set the plant, and the blocks the seeds.
    """
    for item in overrides:
        if (field := item.partition("=")[0].strip()) in ("plant", "seed"):
            raise UserError(f"--set {field}: a baseline sets it itself; see --rungs and --block")
    path = source if where is None or source in builtin() else str(where / source)
    s = default_starts(load_base(path, overrides))
    return s.model_copy(update={"plant": "unicycle", "seed": 0})


def relative(source: str, where: Path) -> str:
    """A scenario as the baseline names it: files relative to the baselines' folder, whatever the cwd."""
    return source if source in builtin() else Path(os.path.relpath(source, where)).as_posix()


def read(where: Path, name: str) -> Baseline:
    """The baseline `name` in folder `where`.

    Raises UserError if there is none, it is damaged or of another schema, or its scenario has changed since.
    """
    path = place(where, name)
    if not path.is_file():
        command = f"testbed regress record {name} --scenario SCENARIO"
        hint = nearest(name, known(where)) if known(where) else f"record it: {command}"
        raise UserError(f"no baseline {name!r} in {where}; {hint}")
    found = parse_file(path)
    now = scenario_of(found.source, found.overrides, where)
    if changed := differences(found.scenario, now):
        more = f" and {len(changed) - 1} more" if len(changed) > 1 else ""
        raise UserError(
            f"{path}: scenario {found.source} has changed since: {changed[0]}{more}; {_again(name)}"
        )
    return found


def checked(requirements: Mapping[str, str], s: Scenario) -> dict[str, str]:
    """Requirements that runs of `s` can tell, by names that no other quantity has; UserError for others."""
    taken = {q.name for q in quantities(s, own_filter=True)}
    for name, text in requirements.items():
        if not re.fullmatch(r"[a-z][a-z0-9_-]{0,40}", name) or name in taken:
            raise UserError(
                f"requirement {name!r}: name it by small letters, digits, _ and -, as no other quantity is"
            )
        Requirement(text).check(s)
    return dict(requirements)


def _again(name: str) -> str:
    return f'if intended: testbed regress record {name} --reason "..."'


def parse_file(path: Path) -> Baseline:
    """The file as it stands; its scenario may be another today."""
    try:
        data = json.loads(path.read_text(encoding="utf-8-sig"))
        version = data["schema_version"]
        if version != SCHEMA_VERSION:
            raise UserError(
                f"{path} has schema version {version}, this program reads {SCHEMA_VERSION};"
                f" {_again(path.stem)}"
            )
        s = parse(placed(data["scenario"]["flown"], path.parent), str(path), keep_idle=True)
        seeds, blocks = data["seeds"]["in_a_block"], data["seeds"]["blocks"]
        own_filter = "filter" in data["history"][-1].get("parts", {})
        asked = checked(data.get("requirements", {}), s)
        names, rungs = [q.name for q in quantities(s, own_filter, asked)], data["rungs"]
        table = {rung: data["quantities"][rung] for rung in rungs}
        if any(list(of) != names for of in table.values()):
            raise ValueError("its quantities are not those this program compares")
        runs = {
            rung: {n: np.array(of[n]["runs"], dtype=float).reshape(blocks * seeds) for n in names}
            for rung, of in table.items()
        }
        # None becomes nan, as in the runs.
        tolerances = {
            rung: dict(zip(names, np.array([of[n]["tolerance"] for n in names], dtype=float), strict=True))
            for rung, of in table.items()
        }
        return Baseline(
            path.stem, data["scenario"]["source"], data["scenario"]["set"], s, rungs, seeds, blocks,
            tolerances, runs, data["history"], asked,
        )  # fmt: skip
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise UserError(f"{path} is damaged ({type(error).__name__}: {error}); {_again(path.stem)}") from None


def write(where: Path, b: Baseline) -> Path:
    """The file, whole or not at all; equal baselines give equal bytes."""
    data = {
        "schema_version": SCHEMA_VERSION,
        "history": b.history,
        "scenario": {
            "source": b.source,
            "set": b.overrides,
            "flown": moved(b.scenario.model_dump(mode="json"), where),
        },
        **({"requirements": b.requirements} if b.requirements else {}),
        "rungs": b.rungs,
        "seeds": {"in_a_block": b.seeds, "blocks": b.blocks},
        "quantities": {rung: {q.name: _entry(b, rung, q) for q in b.quantities} for rung in b.rungs},
    }
    path = place(where, b.name)
    try:
        where.mkdir(parents=True, exist_ok=True)
        partial = where / f".{b.name}.partial-{os.getpid()}"
        partial.write_text(_text(plain(data)) + "\n", encoding="utf-8")
        partial.replace(path)
    except OSError as error:
        raise UserError(f"cannot write {path}: {error.strerror}") from None
    return path


def _entry(b: Baseline, rung: str, q: Quantity) -> dict[str, Any]:
    values = b.runs[rung][q.name]
    finite = values[np.isfinite(values)]
    mean = float(f"{finite.mean():.6g}") if finite.size else None
    return {
        "unit": q.unit,
        "mean": mean,
        "tolerance": float(f"{b.tolerances[rung][q.name]:.3g}"),
        "runs": values.reshape(b.blocks, b.seeds).tolist(),
    }


def _text(value: Any, indent: str = "") -> str:
    """JSON with a list of plain values on one line."""
    inner = indent + "  "
    if isinstance(value, dict) and value:
        lines = [f"{inner}{json.dumps(k)}: {_text(v, inner)}" for k, v in value.items()]
        return "{\n" + ",\n".join(lines) + f"\n{indent}}}"
    if isinstance(value, list) and any(isinstance(v, list | dict) for v in value):
        return "[\n" + ",\n".join(inner + _text(v, inner) for v in value) + f"\n{indent}]"
    return json.dumps(value, allow_nan=False, ensure_ascii=False)


def differences(recorded: Scenario, now: Scenario) -> list[str]:
    """Fields in which two scenarios differ, `path old -> new`; names and descriptions do not matter."""
    a, b = (
        _leaves(s.model_dump(mode="json", exclude={"name", "description", "airframes_folder"}))
        for s in (recorded, now)
    )
    return [f"{path} {a.get(path)} -> {b.get(path)}" for path in a | b if a.get(path) != b.get(path)]


def _leaves(data: dict[str, Any], path: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in data.items():
        here = f"{path}{key}"
        found |= _leaves(value, f"{here}.") if isinstance(value, dict) else {here: value}
    return found
