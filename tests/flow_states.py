"""States, commands and steps on the flow filter's model, for its tests."""

from __future__ import annotations

import numpy as np

from aircraft.kinematic import Lag
from filters.flow.channels import Channels
from filters.flow.rollout import Flow, Paths
from filters.model import State

# The X8's identified channels.
LAGS = (Lag(0.32, 0.159, -1.76, 3.55), Lag(0.217, 0.083, -0.598, 0.598), Lag(0.147, 0.137, -6.57, 10.9))
LOW, HIGH = np.array([15.0, -0.227, -3.9]), np.array([25.0, 0.227, 3.9])
DT = 0.05
GAMMA = np.array([16.0, 0.2, 0.0])


def flow_of(n: int, lags: tuple[Lag, ...] = LAGS, dt: float = DT) -> Flow:
    return Flow(Channels.of([lags], n), np.tile(GAMMA, (n, 1)), dt)


def drawn(rng: np.random.Generator, n: int, depth: int) -> tuple[State, np.ndarray, np.ndarray]:
    """States, rates (n, 3) and queued commands (depth, n, 3)."""
    poses = np.stack(
        [
            rng.uniform(-200, 200, n),
            rng.uniform(-200, 200, n),
            rng.uniform(-3, 3, n),
            rng.uniform(-5, 5, n),
        ],
        axis=-1,
    )
    return State.of(poses), rng.uniform(LOW, HIGH, (n, 3)), rng.uniform(LOW, HIGH, (depth, n, 3))


def one_period_on(
    flow: Flow, state: State, rates: np.ndarray, queued: np.ndarray, u: np.ndarray
) -> tuple[State, np.ndarray, np.ndarray]:
    """State, rates and queue after one period with u commanded: each channel hears one change within it."""
    channels, queue = flow.channels, np.concatenate([u[None], queued])
    back = np.floor(channels.delay / flow.dt + 1e-9).astype(int)
    until = channels.delay - back * flow.dt
    heard = [np.take_along_axis(queue, at[None], axis=0)[0] for at in (back + 1, back)]
    first = channels.towards(rates, heard[0])
    middle = first.value(until)
    second = channels.towards(middle, heard[1])
    turned = first.integral(until[..., None]) + second.integral((flow.dt - until)[..., None])
    paths = flow.roll(flow.begin(state, rates, queued, flow.times(rates)), u)
    now = State(paths.at[:, 0].real, paths.at[:, 0].imag, state.theta + turned[:, 1, 0], paths.z[:, 0])
    return now, second.value(flow.dt - until), queue[:-1]


def apart(paths: Paths, i: np.ndarray, j: np.ndarray) -> np.ndarray:
    """Distances (P, M) m of pairs at the instants."""
    return np.hypot(np.abs(paths.at[i] - paths.at[j]), paths.z[i] - paths.z[j])


def around(paths: Paths, i: np.ndarray, j: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """Distances (..., P, F) m of pairs at phases [rad] of the circle; the paths may have leading axes."""
    centre = paths.centre[..., i] - paths.centre[..., j]
    arm = paths.arm[..., i] - paths.arm[..., j]
    height = paths.z[..., i, -1] - paths.z[..., j, -1]
    return np.hypot(np.abs(centre[..., None] + arm[..., None] * np.exp(1j * phase)), height[..., None])
