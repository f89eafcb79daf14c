"""Flies starts given as standard normal numbers and returns how far each run is from the event."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from filters.model import Array
from testbed.campaigns import engine
from testbed.campaigns.display import LOGGED_S, Display, say
from testbed.campaigns.identity import RunIds, content_id
from testbed.campaigns.job import Job
from testbed.campaigns.journal import Journal
from testbed.claims.nearest import nearest_approach
from testbed.claims.registry import FENCE_CLEARANCE, SAFE_SET
from testbed.components.components import Parts
from testbed.errors import UserError, nearest
from testbed.records.run import Run
from testbed.requirements.requirement import Requirement, recorded_at_every_step
from testbed.scenario.randomness import random_fields
from testbed.scenario.scenario import Scenario
from testbed.studies.common.measure import job_of, override
from testbed.studies.falsify.space import Space

if TYPE_CHECKING:
    from testbed.campaigns.outcome import Executor


def _distance(run: Run) -> float | None:
    found = nearest_approach(run)
    between = found.detail.get("between_steps_m")
    return found.value if between is None else min(between, found.value or between)


# Name -> (unit, of a run: None where it has no value).
STATISTICS: dict[str, tuple[str, Callable[[Run], float | None]]] = {
    "distance_m": ("m", _distance),
    "h_m": ("m", lambda run: run.guarantee(SAFE_SET.id).value),
    "clearance_m": ("m", lambda run: run.guarantee(FENCE_CLEARANCE.id).value),
}


@dataclass(frozen=True)
class Event:
    """A statistic of a run below a bound, or a requirement that is not met.

    statistic  a key of STATISTICS, or a requirement's text, whose robustness is then below the bound 0
    """

    statistic: str
    bound: float

    @classmethod
    def read(cls, text: str) -> Event:
        """From STATISTIC=BOUND. Raises UserError."""
        name, equals, number = text.partition("=")
        if name not in STATISTICS:
            raise UserError(f"--below {text}: unknown statistic {name!r}; {nearest(name, STATISTICS)}")
        try:
            if not equals:
                raise ValueError
            bound = float(number)
            if not np.isfinite(bound):
                raise ValueError
        except ValueError:
            raise UserError(f"--below {text}: give a number, as {name}=5") from None
        return cls(name, bound)

    def __str__(self) -> str:
        if self.statistic in STATISTICS:
            return f"{self.statistic} < {self.bound:g}"
        return f"not {self.statistic}"

    def check(self, s: Scenario) -> None:
        """UserError where runs of a scenario cannot tell, or draw more than their starts."""
        if self.statistic not in STATISTICS:
            Requirement(self.statistic).check(s)
        elif self.statistic == "clearance_m" and not s.fence:
            raise UserError(f"--below clearance_m: {s.name} has no [[fence]] table")
        elif self.statistic != "clearance_m" and s.vehicles < 2:
            raise UserError(f"--below {self.statistic}: {s.name} has one vehicle, and no pair")
        perturbed = ("lateral_perturbation_m", "heading_perturbation_deg", "height_perturbation_m")
        other = [f for f in random_fields(s) if f.rpartition(".")[2] not in perturbed]
        if other:
            raise UserError(
                f"{s.name} draws {', '.join(other)} besides its starts: then a start does not decide a run;"
                " take that out with --set, or fly a campaign"
            )


def fly(job: Job) -> dict[str, Any]:
    """Fly a start, safe or not; the job's guarantee is the statistic's name. A refused one has no value."""
    from testbed.simulation.simulate import run

    try:
        done = run(job.scenario(), force=True, parts=job.own())
    except UserError as error:
        return {"value": None, "refused": str(error)}
    if job.guarantee in STATISTICS:
        value = STATISTICS[job.guarantee][1](done)
    else:
        value = Requirement(job.guarantee).judge(done).value
    return {"value": None if value is None else float(value), "refused": ""}


@dataclass
class Flights:
    """The limit state of an event over the starts of `space`: statistic less bound, a run a row of z.

    Standard normal numbers z (n, d) become uniform ones between the bounds. Runs are kept in `journal`, from
    which a command that is given again takes them.
    """

    space: Space
    event: Event
    journal: Journal
    pool: Executor
    display: Display
    parts: Parts | None = None
    asked: int = 0
    refused: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        s = self.space.scenario
        self._base = RunIds(__name__).of(override(s, {}), s.seed, _origins(s, self.parts))
        self._update = self.display.task("runs", 1.0)
        self._said = 0.0

    def __call__(self, z: Array) -> Array:
        """(n,) of z (n, d)."""
        starts = self.starts(z)
        within = [self._base, vars(self.space.bounds), self.event.statistic]
        keys = [content_id([*within, x.tolist()]) for x in starts]
        done = 0

        def ended(number: int, row: dict[str, Any]) -> None:
            nonlocal done
            done += 1
            self._update(done / max(1, len(keys)), f"{self.asked + done} flown")

        engine.fly(fly, _Jobs(self._job, starts), keys, self.journal, self.pool, ended)
        self.asked += len(keys)
        rows = [self.journal.entries[key]["row"] for key in keys]
        self.refused += [row["refused"] for row in rows if row["refused"]]
        values = np.array([np.nan if row["value"] is None else row["value"] for row in rows])
        if not self.display.live and time.monotonic() - self._said > LOGGED_S:
            self._said = time.monotonic()
            least = float(np.nanmin(values)) if np.isfinite(values).any() else np.nan
            say(f"{self.asked} runs: least of the last {len(keys)} {least:.3g}")
        return values - self.event.bound

    def starts(self, z: Array) -> Array:
        """(n, d) between -1 and 1, shares of the bounds. Rounded, so that equal runs have equal names."""
        from scipy.special import ndtr

        return np.round(2.0 * ndtr(z) - 1.0, 12)

    def _job(self, x: Array) -> Job:
        s = self.space.at(x)
        if self.event.statistic not in STATISTICS:
            s = recorded_at_every_step(s)
            data = s.model_copy(update={"checks": s.checks.model_copy(update={"manoeuvre_instants": 0})})
            text = data.model_dump_json()
        else:
            text = override(s, {})
        return job_of("start", text, s.seed, self.parts, self.event.statistic)


class _Jobs(Sequence[Job]):
    """Jobs made when they are asked for: of a run that is kept already, none is."""

    def __init__(self, make: Callable[[Array], Job], starts: Array) -> None:
        self._make, self._starts = make, starts

    def __len__(self) -> int:
        return len(self._starts)

    def __getitem__(self, index: Any) -> Any:
        return self._make(self._starts[index])


def _origins(s: Scenario, parts: Parts | None) -> str:
    sent = job_of("start", override(s, {}), s.seed, parts).parts
    return sent.origins if sent else ""
