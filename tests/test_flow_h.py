"""The flow filter keeps the paper's h along its flow, and climbs apart where nothing else is left."""

from __future__ import annotations

import numpy as np
import pytest

from aircraft.kinematic import KinematicFleet
from filters.flow.flow_filter import FlowFilter
from filters.flow.phases import Phases
from filters.flow.reach import furthest
from filters.flow.rollout import Paths
from filters.flow.separation import Kept, rows, samples
from filters.model import Command, Limits, State, View
from tests.flow_states import DT, GAMMA, HIGH, LAGS, LOW, drawn, flow_of

LEVEL, KAPPA, CIRCLE = 7.0, 0.2, 6.5
I, J = np.array([0]), np.array([1])
LIMITS = Limits(*(np.full(2, v) for v in (LOW[0], HIGH[0], HIGH[1], HIGH[2])))
GAMMAS = Command.of(np.tile(GAMMA, (2, 1)))


def h_along(paths: Paths, state: State) -> np.ndarray:
    """Least distances (..., M) m of the pair, were gamma followed at once from each instant on: eq. (16)."""
    radius = GAMMA[0] / GAMMA[1]
    course = state.theta[:, None] + paths.turned
    centre = paths.at + 1j * radius * np.exp(1j * course)
    arm = -1j * radius * np.exp(1j * course)
    level = np.abs(centre[..., 0, :] - centre[..., 1, :]) - np.abs(arm[..., 0, :] - arm[..., 1, :])
    return np.hypot(level, paths.z[..., 0, :] - paths.z[..., 1, :])


@pytest.mark.parametrize("step", [0, 1, 2])
def test_whoever_keeps_its_rows_leaves_h_of_every_third_instant(step: int) -> None:
    flow, near = flow_of(2), 0
    rng = np.random.default_rng(step)
    for _ in range(20):
        state, rates, queued = drawn(rng, 2, flow.depth)
        state = State(0.15 * state.x, 0.15 * state.y, state.theta, state.z)
        begun = flow.begin(state, rates, queued, flow.times(rates))
        box = [np.tile(x, (2, 1)) for x in (LOW, HIGH)]
        gamma, lower, upper = flow.covered(begun, np.stack([flow.gamma, *box]))
        reach = furthest(begun, gamma, lower, upper, True)
        base = flow.paths(begun, gamma)
        kept = Kept(LEVEL, KAPPA, Phases(GAMMA[1] * DT), 0.0, CIRCLE, step)
        made = rows(samples(base, I, J, kept, reach), kept, reach)
        wish = np.where(rng.random((60, 2, 3)) < 0.5, LOW, HIGH)
        fails = made.displacement(flow.roll(begun, wish), base) < made.least
        keeps = ~np.stack([fails[:, made.vehicle == v].any(axis=1) for v in (0, 1)], axis=-1)
        u = np.where(keeps[..., None], wish, flow.gamma)
        before = h_along(base, state) - CIRCLE
        after = h_along(flow.roll(begun, u), state) - CIRCLE
        instants = np.arange((-1 - step) % 3, before.size, 3)
        promised = np.where(before > 0, (1 - KAPPA) * before, before)[instants]
        # The grid of phases lies up to 0.005 rad beside the nearest one.
        assert np.all(after[:, instants] >= promised - 0.05)
        near += int(np.any(~keeps))
    assert near > 2


def test_without_the_rows_h_is_lost() -> None:
    """Four meet in the middle: they keep clear on the flow of lags either way, and h only if it is asked."""
    n, found = 4, {}
    i, j = np.triu_indices(n, 1)
    angle = np.arange(n) * 2 * np.pi / n + np.array([0.0, 0.1, -0.05, 0.03])
    limits = Limits(*(np.full(n, v) for v in (LOW[0], HIGH[0], HIGH[1], HIGH[2])))
    for margin in (None, 1.0):
        fleet = KinematicFleet(n, DT / 2, [LAGS])
        start = State.of(np.stack([120 * np.cos(angle), 120 * np.sin(angle), angle + np.pi, 0 * angle], -1))
        fleet.reset(start, np.random.default_rng(0), np.zeros((n, 3)), np.full(n, 20.0))
        gammas = Command.of(np.tile(GAMMA, (n, 1)))
        chosen = FlowFilter([LAGS], gammas, 5.0, DT, kappa=0.5, h_margin=margin)
        least = np.inf
        for _ in range(110):
            state = fleet.state()
            aim = np.arctan2(-start.y - state.y, -start.x - state.x) - state.theta
            wanted = Command(np.full(n, 20.0), np.clip(np.sin(aim), -0.227, 0.227), np.zeros(n))
            fleet.step(chosen(View(state, fleet.achieved()), wanted, limits).command, np.zeros((n, 3)), 2)
            now = fleet.state()
            swing = 1j * GAMMA[0] / GAMMA[1] * np.exp(1j * now.theta)
            centre = now.x + 1j * now.y + swing
            level = np.abs(centre[i] - centre[j]) - np.abs(swing[i] - swing[j])
            least = min(least, float(np.hypot(level, now.z[i] - now.z[j]).min()) - 5.0)
        found[margin] = least
    assert found[1.0] > 0.9 and found[None] < 0.5, found


@pytest.mark.parametrize("height", [0.0, -0.1, 0.5])
def test_two_that_meet_under_gamma_climb_apart_where_nothing_else_is_left(height: float) -> None:
    """No level displacement leads away at all phases, and both want to cross the other's height."""
    radius, apart = GAMMA[0] / GAMMA[1], 100.0
    turned = 2 * np.arcsin(apart / (2 * radius))  # the arms differ by what the centres are apart
    place = 1j * radius + apart - 1j * radius * np.exp(1j * turned)
    start = State.of([[0.0, 0.0, 0.0, height], [place.real, place.imag, turned, 0.0]])
    fleet = KinematicFleet(2, DT / 2, [LAGS])
    fleet.reset(start, np.random.default_rng(0), np.zeros((2, 3)), np.full(2, GAMMA[0]))
    chosen = FlowFilter([LAGS], GAMMAS, 5.0, DT, margin=2.0, kappa=0.2)
    across = 3.0 if height < 0 else -3.0
    for _ in range(50):
        wanted = Command(np.full(2, 20.0), np.full(2, -0.2), np.array([across, -across]))
        u = chosen(View(fleet.state(), fleet.achieved()), wanted, LIMITS).command
        fleet.step(u, np.zeros((2, 3)), 2)
    assert float(np.nanmin(chosen.clearance)) > -1.0  # -7 m at the start
