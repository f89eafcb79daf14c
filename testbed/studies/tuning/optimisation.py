"""Searches gains that meet the step specification, by the simplex of Nelder and Mead.

Channel by channel, several starts at once, every evaluation kept: an interrupted search goes on where it was.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.campaigns.display import say
from testbed.campaigns.engine import fly_all
from testbed.campaigns.journal import Journal
from testbed.errors import UserError
from testbed.records.store import check_free, write_json
from testbed.report.page import reported
from testbed.studies.tuning import lags, page
from testbed.studies.tuning.provenance import changed_gains, fingerprint, provenance_of
from testbed.studies.tuning.stages import stages
from testbed.studies.tuning.tuning import Tuned

if TYPE_CHECKING:
    from aircraft.airframes.schema import Airframe
    from aircraft.autopilots.specification import Row

# The search asks a little more than the specification, so that what it finds is not on the edge of it.
RESERVE = 0.03
_SPREAD = 0.15  # of a simplex, in the logarithm of the gains
_AWAY = 1e-3  # weight of the squared logarithm of a gain's change: no change without a reason


@dataclass(frozen=True)
class Search:
    """One start: the airframe and its gains, which gains move, which rows count, seed and evaluations."""

    airframe: str
    base: tuple[tuple[str, float], ...]
    stages: tuple[tuple[tuple[str, ...], tuple[str, ...]], ...]
    seed: int
    evaluations: int
    memory: Path


def cost(rows: Sequence[Row]) -> float:
    """Sum of squared shares by which bounds are missed, each bound RESERVE tighter than stated."""
    total = 0.0
    for r in rows:
        if not np.isfinite(r.target):
            continue
        tight = 1.0 - RESERVE if r.at_most else 1.0 + RESERVE
        whole = r.quantity in ("crossings", "limited_zeta")
        now = type(r)(r.group, r.case, r.quantity, r.value, r.target * (1.0 if whole else tight), r.at_most)
        total += min(now.excess, 10.0) ** 2
    return total


def search(job: Search) -> dict[str, Any]:
    """Gains found from one start, their cost over all rows, and how many evaluations it took."""
    from aircraft.airframe import load
    from aircraft.autopilots.specification import evaluate
    from aircraft.jsbsim.errors import FdmError

    base = load(job.airframe).with_gains(dict(job.base))
    book = Journal(job.memory)
    if book.found:
        said = f"start {job.seed} goes on: {len(book.found)} scores found in {job.memory}"
        print(said, file=sys.stderr, flush=True)
    best, spent = dict(job.base), 0
    rng = np.random.default_rng(job.seed)

    def price(groups: Sequence[str], gains: dict[str, float]) -> float:
        key = json.dumps([sorted(gains.items()), list(groups)])
        if key not in book.rows:
            try:
                found = cost(evaluate(base.with_gains(gains), groups))
            except (FdmError, ValueError, FloatingPointError):
                found = 1e6
            book.keep(key, {"cost": found})
        return float(book.rows[key]["cost"])

    for gains, groups in job.stages:
        share = job.evaluations // len(job.stages)
        moved, used = _simplex(base, best, gains, partial(price, groups), rng, share)
        best, spent = best | moved, spent + used
        said = f"start {job.seed}: {', '.join(gains)} after {used} evaluations"
        print(said, file=sys.stderr, flush=True)
    every = sorted({g for _, groups in job.stages for g in groups})
    return {"gains": best, "cost": price(every, best), "evaluations": spent, "seed": job.seed}


class _Met(Exception):  # noqa: N818 - it ends a search that has succeeded
    pass


def _simplex(
    base: Airframe,
    best: dict[str, float],
    gains: Sequence[str],
    price: Callable[[dict[str, float]], float],
    rng: np.random.Generator,
    evaluations: int,
) -> tuple[dict[str, float], int]:
    """The best of `gains` found, and evaluations used; stops as soon as nothing is missed."""
    from scipy.optimize import minimize

    now = {g: best.get(g, base.gain(g)) for g in gains}
    if any(value <= 0 for value in now.values()):
        bad = next(g for g, value in now.items() if value <= 0)
        raise UserError(f"--vary {bad}: its value {now[bad]:g} is not positive, and the search is by factors")
    centre = np.log(list(now.values()))
    found: tuple[float, dict[str, float]] = (np.inf, now)
    used = 0

    def function(x: np.ndarray) -> float:
        nonlocal found, used
        if used >= evaluations:
            raise _Met
        used += 1
        # Six digits: what is written is what was flown.
        tried = {g: float(f"{value:.6g}") for g, value in zip(gains, np.exp(x).tolist(), strict=True)}
        missed = price(best | tried)
        total = missed + _AWAY * float(np.sum((x - centre) ** 2))
        if total < found[0]:
            found = (total, tried)
        if missed == 0.0:
            found = (total, tried)
            raise _Met
        return total

    simplex = centre + np.vstack([np.zeros(len(gains)), _SPREAD * np.eye(len(gains))])
    # Every seed its own simplex; the first point is always where the gains are now.
    simplex[1:] += _SPREAD * rng.uniform(-0.5, 0.5, (len(gains), len(gains)))
    with suppress(_Met):
        minimize(
            function, centre, method="Nelder-Mead", options={"initial_simplex": simplex, "maxfev": 10**6}
        )
    return found[1], used


def optimise(
    airframe: Airframe,
    source: str,
    out: Path,
    *,
    command: str,
    vary: Sequence[str] = (),
    seed: int = 1,
    starts: int = 2,
    evaluations: int = 300,
    workers: int | None = None,
    overwrite: bool = False,
) -> Tuned:
    """Search from `starts` simplices; write gains.toml with lags identified anew, and the scores.

    The scores are those before and after, in tune.json and specification.csv.
    """
    import pandas as pd

    from aircraft.airframe import load
    from aircraft.autopilots.gains import write as write_gains
    from aircraft.autopilots.specification import evaluate
    from aircraft.jsbsim.errors import FdmError
    from testbed.components.versions import versions

    check_free(out, overwrite)
    if starts < 1 or evaluations < 1:
        raise UserError("--starts and --evaluations: at least one")
    own = changed_gains(airframe, source)
    plan = stages(airframe, vary)
    memory = [
        out.parent / f".{out.name}.optimise-{fingerprint(airframe)}-{seed + k}.jsonl" for k in range(starts)
    ]
    jobs = [
        Search(source, tuple(own.items()), plan, seed + k, evaluations, file) for k, file in enumerate(memory)
    ]
    found = fly_all(search, jobs, workers, lambda job, r: f"start {job.seed} ends at cost {r['cost']:.3g}")
    best = min(found, key=lambda r: (r["cost"], r["seed"]))
    after = evaluate(airframe.with_gains(best["gains"]))
    before = evaluate(airframe)
    with reported(out, page.part, overwrite) as folder:
        provenance = {"command": command, "airframe_sha256": airframe.fingerprint()}
        provenance |= {"versions": json.dumps(versions()), "start": str(best["seed"])}
        file = folder / "gains.toml"
        write_gains(file, source, best["gains"], provenance)
        try:
            slower = lags.rows(lags.known_lags(airframe), lags.identify_again(file, out / file.name, say))
        except FdmError as error:
            slower, said = [], [f"the lags could not be identified with these gains: {error}"]
        else:
            said = lags.sentences(slower)
        rows = [
            {"case": b.case, "quantity": b.quantity, "before": b.value, "after": a.value, "target": b.target}
            | {"met": a.met}
            for b, a in zip(before, after, strict=True)
        ]
        pd.DataFrame(rows).to_csv(folder / "specification.csv", index=False)
        said += _overlaid(airframe, load(file), folder, command)
        data = provenance_of(command, airframe) | {"searches": found, "rows": rows}
        write_json(folder / "tune.json", data | {"lags": slower, "lags_said": said})
    for kept in memory:
        kept.unlink(missing_ok=True)
    missed = sum(not r.met for r in after)
    lines = [f"{g} = {v:.6g}" for g, v in best["gains"].items()]
    lines += [f"bounds missed: {sum(not r.met for r in before)} before, {missed} after"]
    lines += [*said, f"gains file, with the lags identified anew: {out / 'gains.toml'}"]
    shown = before_and_after(before, after)
    return Tuned(
        f"{airframe.title}: optimised", shown, lines, {"best": best, "rows": rows, "lags": slower}, not missed
    )


def before_and_after(before: Sequence[Row], after: Sequence[Row]) -> list[dict[str, Any]]:
    """The specification with the value before beside it; of the margins the least of each loop and kind."""
    from testbed.report import aircraft_tables as tables

    def key(row: dict[str, Any]) -> tuple[str, str]:
        margin = row["quantity"].endswith(" margin")
        return row["step"].split(" at ")[0] if margin else row["step"], row["quantity"]

    old, new = (tables.specification(tables.worst(list(rows))) for rows in (before, after))
    known = {key(row): row["value"] for row in old}
    first = ("step", "quantity", "value")
    return [
        {k: row[k] for k in first}
        | {"before": f"before {known[key(row)]}"}
        | {k: row[k] for k in ("target", "met")}
        for row in new
    ]


def _overlaid(before: Airframe, after: Airframe, folder: Path, command: str) -> list[str]:
    """Figures of the loops and steps before and after, in the folder; what to say if they cannot be drawn."""
    from aircraft.datasheets.overlay import compare
    from aircraft.jsbsim.errors import FdmError
    from testbed.report.overlay_page import write_into

    try:
        write_into(compare([before, after], progress=say), folder, command)
    except FdmError as error:
        return [f"no figures of before and after: {error}"]
    return []
