"""Fleets at the density of traffic, flown with near pairs only and with all, for quick tests and soak."""

from pathlib import Path

import numpy as np

import testbed
from testbed.records.run import Run
from testbed.scenario import near_pairs
from testbed.scenario.scenario import Scenario, parse

PER_M2 = 25e-6  # one per 0.04 km2


def city(vehicles: int, plant: str, kind: str, duration: float, per_m2: float = PER_M2, **more) -> Scenario:
    """Vehicles on their ways across a square; filter and recording at 20 Hz."""
    side = float(np.sqrt(vehicles / per_m2))
    start = {"pattern": "random-goals", "square_m": side, "goal_distance_m": side / 2, "start_h_m": 1.0}
    rates = {"fdm_dt_s": 0.005, "filter_dt_s": 0.05, "record_dt_s": 0.05}
    said = {"name": "city", "vehicles": vehicles, "plant": plant, "duration_s": duration, "start": start}
    return parse(
        said | {"filter": {"kind": kind}, "rates": rates, "checks": {"manoeuvre_instants": 0}} | more
    )


def flown(monkeypatch, s: Scenario, above: int, out: Path | None = None) -> Run:
    """The run with near pairs only if `s` has more vehicles than `above`."""
    monkeypatch.setattr(near_pairs, "ABOVE", above)
    return testbed.run(s, out, force=True, overwrite=True)


def assert_equal_to_the_last_bit(near: Run, whole: Run) -> None:
    """Every number of both runs: vehicles, verdicts, and the rows that both have."""
    assert list(near.vehicles) == list(whole.vehicles)
    for name in near.vehicles:
        assert (near.vehicles[name].to_numpy() == whole.vehicles[name].to_numpy()).all(), name
    for one, other in zip(near.guarantees, whole.guarantees, strict=True):
        assert one.to_json() == other.to_json()
    said = near.manifest["near_pairs"]
    assert "near_pairs" not in whole.manifest
    due = whole.pairs[whole.pairs.h_m <= said["h_m"]]
    assert 0 < len(due) == len(near.pairs) < len(whole.pairs)
    for name in near.pairs:
        np.testing.assert_array_equal(near.pairs[name].to_numpy(), due[name].to_numpy(), name)
