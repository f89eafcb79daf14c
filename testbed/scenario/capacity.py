"""Estimates memory and rows that a scenario needs, before anything is allocated."""

from __future__ import annotations

from math import ceil

from testbed.errors import UserError
from testbed.scenario.contents import Contents
from testbed.scenario.near_pairs import recorded_pairs

# More than a desktop has to spare, and more rows than a disk.
MOST_BYTES = 8e9
MOST_ROWS = 1e9
# Of a run kept in memory, at some hundred bytes a row.
MOST_ROWS_IN_MEMORY = 5e7
# Gusts change within a filter period: the replay remembers the wind so often.
WIND_PERIOD_S = 0.05


def check(s: Contents) -> None:
    """ValueError naming the field that makes the run too large, and what to write instead."""
    n, rates = s.vehicles, s.rates
    pairs = recorded_pairs(s)
    # Offsets of all pairs over one filter period, their differences and squares.
    track = rates.fdm_steps * (pairs + n) * 24 * 4
    _refuse(track, f"rates.filter_dt_s: {rates.fdm_steps} FDM periods of {n} vehicles", "make it shorter")
    told = s.filter_steps * max(1, ceil(rates.filter_dt_s / WIND_PERIOD_S))
    if s.checks.manoeuvre_instants:
        what = f"checks.manoeuvre_instants: remembering {told} filter steps to fly gamma from"
        _refuse(told * (48 * n + 600), what, "0 does without")
    late = ceil((s.sensing.delay_s + s.network.latency_s) / rates.filter_dt_s)
    each = 56 * n * (n if s.sensing.source == "sensors" else 1)
    what = f"sensing.delay_s, network.latency_s: what {n} vehicles measured in {late} filter steps"
    _refuse(late * each, what, "make them shorter")
    rows = records(s)
    if rows > MOST_ROWS:
        raise ValueError(
            f"rates.record_dt_s: {rows:.1e} rows to record, more than {MOST_ROWS:.0e}; make it longer"
        )


def check_in_memory(s: Contents) -> None:
    """UserError for a run whose tables are too large to be kept in memory."""
    if records(s) > MOST_ROWS_IN_MEMORY:
        raise UserError(
            f"{records(s):.1e} rows are too many for memory; give a folder, or a longer rates.record_dt_s"
        )


def records(s: Contents) -> int:
    """Rows of all tables."""
    fenced = sum(len(fence.vehicles) or s.vehicles for fence in s.fence)
    return (s.filter_steps // s.rates.record_steps + 1) * (s.vehicles + recorded_pairs(s) + fenced)


def _refuse(needed: float, what: str, remedy: str) -> None:
    if needed > MOST_BYTES:
        raise ValueError(f"{what} would take {needed / 1e9:.0f} GB, more than {MOST_BYTES / 1e9:g}; {remedy}")
