"""The project guarded by its own baselines: both airframes, 2 and 20 vehicles.

Encounters that begin close, so that they are short; how each was recorded stands in its file. After an
intended change: testbed regress record NAME --reason "..."
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from aircraft.airframe import load
from aircraft.autopilots import gains
from testbed.regression.plugin import FidelityBaseline

BASELINES = Path(__file__).parent / "baselines"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["x8-2", "rascal-2", "x8-20", "rascal-20"])
def test_nothing_flies_worse_than_recorded(name: str, fidelity_baseline: FidelityBaseline) -> None:
    fidelity_baseline.check(name)


@pytest.mark.slow
def test_nothing_flies_worse_from_fresh_seeds(fidelity_baseline: FidelityBaseline) -> None:
    """One block of the twenty flown by hand; docs/guide/regression.md has their numbers."""
    fidelity_baseline.check("x8-2", block=9)


@pytest.mark.slow
def test_a_slowed_autopilot_is_caught(
    tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    """The X8 with 30 % less turn bandwidth comes closer on every seed, and says so of the aircraft alone."""
    slow = tmp_path / "slow.toml"
    band = 0.7 * load("x8").gains["turn"]["bandwidth_radps"]
    gains.write(slow, "x8", {"turn.bandwidth_radps": band}, {"command": "by hand"})
    options = ["--baselines", BASELINES, "--set", f'airframes=["{slow}"]', "--workers", 1]
    assert call("regress", "check", "x8-2", *options) == 1
    said = capsys.readouterr().out
    for quantity in ("separation", "safe-set", "turn-rate tracking"):
        assert f"degraded: {quantity} on 6-DOF" in said
    assert "on 16 of 16 seeds" in said and "unicycles fly as recorded" in said
    assert "on unicycle" not in said
