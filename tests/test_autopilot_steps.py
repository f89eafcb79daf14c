"""Steps flown under ArduPlane and PX4 against times calculated for the loops alone, and the guide's table."""

from __future__ import annotations

import sys
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).parent.parent
sys.path[:0] = [str(Path(__file__).parent), str(ROOT / "docs")]
import autopilot_steps as steps  # noqa: E402
from benchmarks.autopilot_cost import ratios  # noqa: E402

TABLE = pd.read_csv(ROOT / "docs/guide/data/autopilots/steps.csv")
# What is more than 30 % from the calculation; the guide explains each.
OFF = {
    ("ArduPlane, defaults", "turn", "settling_s"),
    ("ArduPlane, defaults", "slower", "t63_s"),
    ("ArduPlane, X8 file", "turn", "settling_s"),
    ("ArduPlane, X8 file", "faster", "settling_s"),
    ("ArduPlane, X8 file", "slower", "t63_s"),
    ("PX4, defaults", "turn", "settling_s"),
    ("PX4, defaults", "faster", "t63_s"),
    ("PX4, defaults", "slower", "t63_s"),
    ("PX4, throttle mapped", "turn", "settling_s"),
    ("PX4, throttle mapped", "faster", "t63_s"),
    ("PX4, throttle mapped", "slower", "t63_s"),
    ("PX4, throttle mapped", "climb", "settling_s"),
}
WHERE_ATTITUDE_IS_HELD = {
    ("PX4, defaults", "turn", "settling_s"),
    ("PX4, throttle mapped", "turn", "settling_s"),
    ("PX4, throttle mapped", "climb", "settling_s"),
}


@pytest.mark.parametrize(("kind", "off"), [("flown", OFF), ("tight", WHERE_ATTITUDE_IS_HELD)])
def test_times_are_within_30_percent_but_for_those_that_the_guide_explains(
    kind: str, off: set[tuple[str, str, str]]
) -> None:
    found = {
        (row.loops, row.step, name)
        for _, row in TABLE.iterrows()
        for name in ("t63_s", "settling_s")
        if not steps.within(row[f"{kind}_{name}"], row[f"calculated_{name}"])
    }
    assert found == off


def test_the_guide_shows_the_table() -> None:
    assert steps.markdown(TABLE) in (ROOT / "docs/guide/autopilots.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("loops", "step", "tight"),
    [
        ("ArduPlane, defaults", "turn", False),
        ("ArduPlane, X8 file", "turn", False),
        ("ArduPlane, X8 file", "faster", True),
        ("PX4, defaults", "turn", False),
        ("PX4, throttle mapped", "climb", False),
    ],
)
def test_the_table_is_flown_again_alike(loops: str, step: str, tight: bool) -> None:
    (row,) = TABLE[(TABLE.loops == loops) & (TABLE.step == step)].to_dict("records")
    kind = "tight" if tight else "flown"
    t63, settling = steps.times(*steps.response(steps.ALL[loops].airframe(tight), step), steps.STEPS[step][4])
    assert t63 == pytest.approx(row[f"{kind}_t63_s"], abs=0.006)
    assert settling == pytest.approx(row[f"{kind}_settling_s"], abs=0.06)


def test_autopilots_of_people_cost_no_more_than_the_inverting_one_and_sensors_little() -> None:
    """Least times of steps in turns in one process; on an idle machine 0.68, 0.73 and 1.12."""
    found = ratios("x8", ("arduplane", "px4", "typical"), rounds=2, turns=20)
    assert found["arduplane"] < 1.0 and found["px4"] < 1.0
    assert found["typical"] < 1.3
