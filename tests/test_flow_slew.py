"""The flow filter with commands that change slowly: the model of ramps, and what is kept with it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import testbed
from filters.flow.channels import Channels
from filters.flow.flow_filter import FlowFilter
from filters.flow.rollout import Flow
from filters.model import Command
from testbed.errors import UserError
from testbed.verification.check import check
from tests.flow_states import DT, GAMMA, LAGS, drawn
from tests.forgery import copied, differing, read, seal, write
from tests.test_flow import encounter, run

SLEW = np.array([1.0, np.inf, 2.0])
SLOW = {"filter.speed_slew_mps2": 1.0, "filter.climb_slew_mps2": 2.0}


def test_a_ramp_through_a_lag_is_the_ramp_later() -> None:
    """Channels that are told a ramp, in steps of 1 ms, against the model: they differ by slew T^2 at most."""
    channels = Channels.of([LAGS], 1)
    model = channels.slewed(SLEW)
    assert model.delay[0] - channels.delay[0] == pytest.approx([0.32, 0.0, 0.147])
    begin, goal, fine = np.array([20.0, 0.0, -2.0]), np.array([16.0, 0.0, 2.0]), 1e-3
    y, way, worst = begin.copy(), np.zeros(3), np.zeros(3)
    for k in range(8000):
        t = k * fine - channels.delay[0]
        far = np.array([1.0, 0.0, 2.0]) * np.maximum(t, 0.0)
        told = begin + np.clip(goal - begin, -far, far)
        after = y + np.clip((told - y) / channels.constant[0], -channels.fall[0], channels.rise[0]) * fine
        way += 0.5 * (y + after) * fine
        y = after
        since = np.maximum((k + 1) * fine - model.delay[0], 0.0)
        ramp = model.towards(begin[None], goal[None]).integral(since[None, :, None])[0, :, 0]
        worst = np.maximum(worst, np.abs(way - ramp - begin * ((k + 1) * fine - since)))
    most = SLEW * channels.constant[0] ** 2
    assert (worst[[0, 2]] <= most[[0, 2]] + 2e-3).all()
    assert (worst[[0, 2]] > 0.3 * most[[0, 2]]).all()  # the bound says something


def test_gamma_inside_the_slew_is_the_ramp_that_the_flow_flies() -> None:
    """Commands step towards gamma, period by period; the flow ramps there at once. They are the same flow."""
    rng = np.random.default_rng(5)
    n = 4
    flow = Flow(Channels.of([LAGS], n).slewed(SLEW), np.tile(GAMMA, (n, 1)), DT)
    state, rates, queued = drawn(rng, n, flow.depth)
    # Commands that keep the slew, from a steady flight.
    told = rng.uniform([16.5, -0.2, -2.0], [20.0, 0.2, 2.0], (n, 3))
    for k in range(flow.depth - 1, -1, -1):
        told = told + rng.uniform(-1, 1, (n, 3)) * np.minimum(SLEW, 1.0) * DT
        queued[k] = told
    rates = queued[-1].copy()

    def gamma(last: np.ndarray) -> np.ndarray:
        return last + np.clip(flow.gamma - last, -SLEW * DT, SLEW * DT)

    times = DT * np.arange(1, 301)
    u = gamma(queued[0])
    at_once = flow.roll(flow.begin(state, rates, queued, times), u)
    # The same, told in as many periods as are on their way, each a step further.
    late, now = queued, u
    for _ in range(40):
        late = np.concatenate([now[None], late])
        now = gamma(now)
    behind = Flow(
        Channels(
            flow.channels.constant, flow.channels.delay + 40 * DT, flow.channels.fall, flow.channels.rise
        ),
        flow.gamma,
        DT,
    )
    stepped = behind.roll(behind.begin(state, rates, late, times), now)
    assert np.abs(at_once.at - stepped.at).max() < 1e-6
    assert np.abs(at_once.z - stepped.z).max() < 1e-9


def test_on_the_lagged_plant_the_clearance_is_kept_and_commands_change_slowly() -> None:
    told: list[np.ndarray] = []
    chosen, least = run(8, 11, 300, slew=SLEW, told=told)
    change = np.abs(np.diff(np.array(told), axis=0)).max(axis=(0, 1))
    assert (change <= SLEW * DT + 1e-9).all()
    assert change[2] > 0.9 * SLEW[2] * DT  # it is asked for more
    # What the corners of ramps leave out is centimetres.
    assert chosen.record.checks["flow_clear"].worst >= -0.1 and least >= 4.9
    assert chosen.endings[1] > 100


@pytest.mark.parametrize(
    "slew, said",
    [
        (np.array([0.0, np.inf, 2.0]), "more than 0 a second"),
        (np.array([np.nan, np.inf, 2.0]), "more than 0 a second"),
        (np.array([1.8, np.inf, 2.0]), "faster than the channels"),
    ],
)
def test_slews_that_nothing_can_follow_are_refused(slew: np.ndarray, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        FlowFilter([LAGS], Command.of(np.tile(GAMMA, (2, 1))), 5.0, DT, slew=slew)


def test_a_scenario_refuses_them_in_one_line() -> None:
    with pytest.raises(UserError, match=r"filter: commands that change by .* faster than the channels"):
        testbed.run(encounter(**{"filter.speed_slew_mps2": 9.0, "duration_s": 1}))


def test_verify_derives_the_claims_and_finds_another_slew(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    flown = testbed.run(encounter(**SLOW, duration_s=2), out=folder)
    found = {f.what: f for f in check(folder).findings}
    assert all(f.agrees is not False for f in found.values())
    assert found["override"].agrees is True  # what the slew alone changes is the filter's doing too
    value = flown.guarantee("monitor-flow_clear")["value"]
    assert float(found["F1 monitor-flow_clear"].own) == pytest.approx(value, abs=2e-3)
    for slew in (None, 1.5):
        forged = copied(folder, tmp_path / f"forged-{slew}")
        manifest = read(forged, "manifest.json")
        manifest["scenario"]["filter"]["speed_slew_mps2"] = slew
        write(forged, "manifest.json", manifest)
        seal(forged)
        assert "monitor-flow_clear" in differing(forged)
