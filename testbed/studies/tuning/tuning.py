"""`testbed tune`: score gains on the step specification; sweep them with a scenario in the loop."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.campaigns.engine import Notebook, notebook
from testbed.errors import UserError
from testbed.records.store import check_free, write_json
from testbed.report.page import reported

if TYPE_CHECKING:
    import pandas as pd

    from aircraft.airframe import Airframe
    from aircraft.autopilots.specification import Row
    from testbed.scenario.scenario import Scenario

SWEPT_GROUPS = ("turn", "speed", "climb", "all", "margins")
MOST_POINTS = 1000


@dataclass(frozen=True)
class Sweep:
    """One gain, section.name, and the values it takes."""

    gain: str
    values: tuple[float, ...]

    @classmethod
    def parse(cls, text: str, airframe: Airframe) -> Sweep:
        """From GAIN=FROM:TO:COUNT, factors in equal ratios, or GAIN=FROM:TO:COUNT:abs, values in equal steps.

        Raises  UserError naming what is wrong with `text`
        """
        from aircraft.autopilots.gains import resolve

        name, _, numbers = text.partition("=")
        parts = numbers.split(":")
        absolute = parts[3:] == ["abs"]
        try:
            low, high, count = float(parts[0]), float(parts[1]), int(parts[2])
            if len(parts) > 3 and not absolute:
                raise ValueError
        except (ValueError, IndexError):
            example = "turn.bandwidth=0.5:2:9 (factors), turn.bandwidth=5:15:9:abs (values)"
            raise UserError(f"--sweep {text}: write GAIN=FROM:TO:COUNT, such as {example}") from None
        if not (math.isfinite(low) and math.isfinite(high) and 1 <= count <= MOST_POINTS):
            raise UserError(f"--sweep {text}: finite ends, and 1 to {MOST_POINTS} points")
        try:
            gain = resolve(airframe, name.strip())
        except ValueError as error:
            raise UserError(f"--sweep {text}: {error}") from None
        if absolute:
            return cls(gain, tuple(np.linspace(low, high, count).tolist()))
        if not (low > 0 and high > 0):
            raise UserError(f"--sweep {text}: factors must be above 0; for values append :abs")
        section, _, key = gain.partition(".")
        own = airframe.gains[section][key]
        return cls(gain, tuple((own * np.geomspace(low, high, count)).tolist()))


@dataclass(frozen=True)
class Point:
    """One set of gains to fly: on which airframe, and the scenario, if any, as its resolved fields."""

    airframe: str
    gains: tuple[tuple[str, float], ...]
    scenario: str | None  # JSON
    file: Path | None  # the gains file that the scenario's aircraft fly

    @property
    def key(self) -> str:
        return json.dumps([self.gains, self.scenario])


@dataclass
class Tuned:
    """What was found: a table to print, sentences below it, and everything for JSON."""

    title: str
    rows: list[dict[str, Any]]
    lines: list[str] = field(default_factory=list)
    data: dict[str, Any] = field(default_factory=dict)
    met: bool = True


def specification(airframe: Airframe) -> Tuned:
    """Every row of the specification with the airframe's gains, the least margins in place of all."""
    from aircraft.autopilots.specification import evaluate
    from testbed.report import aircraft_tables as tables

    rows = evaluate(airframe)
    missed = [r for r in rows if not r.met]
    line = f"{len(missed)} of {len(rows)} bounds missed" if missed else f"all {len(rows)} bounds met"
    data = {"airframe": airframe.name, "rows": [vars(r) | {"met": r.met} for r in rows]}
    shown = tables.specification(tables.worst(rows))
    return Tuned(f"{airframe.title}: step specification", shown, [line], data, not missed)


# -- sweeps


def measure(point: Point) -> dict[str, Any]:
    """Step scores, margins and, with a scenario, the guarantee at one point; NaN where it cannot fly."""
    from aircraft.airframe import load
    from aircraft.autopilots.specification import evaluate
    from aircraft.jsbsim.initialisation import FdmError

    airframe = load(point.airframe).with_gains(dict(point.gains))
    row: dict[str, Any] = dict(point.gains)
    try:
        row |= summary(evaluate(airframe, SWEPT_GROUPS))
    except FdmError as error:
        row |= {"fault": str(error)}
    if point.scenario is not None:
        row |= _guarantee(point)
    return row


def summary(rows: Sequence[Row]) -> dict[str, Any]:
    """The specification in a line: the worst of each quantity, and how many bounds are missed."""

    def worst(group: str, quantity: str, lowest: bool = False) -> float:
        values = [r.value for r in rows if r.group == group and r.quantity == quantity]
        # a NaN is a response that never got there
        return float((np.min if lowest else np.max)(values)) if values else math.nan

    return {
        "missed": sum(not r.met for r in rows),
        "omega_t63_s": worst("turn", "t63_s"),
        "omega_overshoot": worst("turn", "overshoot"),
        "omega_overshoot_combined": worst("all", "omega_overshoot"),
        "altitude_change_m": worst("turn", "altitude_change_m"),
        "v_settling_s": worst("speed", "settling_s"),
        "v_overshoot": worst("speed", "overshoot"),
        "zeta_t63_s": worst("climb", "t63_s"),
        "zeta_overshoot": worst("climb", "overshoot"),
        "gain_margin_db": worst("margins", "gain_db", lowest=True),
        "phase_margin_deg": worst("margins", "phase_deg", lowest=True),
        "disk_margin": worst("margins", "disk", lowest=True),
    }


