"""The flow filter with late and lost packets: each vehicle goes by the flows that it has received."""

from __future__ import annotations

import numpy as np
import pytest

from filters.flow.flow_filter import FlowFilter
from filters.flow.received import Received
from filters.model import Command, Limits, State, View
from tests.flow_states import DT, GAMMA, HIGH, LAGS, LOW, apart, drawn, flow_of, one_period_on

LIMITS = Limits(*(np.full(4, v) for v in (LOW[0], HIGH[0], HIGH[1], HIGH[2])))


def test_a_flow_received_late_is_the_flow_of_who_has_evaded_since() -> None:
    """Two fly gamma: their flow of three periods ago, carried on, is where their flow of now takes them."""
    flow = flow_of(2)
    state, rates, queued = drawn(np.random.default_rng(4), 2, flow.depth)
    received, both, age = Received(flow), np.array([0, 1]), 3 * DT * (1 - np.eye(2))
    for _ in range(3):
        own = flow.roll(flow.begin(state, rates, queued, flow.times(rates)), flow.gamma)
        received.images(own, both[:0], both[:0], age)
        state, rates, queued = one_period_on(flow, state, rates, queued, flow.gamma)
    now = flow.roll(flow.begin(state, rates, queued, DT * np.arange(1.0, 201.0)), flow.gamma)
    expected = received.images(now, both, both[::-1], age)
    assert np.abs(expected.at - now.at[::-1]).max() < 1e-3  # of the circle, 80 m; settled to 1e-6 rad/s
    assert np.abs(expected.z - now.z[::-1]).max() < 1e-3
    assert np.abs(expected.centre + expected.arm - now.at[::-1, -1]).max() < 1e-3
    left = now.turned - now.turned[:, -1:]
    assert np.abs((expected.turned - expected.turned[:, -1:]) - left[::-1]).max() < 1e-5


def test_a_packet_lost_for_long_is_still_gone_by() -> None:
    """Of forty periods one vehicle hears only the first packet of the other; ages go on growing."""
    flow = flow_of(2)
    state, rates, queued = drawn(np.random.default_rng(5), 2, flow.depth)
    received, i, j = Received(flow), np.array([0, 1]), np.array([1, 0])
    for step in range(40):
        own = flow.roll(flow.begin(state, rates, queued, flow.times(rates)), flow.gamma)
        seen = received.images(own, i, j, np.array([[0.0, step * DT], [0.0, 0.0]]))
        assert np.array_equal(seen.at[1], own.at[0])
        state, rates, queued = one_period_on(flow, state, rates, queued, flow.gamma)
    assert np.abs(seen.centre[0] - own.centre[1]) < 1e-3


def flown(seed: int, late: int, loss: float, steps: int = 100) -> tuple[float, float]:
    """Four that meet in the middle on their own model: the least clearance of their true flows [m], and the
    least share of it that one period leaves, of pairs with more than 5 cm."""
    n, rng = 4, np.random.default_rng(seed)
    flow, i, j = flow_of(n), *np.triu_indices(n, 1)
    chosen = FlowFilter([LAGS], Command.of(np.tile(GAMMA, (n, 1))), 5.0, DT)
    angle = np.arange(n) * 2 * np.pi / n
    state = State(
        110 * np.cos(angle), 110 * np.sin(angle), angle + np.pi + rng.uniform(-0.1, 0.1, n), 0 * angle
    )
    rates = np.tile([18.0, 0.0, 0.0], (n, 1))
    queued, least, lost = np.repeat(rates[None], flow.depth, axis=0), np.inf, np.zeros((n, n))
    before, left = np.zeros(i.size), np.inf
    links = np.random.default_rng(seed + 1)
    for _ in range(steps):
        path = flow.roll(flow.begin(state, rates, queued, flow.times(rates)), flow.gamma)
        least = min(least, float(apart(path, i, j).min()))
        aim = np.angle(np.exp(1j * (np.arctan2(-state.y, -state.x) - state.theta)))
        wanted = np.stack(
            [rng.uniform(15, 25, n), np.clip(aim, -0.2, 0.2) + rng.normal(0, 0.1, n), rng.uniform(-2, 2, n)],
            axis=-1,
        )
        lost = np.where(links.random((n, n)) < loss, lost + 1, 0.0)
        age = (late + lost) * DT * ~np.eye(n, dtype=bool)
        seen = View(state, Command.of(rates), None, age if late or loss else None)
        u = chosen(seen, Command.of(wanted), LIMITS).command.array()
        now = chosen.clearance[i, j]
        some = before > 0.05
        left = min(left, float(np.min(now[some] / before[some], initial=np.inf)))
        before = now
        state, rates, queued = one_period_on(flow, state, rates, queued, u)
    return least - 5.0, left


@pytest.mark.parametrize("late, loss", [(0, 0.1), (2, 0.0), (2, 0.1)])
def test_late_and_lost_packets_take_none_of_the_clearance(late: int, loss: float) -> None:
    """Two periods late and a tenth lost: the ladder's values at 20 Hz, on the model itself."""
    least, left = flown(1, late, loss)
    assert least >= -0.07  # what phases 0.01 rad apart may miss
    if not loss:
        # The largest root of x^3 - 0.95 x^2 + 0.05: docs/guide/flow.md.
        assert left >= 0.8863


def test_packets_half_a_second_old_leave_less_of_the_clearance() -> None:
    """Beyond four periods at kappa = 0.1 the bound is none: a period takes more than it says for two."""
    assert flown(2, 10, 0.0)[1] < 0.85


def test_packets_without_age_change_nothing() -> None:
    """Every packet of this very period: the commands are those of the belief that all share."""
    rng = np.random.default_rng(9)
    gamma = Command.of(np.tile(GAMMA, (4, 1)))
    one, two = (FlowFilter([LAGS], gamma, 5.0, DT) for _ in range(2))
    changed = 0
    for _ in range(8):
        state, rates, _ = drawn(rng, 4, 0)
        state = State(0.4 * state.x, 0.4 * state.y, state.theta, state.z)
        nominal = Command.of(rng.uniform(LOW, HIGH, (4, 3)))
        a = one(View(state, Command.of(rates)), nominal, LIMITS)
        b = two(View(state, Command.of(rates), None, np.zeros((4, 4))), nominal, LIMITS)
        assert np.abs(a.command.array() - b.command.array()).max() < 1e-9
        changed += int(a.override.sum())
    assert changed > 3
    for name, seen in one.record.checks.items():
        assert seen.worst == pytest.approx(two.record.checks[name].worst, abs=1e-9)
