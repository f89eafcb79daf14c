"""Flies the fidelity ladder: from the unicycle to an aircraft in weather, one departure at a time.

Each rung is the scenario with some fields overridden, flown from the same starts with the same seeds; the
mean paired differences of neighbouring rungs telescope to the whole. Each departure is also tried alone, on
the simplest rung where it can act; the part that the single effects do not add up to is the interaction.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.campaigns.distinct import check_random, distinct_results
from testbed.campaigns.engine import fly_rows
from testbed.campaigns.job import Job
from testbed.campaigns.journal import Journal
from testbed.components.components import Parts
from testbed.scenario.scenario import Scenario
from testbed.statistics import Mean, Rate, mean, rate
from testbed.studies.common.measure import Fields, job_of, keys, measure, override, said

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Rung:
    """One departure from the theorem's assumptions.

    fields  dotted path -> value: what it changes, on top of the rungs below
    base    the rung on which it is tried alone; "" where it is the lowest or cannot be tried alone
    """

    name: str
    fields: tuple[tuple[str, Any], ...]
    base: str = ""


def rungs(s: Scenario, filter_dt_s: float = 0.05) -> list[Rung]:
    """The ladder for a scenario; its own disturbances where it has some, otherwise moderate ones.

    filter_dt_s  the sampled filter's period, unless the scenario's own is longer than its FDM period
    """
    sampled = s.rates.filter_dt_s if s.rates.fdm_steps > 1 else filter_dt_s
    wind = s.wind.speed_mps or 5.0
    gusts = s.gusts.intensity if s.gusts.intensity != "none" else "moderate"
    noise = {
        "position_noise_m": s.sensing.position_noise_m or 0.5,
        "course_noise_deg": s.sensing.course_noise_deg or 1.0,
        "speed_noise_mps": s.sensing.speed_noise_mps or 0.3,
    }
    fine = s.rates.fdm_dt_s
    calm = {
        "plant": "unicycle",
        "rates.filter_dt_s": fine,
        "wind.speed_mps": 0.0,
        "gusts.intensity": "none",
        "network.latency_s": 0.0,
        "network.loss": 0.0,
        **{f"sensing.{name}": 0.0 for name in noise},
    }
    return [
        Rung("unicycle", tuple(calm.items())),
        Rung("sampled", (("rates.filter_dt_s", sampled),), "unicycle"),
        Rung("lags", (("plant", "lagged"), ("lags.limits", False)), "unicycle"),
        Rung("limits", (("lags.limits", True),), "lags"),
        Rung("6-DOF", (("plant", "jsbsim"),), "limits"),
        Rung("wind", (("wind.speed_mps", wind),), "6-DOF"),
        Rung("gusts", (("gusts.intensity", gusts),), "6-DOF"),
        Rung("noise", tuple((f"sensing.{name}", value) for name, value in noise.items()), "unicycle"),
        Rung("latency", (("network.latency_s", s.network.latency_s or 0.1),), "unicycle"),
        Rung("loss", (("network.loss", s.network.loss or 0.1),), "unicycle"),
    ]


def autopilot_rungs(s: Scenario) -> list[Rung]:
    """From the autopilot that knows everything to those that people fly: sensing, ArduPlane, PX4, poorly.

    The scenario's aircraft fly in its own weather, each under one autopilot after another.
    """
    plain = [name.partition("@")[0] for name in s.airframes]
    return [
        Rung("perfect", (("plant", "jsbsim"), ("airframes", plain), ("sensors", "perfect"))),
        Rung("typical", (("sensors", "typical"),), "perfect"),
        Rung("arduplane", (("airframes", [f"{name}@arduplane" for name in plain]),), "perfect"),
        Rung("px4", (("airframes", [f"{name}@px4" for name in plain]),), "perfect"),
        Rung("poor", (("sensors", "poor"),), "perfect"),
    ]


def cumulative(ladder: Sequence[Rung]) -> dict[str, Fields]:
    """Rung -> all fields it overrides, those of the rungs below included."""
    fields: Fields = {}
    whole = {}
    for rung in ladder:
        fields = fields | dict(rung.fields)
        whole[rung.name] = fields
    return whole


def alone(ladder: Sequence[Rung]) -> dict[str, tuple[Fields, Fields]]:
    """Rung -> fields without it and with it, on its base alone: only the base's own bases are there."""
    by_name = {r.name: r for r in ladder}

    def chain(name: str) -> Fields:
        rung = by_name[name]
        return (chain(rung.base) if rung.base else {}) | dict(rung.fields)

    return {r.name: (chain(r.base), chain(r.name)) for r in ladder if r.base}


def climb(
    s: Scenario,
    ladder: Sequence[Rung],
    seeds: range,
    book: Journal,
    workers: int | None = None,
    work: Callable[[Job], dict[str, Any]] = measure,
    parts: Parts | None = None,
) -> pd.DataFrame:
    """Fly every rung, and every departure alone, from all `seeds`; one row per run.

    parts  of the user's own, in every run; the rungs have their own plants
    Equal settings are flown once, and what `book` has not at all. UserError if nothing is random.
    """
    import pandas as pd

    check_random(s, "a ladder", len(seeds))
    wanted: dict[str, str] = {name: override(s, f) for name, f in cumulative(ladder).items()}
    for name, (without, with_) in alone(ladder).items():
        wanted[f"{name} off"], wanted[f"{name} alone"] = override(s, without), override(s, with_)
    jobs = [job_of(name, data, seed, parts) for name, data in wanted.items() for seed in seeds]
    rows = fly_rows(work, jobs, keys(jobs), book, workers, said)
    return pd.DataFrame(
        [row | {"rung": job.label, "seed": job.seed} for row, job in zip(rows, jobs, strict=True)]
    )