def _guarantee(point: Point) -> dict[str, Any]:
    from testbed.scenario.scenario import parse
    from testbed.simulation.simulate import run

    s = parse(json.loads(point.scenario or "{}"))
    try:
        done = run(s)
    except UserError as error:
        return {"min_distance_m": math.nan, "min_h_m": math.nan, "fault": str(error)}
    separation, safe = done.guarantee("separation"), done.guarantee("safe-set")
    return {
        "min_distance_m": separation["value"],
        "min_h_m": safe["value"],
        "ended_early": done.manifest.get("ended_early") or "",
    }


def sweep(
    airframe: Airframe,
    source: str,
    sweeps: Sequence[Sweep],
    scenario: Scenario | None,
    out: Path,
    *,
    command: str,
    workers: int | None = None,
    overwrite: bool = False,
) -> Tuned:
    """Fly every combination of the swept gains: sweep.csv, plots, tune.json, and gains files with a scenario.

    source  the airframe's name or folder
    """
    from aircraft.autopilots.gains import gain_faults
    from aircraft.autopilots.gains import write as write_gains

    check_free(out, overwrite)
    if len({s.gain for s in sweeps}) < len(sweeps):
        raise UserError("--sweep: each gain once")
    grid = list(itertools.product(*(s.values for s in sweeps)))
    if len(grid) > MOST_POINTS:
        raise UserError(f"--sweep: {len(grid)} points; at most {MOST_POINTS}")
    own = _changed(airframe, source)
    for values in grid:
        changes = own | dict(zip((s.gain for s in sweeps), values, strict=True))
        if faults := gain_faults(airframe.with_gains(changes)):
            raise UserError(f"--sweep: gains.{faults[0]}")
    prepared = _fields(scenario) if scenario is not None else None
    with notebook(out, f"tune-{_fingerprint(airframe)}") as book, reported(out, overwrite) as folder:
        (folder / "gains").mkdir()
        points = []
        for k, values in enumerate(grid):
            gains = own | dict(zip((s.gain for s in sweeps), values, strict=True))
            file = folder / "gains" / f"{k + 1:03d}.toml"
            provenance = {"command": command, "airframe_sha256": airframe.fingerprint()}
            write_gains(file, source, gains, provenance)
            fields = None if prepared is None else json.dumps(prepared | {"airframes": [str(file)]})
            points.append(Point(source, tuple(gains.items()), fields, file))
        rows = _flown(points, prepared, book, workers)
        table = _frame(rows, sweeps)
        table.to_csv(folder / "sweep.csv", index=False)
        from testbed.studies.tuning.figures import draw

        files = [f.name for f in draw(table, sweeps, airframe, scenario, folder)]
        records = table.to_dict("records")
        write_json(
            folder / "tune.json",
            provenance_of(command, airframe) | {"rows": records, "files": ["sweep.csv", *files]},
        )
    keep = [s.gain for s in sweeps] + ["missed", "omega_t63_s", "omega_overshoot", "phase_margin_deg"]
    keep += ["min_distance_m", "min_h_m"] if scenario is not None else ["v_settling_s", "zeta_t63_s"]
    shown = [{k.split(".")[-1] if "." in k else k: row.get(k) for k in keep} for row in records]
    title = f"{airframe.title}: " + ", ".join(s.gain for s in sweeps)
    title += f" in {scenario.name}" if scenario is not None else ""
    return Tuned(title, shown, [f"tables and plots in {out}"], {"folder": str(out), "rows": records})


def provenance_of(command: str, airframe: Airframe) -> dict[str, Any]:
    """What made a folder of gains: command, versions, the airframe's files."""
    from testbed.components.catalogue import versions

    return {
        "command": command,
        "versions": versions(),
        "airframes": {airframe.name: airframe.fingerprint()},
    }


def _flown(
    points: Sequence[Point], prepared: Mapping[str, Any] | None, book: Notebook, workers: int | None
) -> list[dict[str, Any]]:
    """Rows of the points in order, those of an interrupted sweep taken from the notebook."""

    keys = [json.dumps([p.gains, prepared]) for p in points]  # not where its gains file lies

    def said(p: Point, row: dict[str, Any]) -> str:
        gains = ", ".join(f"{name} {value:.4g}" for name, value in p.gains)
        return gains + (f": {row['min_distance_m']:.2f} m" if "min_distance_m" in row else "")

    return book.fly(measure, points, keys, workers, said)


def _frame(rows: list[dict[str, Any]], sweeps: Sequence[Sweep]) -> pd.DataFrame:
    import pandas as pd

    table = pd.DataFrame(rows)
    first = [s.gain for s in sweeps]
    return table[[*first, *(c for c in table.columns if c not in first)]]


def _fields(scenario: Scenario) -> dict[str, Any]:
    fields: dict[str, Any] = scenario.model_dump(mode="json", exclude_unset=True)
    return fields | {"plant": "jsbsim"}


def _changed(airframe: Airframe, source: str) -> dict[str, float]:
    """The gains in which the airframe differs from the one it is read from: those of --gains."""
    from aircraft.airframe import load

    before = load(source).gains
    return {
        f"{section}.{name}": value
        for section, names in airframe.gains.items()
        for name, value in names.items()
        if before[section][name] != value
    }


def _fingerprint(airframe: Airframe) -> str:
    """Of the airframe and of all that flies and scores it: neither changed code nor files resume old rows."""
    from importlib.metadata import version

    from aircraft.autopilots.equations import EQUATIONS
    from testbed.campaigns.identity import code_id, content_id

    equations = EQUATIONS.read_text(encoding="utf-8")
    return content_id([airframe.fingerprint(), code_id(__name__), version("control"), equations])
