"""Rare events: estimates against closed forms, likelihood ratios, what is said when nothing is found."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from testbed.campaigns.display import Display
from testbed.campaigns.inprocess import InProcess
from testbed.campaigns.journal import Journal
from testbed.errors import UserError
from testbed.rare_events import importance, subset
from testbed.rare_events.estimate import Estimate
from testbed.rare_events.importance import OWN, Proposal, fitted, log_normal, weighed
from testbed.rare_events.limit_states import Known, crossing, linear, passing, sphere
from testbed.scenario.scenario import Scenario, load
from testbed.studies.falsify.space import Space, bounds
from testbed.studies.rare import flights
from testbed.studies.rare.flights import Event, Flights
from testbed.studies.rare.study import Plan, numbers, rare

ROOT = Path(__file__).parent.parent
MAKERS = (linear, passing, crossing, sphere)


@pytest.mark.parametrize("make", MAKERS)
def test_limit_states_have_the_probability_that_they_are_made_for(make: Callable[[float], Known]) -> None:
    known = make(0.02)
    z = np.random.default_rng(1).standard_normal((200_000, known.size))
    # One standard error is 0.0003.
    assert (known.state(z) < 0.0).mean() == pytest.approx(0.02, abs=0.0013)


@pytest.mark.parametrize("make", MAKERS)
@pytest.mark.parametrize("method", [importance, subset])
def test_an_interval_holds_one_in_a_million(method: Any, make: Callable[[float], Known]) -> None:
    known = make(1e-6)
    found = method.estimate(known.state, known.size, np.random.default_rng(4))
    assert found.low <= 1e-6 <= found.high
    if make is sphere and method is importance:  # in every direction: no mixture of two is near it
        assert found.doubts
    else:
        assert found.high / found.low < 20 and 10 * found.runs < found.plain_runs


def test_likelihood_ratios_turn_the_proposal_back_into_the_starts() -> None:
    rng = np.random.default_rng(2)
    proposal = Proposal.stated(np.array([1.0, -0.5]), 1.3)
    z = proposal.draw(200_000, rng)
    weights = proposal.weights(z)
    assert weights.max() <= 1.0 / OWN
    # A mean weight of 1, and means and variances of the starts: standard errors are below 0.01.
    assert weights.mean() == pytest.approx(1.0, abs=0.02)
    assert (weights @ z) / len(z) == pytest.approx([0.0, 0.0], abs=0.03)
    assert (weights @ z**2) / len(z) == pytest.approx([1.0, 1.0], abs=0.05)


def test_a_density_is_that_of_scipy() -> None:
    from scipy.stats import multivariate_normal

    mean, covariance = np.array([1.0, 2.0]), np.array([[2.0, 0.3], [0.3, 0.5]])
    z = np.random.default_rng(3).standard_normal((5, 2))
    assert log_normal(z, mean, covariance) == pytest.approx(multivariate_normal(mean, covariance).logpdf(z))


def test_a_mixture_finds_two_heaps() -> None:
    rng = np.random.default_rng(5)
    z = np.concatenate([rng.normal([3, 0], 0.3, (300, 2)), rng.normal([-3, 0], 0.3, (100, 2))])
    found = fitted(z, np.ones(400), 2, rng)
    order = np.argsort(found.means[:, 0])
    assert found.means[order, 0] == pytest.approx([-3.0, 3.0], abs=0.1)
    assert found.shares[order] == pytest.approx([0.25, 0.75], abs=0.02)


def test_a_stated_proposal_in_the_wrong_place_is_doubted() -> None:
    known = linear(1e-3, 2)
    right = Proposal.stated(np.full(2, 3.09 / np.sqrt(2)))
    good = importance.estimate(known.state, 2, np.random.default_rng(6), 2000, proposal=right)
    assert good.low <= 1e-3 <= good.high and not good.doubts
    wrong = Proposal.stated(np.full(2, -2.0))
    bad = importance.estimate(known.state, 2, np.random.default_rng(6), 2000, proposal=wrong)
    assert bad.doubts


def test_no_event_has_an_upper_end_and_a_run_without_value_is_said() -> None:
    found = weighed(np.ones(1000), np.ones(1000))
    assert (found.probability, found.low) == (0.0, 0.0) and found.high == pytest.approx(0.03, rel=0.02)
    assert found.doubts == ("no run had the event",)
    values = np.where(np.arange(1000) < 100, -1.0, 1.0)
    values[500] = np.nan
    assert any("1 runs have no value" in d for d in weighed(values, np.ones(1000)).doubts)


def test_subsets_that_cannot_reach_the_event_say_so() -> None:
    found = subset.estimate(lambda z: 1.0 + np.abs(z[:, 0]), 2, np.random.default_rng(7), 40, 3)
    assert found.probability == found.low == 0.0 and found.high > 0.0
    assert "did not reach the event" in found.doubts[0]


def test_plain_sampling_needs_as_many_runs_as_it_had() -> None:
    """Its relative standard error is that of a binomial share; without an event it is unknown."""
    plain = Estimate(0.0176, 0.0141, 0.0216, 5000, ((1 - 0.0176) / (0.0176 * 5000)) ** 0.5, 0.95, "plain")
    assert plain.plain_runs == pytest.approx(5000)
    for p, error in ((0.0, np.nan), (1.0, 0.1), (0.01, 0.0)):
        assert np.isnan(Estimate(p, 0.0, 1.0, 10, error, 0.95, "plain").plain_runs)


def test_too_few_runs_are_refused() -> None:
    with pytest.raises(ValueError, match="give 20 and 3"):
        subset.estimate(lambda z: z[:, 0], 1, np.random.default_rng(1), 10, 3)
    with pytest.raises(ValueError, match="give 100"):
        importance.estimate(lambda z: z[:, 0], 1, np.random.default_rng(1), 50)


# Flights.


def scenario() -> Scenario:
    return load("paper-2-turn", ["filter_dt_s=0.1", "fdm_dt_s=0.1", "record_dt_s=1", "duration_s=9"])


def space(s: Scenario) -> Space:
    return Space.of(s, bounds(s, None, None, 0.0, 0.0, 0.0))


def test_numbers_of_a_start_become_offsets_within_the_bounds() -> None:
    of = space(scenario())
    assert numbers(of) == ["lateral-1", "lateral-2", "heading-1", "heading-2"]
    state = Flights(of, Event("distance_m", 5.0), Journal(), InProcess(), Display())
    x = state.starts(np.array([[0.0, 9.0, -9.0, 0.6744897501960817]]))
    assert x[0] == pytest.approx([0.0, 1.0, -1.0, 0.5])
    assert of.at(x[0]).start.lateral_offsets_m == pytest.approx([0.0, 10.0])


def test_interrupted_the_same_command_goes_on_and_finds_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flown: list[str] = []

    def fly(job: Any) -> dict[str, Any]:
        flown.append(job.data)
        if len(flown) == 50:
            raise KeyboardInterrupt
        start = job.scenario().start
        return {"value": 8.0 + sum(start.lateral_offsets_m or [0.0]), "refused": ""}

    monkeypatch.setattr(flights, "fly", fly)
    of, plan = space(scenario()), Plan("subset", 20, 3)
    with pytest.raises(KeyboardInterrupt):
        rare(of, Event("distance_m", 0.0), plan, tmp_path / "a", 1)
    again = rare(of, Event("distance_m", 0.0), plan, tmp_path / "a", 1)
    assert len(flown) == len(set(flown)) + 1  # the interrupted one alone was flown twice
    whole = rare(of, Event("distance_m", 0.0), plan, tmp_path / "b", 1)
    assert again.data["estimate"] == whole.data["estimate"]
    assert 0.0 < whole.data["estimate"]["probability"] < 1.0


def test_plain_flights_are_those_of_the_scenario(tmp_path: Path) -> None:
    found = rare(space(scenario()), Event("distance_m", 100.0), Plan("plain", 2), tmp_path / "p", 1)
    assert (found.data["estimate"]["probability"], found.data["estimate"]["runs"]) == (1.0, 2)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("distance=5", "unknown statistic 'distance'; did you mean distance_m"),
        ("distance_m", "give a number"),
        ("distance_m=near", "give a number"),
        ("h_m=nan", "give a number"),
    ],
)
def test_an_event_that_is_none_is_named(text: str, said: str) -> None:
    with pytest.raises(UserError, match=said):
        Event.read(text)


def test_what_draws_more_than_starts_is_refused() -> None:
    s = load("paper-2-turn", ["network.loss=0.1"])
    with pytest.raises(UserError, match=r"draws network\.loss besides its starts"):
        Event("distance_m", 5.0).check(s)
    with pytest.raises(UserError, match=r"has no \[\[fence\]\] table"):
        Event("clearance_m", 0.0).check(scenario())


def test_a_shift_of_no_number_of_a_start_is_named(tmp_path: Path) -> None:
    plan = Plan("importance", 100, shifts={"lateral-3": 1.0})
    with pytest.raises(UserError, match="lateral-3=1: a start has no such number"):
        rare(space(scenario()), Event("distance_m", 5.0), plan, tmp_path / "s", 1)


def test_mistakes_of_the_command_are_named(refusal: Callable[..., str]) -> None:
    rare_ = ("rare", "paper-2-turn", "--set", "filter_dt_s=0.1", "--set", "record_dt_s=1")
    below = (*rare_, "--below", "distance_m=5")
    assert "give the event" in refusal(*rare_)
    assert "--method subsets: give one of subset" in refusal(*below, "--method", "subsets")
    assert "--shift: belongs to --method importance" in refusal(*below, "--shift", "lateral-1=2")
    assert "--runs 5: give at least 20" in refusal(*below, "--runs", 5)
    assert "give NUMBER=DEVIATIONS" in refusal(*below, "--method", "importance", "--shift", "lateral-1=far")
    assert "every bound is 0" in refusal(*below, "--lateral", 0, "--heading", 0, "--height", 0)


def test_encounters_side_by_side_are_the_flights_of_a_run() -> None:
    spec = importlib.util.spec_from_file_location("rare_meeting", ROOT / "docs" / "rare_meeting.py")
    assert spec is not None and spec.loader is not None
    meeting = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(meeting)
    z = np.random.default_rng(3).standard_normal((3, 4))
    s = meeting.scenario()
    of = Space.of(s, bounds(s, meeting.LATERAL_M, meeting.HEADING_DEG, 0.0, 0.0, 0.0))
    state = Flights(of, Event("distance_m", meeting.LEAST_M), Journal(), InProcess(), Display())
    assert meeting.state(z)[:1] == pytest.approx(state(z[:1]), abs=1e-9)