@dataclass(frozen=True)
class Step:
    """What one rung did to a quantity, against the rung below, and alone."""

    rung: str
    value: float
    difference: Mean | None
    alone: Mean | None


@dataclass(frozen=True)
class Account:
    """A quantity up the ladder: the differences sum to `total`; `interaction` is what singles leave."""

    quantity: str
    steps: list[Step]
    total: Mean
    interaction: Mean


def account(table: pd.DataFrame, ladder: Sequence[Rung], quantity: str, seed: int = 0) -> Account:
    """Mean paired differences of `quantity` with intervals; a seed not flown on every rung is left out."""
    values = table.pivot(index="seed", columns="rung", values=quantity).astype(float).dropna()
    rng = np.random.default_rng(seed)
    steps, singles = [], np.zeros(len(values))
    below: np.ndarray | None = None
    for rung in ladder:
        here = values[rung.name].to_numpy()
        only = None
        if rung.base:
            effect = (values[f"{rung.name} alone"] - values[f"{rung.name} off"]).to_numpy()
            singles += effect
            only = mean(effect, rng)
        difference = mean(here - below, rng) if below is not None else None
        steps.append(Step(rung.name, float(here.mean()) if here.size else float("nan"), difference, only))
        below = here
    total = values[ladder[-1].name].to_numpy() - values[ladder[0].name].to_numpy()
    return Account(quantity, steps, mean(total, rng), mean(total - singles, rng))


def methods(accounts: Iterable[Account]) -> str:
    """How the intervals of rates and of mean differences were found."""
    means = [m for a in accounts for m in (a.total, a.interaction)]
    means += [m for a in accounts for step in a.steps for m in (step.difference, step.alone) if m]
    how = dict.fromkeys(m.method for m in means if m.low != m.high)
    return f"95 % intervals. Lost: {Rate.method}. Mean differences: {'; '.join(how)}"


def rates(table: pd.DataFrame, ladder: Sequence[Rung]) -> dict[str, Rate]:
    """Rung -> how many of the runs flown did not keep Ds; what could not start is not among them."""
    found = {}
    for rung in ladder:
        rows = table[(table.rung == rung.name) & ~_refused(table)]
        found[rung.name] = rate((rows.distance_verdict != "holds").to_numpy())
    return found


def distinct_runs(table: pd.DataFrame, rung: str) -> int:
    """How many different results the runs of a rung have; runs that could not start are not among them."""
    rows = table[(table.rung == rung) & ~_refused(table)]
    return distinct_results(rows.drop(columns=["rung", "seed"]).to_dict("records"))


def _refused(table: pd.DataFrame) -> pd.Series[bool]:
    """Runs that could not start; read from a file, a run that could has nan there."""
    return table.refused.notna() & (table.refused != "")


def summary(table: pd.DataFrame, ladder: Sequence[Rung]) -> pd.DataFrame:
    """One row per rung, then the top against the bottom and the interaction; m, 95 % intervals.

    Rates are of all runs flown, means of the seeds flown on every rung, alone and together.
    """
    import pandas as pd

    lost, refused = rates(table, ladder), table[_refused(table)].rung.value_counts()
    accounts = {q: account(table, ladder, q) for q in ("distance_m", "h_m")}

    def changes(of: dict[str, Mean | None]) -> dict[str, float]:
        named: dict[str, float] = {}
        for name, m in of.items():
            value, low, high = (m.value, m.low, m.high) if m else (np.nan, np.nan, np.nan)
            named |= {name: value, f"{name}_low": low, f"{name}_high": high}
        return named

    rows = []
    for steps in zip(*(a.steps for a in accounts.values()), strict=True):
        of = lost[steps[0].rung]
        row = {"rung": steps[0].rung, "flown": of.runs, "refused": int(refused.get(steps[0].rung, 0))}
        row |= {"distinct": distinct_runs(table, steps[0].rung)}
        row |= {"lost": of.count, "rate_low": of.low, "rate_high": of.high}
        for (q, _), step in zip(accounts.items(), steps, strict=True):
            row |= {q: step.value} | changes({f"{q}_change": step.difference, f"{q}_alone": step.alone})
        rows.append(row)
    for name in ("total", "interaction"):
        row = {"rung": name}
        for q, a in accounts.items():
            row |= changes({f"{q}_change": getattr(a, name)})
        rows.append(row)
    return pd.DataFrame(rows)


def markdown(table: pd.DataFrame) -> str:
    """A summary as Markdown, as the guide shows it; metres."""

    def change(row: pd.Series[float], name: str) -> str:
        if np.isnan(row[name]):
            return ""
        return f"{row[name]:+.2f} ({row[f'{name}_low']:+.2f} to {row[f'{name}_high']:+.2f})"

    lines = [
        "| rung | lost | 95 % Clopper-Pearson | not flown | mean least d | change | alone | mean least h"
        " | change |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for _, r in table.iterrows():
        if np.isnan(r.flown):
            d, h = change(r, "distance_m_change"), change(r, "h_m_change")
            lines.append(f"| *{r.rung}* | | | | | {d} | | | {h} |")
            continue
        lines.append(
            f"| {r.rung} | {r.lost:.0f} of {r.flown:.0f}"
            f" | {100 * r.rate_low:.0f} to {100 * r.rate_high:.0f} % | {r.refused:.0f}"
            f" | {r.distance_m:.2f} | {change(r, 'distance_m_change')}"
            f" | {change(r, 'distance_m_alone')} | {r.h_m:.2f} | {change(r, 'h_m_change')} |"
        )
    return "\n".join(lines) + "\n"
