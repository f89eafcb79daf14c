"""Models of command channels: closed forms, the choice among them, and intervals that cover."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from aircraft.airframes.best_model import Best
from aircraft.airframes.schema import Channel
from aircraft.autopilots.channel_family import LEVEL, choose, fitted
from aircraft.autopilots.channel_models import KINDS, OF_CHANNEL, PARAMETERS, Steps, names, simulate
from aircraft.autopilots.identification import model

TRUE: dict[str, dict[str, float]] = {
    "first order": {"time_constant_s": 0.4, "delay_s": 0.15, "falls": 9.0, "rises": 9.0},
    "short turn": {"time_constant_s": 0.4, "delay_s": 0.15, "falls": 9.0, "rises": 9.0, "share": 0.92},
    "second order": {"radps": 4.0, "damping": 0.7, "delay_s": 0.1},
    "tracked loop": {"time_constant_s": 0.4, "delay_s": 0.2, "loop_s": 1.5, "forward": 0.7},
}


def steps(before: Any, after: Any, n: int = 300, dt: float = 0.02) -> Steps:
    b, a = np.array(before, dtype=float), np.array(after, dtype=float)
    return Steps(b, a, np.zeros((len(b), n)), dt)


def brute(kind: str, v: dict[str, float], s: Steps, sub: int) -> np.ndarray:
    """The differential equations by small steps of Euler."""
    h, y, rate = s.dt / sub, s.before.copy(), np.zeros(len(s.before))
    goal, behind, out = s.before + v.get("share", 1.0) * (s.after - s.before), np.zeros(len(y)), []
    if kind == "tracked loop":
        behind = (1 - v["forward"]) * s.before * v["loop_s"]
    for k in range(s.flown.shape[1] * sub):
        on = (k + 0.5) * h > v["delay_s"]
        g, u = (goal, s.after) if on else (s.before, s.before)
        if kind == "second order":
            rate = rate + h * (v["radps"] ** 2 * (g - y) - 2 * v["damping"] * v["radps"] * rate)
            y = y + h * rate
        elif kind == "tracked loop":
            dy = (v["forward"] * u + behind / v["loop_s"] - y) / v["time_constant_s"]
            behind, y = behind + h * (u - y), y + h * dy
        else:
            y = y + h * np.clip((g - y) / v["time_constant_s"], -v["falls"], v["rises"])
        if k % sub == sub - 1:
            out.append(y.copy())
    return np.array(out).T


@pytest.mark.parametrize(
    ("kind", "changes"),
    [
        ("first order", {"falls": 3.0, "rises": 2.0}),
        ("short turn", {}),
        ("second order", {}),
        ("second order", {"damping": 1.0}),  # equal roots
        ("second order", {"damping": 3.0}),
        ("tracked loop", {}),
        ("tracked loop", {"loop_s": 9.0, "forward": 0.2}),
    ],
)
def test_closed_forms_are_the_differential_equations(kind: str, changes: dict[str, float]) -> None:
    s = steps([16.0, 20.0, 0.0], [20.0, 15.0, 2.0], n=100)
    values = TRUE[kind] | changes
    # Euler's error, 1.5e-3 here, halves with its step
    assert np.abs(simulate(kind, values, s) - brute(kind, values, s, 100)).max() < 3e-3


def test_the_first_order_is_the_one_that_the_lagged_plant_flies() -> None:
    s = steps([16.0, 20.0], [20.0, 15.0], n=400, dt=0.005)
    v = TRUE["first order"] | {"rises": 2.0}
    flown = model(s.before, s.after, v["time_constant_s"], v["delay_s"], v["falls"], v["rises"], 400, 0.005)
    # bounded steps of 5 ms against the closed form
    assert np.abs(simulate("first order", v, s) - flown).max() < 0.01


@settings(max_examples=40, deadline=None)
@given(
    kind=st.sampled_from(KINDS),
    scale=st.floats(0.2, 5.0),
    before=st.floats(-5, 25),
    size=st.floats(0.1, 8).flatmap(lambda x: st.sampled_from([x, -x])),
)
def test_every_model_begins_at_rest_ends_at_its_goal_and_scales(
    kind: str, scale: float, before: float, size: float
) -> None:
    values = {k: v if k in ("share", "damping", "forward") else v * scale for k, v in TRUE[kind].items()}
    values |= {k: 1e3 for k in ("falls", "rises") if k in values}
    s = steps([before, 0.0], [before + size, 1.0], n=500, dt=0.4 * scale)
    y = simulate(kind, values, s)
    early = simulate(kind, values, steps([before], [before + size], n=3, dt=0.3 * values["delay_s"]))
    assert np.allclose(early, before, atol=1e-9)
    share = values.get("share", 1.0)
    assert y[0, -1] == pytest.approx(before + share * size, abs=1e-6 * (1 + abs(size)))
    assert np.allclose((y[0] - before) / size, y[1], atol=1e-9)
    # many sets of values at once are each as alone
    both = {k: np.array([v, 1.1 * v]) for k, v in values.items()}
    assert np.allclose(simulate(kind, both, s)[0], y)


def noisy(kind: str, rng: np.random.Generator, count: int, after: list[float]) -> Steps:
    """Steps of a known plant whose values differ from step to step by 5 %, with slow noise of 3 %."""
    blank = steps(np.zeros(count), rng.choice(after, count))
    varied = {k: v * np.exp(0.05 * rng.standard_normal(count)) for k, v in TRUE[kind].items()}
    # (count, count, n): the values of each step on every step, of which its own is taken
    flown = simulate(kind, varied, blank)[np.arange(count), np.arange(count)]
    noise = np.empty_like(flown)
    noise[:, 0] = rng.standard_normal(count)
    for k in range(1, flown.shape[1]):
        noise[:, k] = 0.9 * noise[:, k - 1] + np.sqrt(1 - 0.81) * rng.standard_normal(count)
    return Steps(blank.before, blank.after, flown + 0.03 * blank.size[:, None] * noise, blank.dt)


@pytest.mark.parametrize("kind", ["first order", "second order", "tracked loop"])
def test_intervals_cover_what_is_true_and_the_right_kind_is_chosen(kind: str) -> None:
    """Of eight plants; `make soak` tries 200, where 86 to 94 % of the intervals hold what is true."""
    held, chosen = [], 0
    for seed in range(8):
        rng = np.random.default_rng(7000 + seed)
        fits, checks = (noisy(kind, rng, n, [2.0, 3.9, -1.5]) for n in (9, 3))
        best, tried = choose("zeta", fits, checks)
        chosen += best.kind == kind
        mine = next(f for f in tried if f.kind == kind)
        known = [k for k in mine.low if k not in ("falls", "rises")]
        held += [mine.low[k] <= TRUE[kind][k] <= mine.high[k] for k in known]
    assert len(held) >= 14 and chosen >= 6
    # residuals that are taken as white hold 0.4
    assert 0.65 < np.mean(held) <= 1.0, np.mean(held)


def test_a_turn_that_ends_short_is_not_mistaken_for_a_slow_one() -> None:
    rng = np.random.default_rng(7)
    fits, checks = (noisy("short turn", rng, n, [0.2, -0.2, 0.1]) for n in (12, 4))
    best, tried = choose("omega", fits, checks)
    assert best.kind == "short turn" and best.values["share"] == pytest.approx(0.92, abs=0.03)
    plain = next(f for f in tried if f.kind == "first order")
    assert best.validation < 0.8 * plain.validation
    assert [f.kind for f in tried] == list(OF_CHANNEL["omega"])


def test_a_limit_that_is_never_reached_has_no_interval_and_one_that_is_has() -> None:
    s = steps([0.0] * 6, [4.0, 3.0, 5.0, -4.0, -3.0, -5.0])
    rng = np.random.default_rng(1)
    true = TRUE["first order"] | {"rises": 3.0, "falls": 50.0}
    flown = simulate("first order", true, s) + 0.01 * rng.standard_normal(s.flown.shape)
    found = fitted(
        "first order", "zeta", Steps(s.before, s.after, flown, s.dt), Steps(s.before, s.after, flown, s.dt)
    )
    assert "rises" in found.low and "falls" not in found.low
    assert found.values["rises"] == pytest.approx(3.0, rel=0.02)


def test_steps_without_size_are_refused() -> None:
    s = steps([0.0, 1.0], [0.0, 2.0])
    with pytest.raises(ValueError, match="from a value to the same value"):
        choose("zeta", s, s)


def test_todays_files_are_read_and_a_wrong_table_is_named() -> None:
    assert Channel(time_constant_s=0.3).best is None
    good = {"kind": "second order", "validation_rms": 0.02, "values": {"radps": 2.0}}
    assert Best(**good, low={"radps": 1.8}, high={"radps": 2.1}).values == {"radps": 2.0}
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"kind": "third order"}, "kind"),
        ({"values": {"radps": -1.0}}, "values"),
        ({"low": {"radps": 1.8}}, "low and high are of the same parameters"),
        ({"low": {"radps": 2.2}, "high": {"radps": 2.4}}, "low, values and high of radps"),
        ({"low": {"tau": 1.0}, "high": {"tau": 2.0}}, "low, values and high of tau"),
    ]
    for change, said in wrong:
        with pytest.raises(ValidationError, match=said):
            Best(**(good | change))
    for kind in KINDS:
        assert set(names(kind, "omega")) == set(PARAMETERS[kind]) and LEVEL == 0.9
