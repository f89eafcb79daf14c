"""When overriding begins: measured beyond the box, against the vehicle alone, in the paper's order."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from testbed.studies.onset import onset
from testbed.studies.paper.paper import make


def test_the_first_time_is_the_first_and_never_is_nan() -> None:
    t = np.array([0.0, 0.1, 0.2])
    happened = np.array([[False, False, True], [True, False, False], [True, False, True]])
    first = onset.first_time(t, happened)
    assert first[0] == 0.1 and np.isnan(first[1]) and first[2] == 0.0


def test_every_law_is_flown_by_two_and_by_twenty() -> None:
    cases = onset.cases()
    assert {(c.law, c.vehicles) for c in cases} == {(law, n) for law in onset.LAWS for n in (2, 20)}
    by_law = {c.law: c.scenario() for c in cases if c.vehicles == 20}
    assert (by_law["cubic 0.1"].alpha.kind, by_law["cubic 0.1"].alpha.coefficient) == ("cubic", 0.1)
    assert by_law["linear 0.3"].alpha.coefficient == 0.3
    assert by_law["navigation"].filter.kind == "navigation"


@pytest.mark.slow
def test_a_small_linear_coefficient_overrides_before_the_cubic() -> None:
    short = ("duration_s=7.2",)
    cubic, weak, slow = (
        onset.measure(onset.Case(law, 2, short)) for law in ("cubic 0.1", "linear 1", "linear 0.1")
    )
    # head-on at 45.8 m/s with the cubic alpha: nothing happens before h = (10 hdot)^(1/3) = 7.7 m
    assert cubic.override == pytest.approx([6.88, 6.88], abs=0.011)
    assert weak.override.min() < cubic.override.min() - 0.5
    # at the start alpha = 0.1 * 268 m is already below the rate at which the two close
    assert np.all(slow.override == 0.0)
    # the box alone, 40 m/s asked for and 25 m/s given, is no override
    assert cubic.turn.min() >= cubic.override.min() > 6.0


def test_the_navigation_function_unseen_by_others_is_no_override() -> None:
    blind = onset.measure(onset.Case("navigation", 2, ("duration_s=0.1", "sensing_range_m=1e-9")))
    assert np.isnan(blind.override).all() and np.isnan(blind.turn).all()
    seeing = onset.measure(onset.Case("navigation", 2, ("duration_s=0.1", "sensing_range_m=500")))
    assert np.all(seeing.override == 0.0)


@pytest.mark.slow
def test_the_command_writes_the_table_and_the_plot(tmp_path: Path) -> None:
    out = tmp_path / "onset"
    make(out, ["onset"], overrides=["duration_s=0.02"], workers=1)
    table = pd.read_csv(out / "onset.csv")
    assert len(table) == 10 and set(table.vehicles) == {2, 20}
    at_once = table[table.law == "linear 0.1"]
    assert (at_once.first_override_s == 0.0).all()
    assert table[table.law == "cubic 0.1"].first_override_s.isna().all()
    assert (out / "onset.png").stat().st_size > 10_000 and (out / "onset.pdf").is_file()
