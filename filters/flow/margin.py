"""Bounds what the flow filter's model leaves open: between its samples, and where vehicles fly otherwise.

The clearance s loses what the samples miss once, and what a period's prediction is off in every period:
s after a period is at least (1 - kappa) s and the change of the distance that nobody predicted. If no such
change is larger than eps, s stays above -eps / kappa, for changes that are all of the largest size and of one
sign. They alternate: what they add up to in a flight, each (1 - kappa) times the one after it, is less.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from filters.flow.channels import Channels
from filters.flow.rollout import Flow, Paths
from filters.model import Array, State

# Phases of the circle at which errors are added up, and instants of the transient.
_PHASES, _INSTANTS = 90, 160


def between_samples(least: float, channels: Channels, lower: Array, upper: Array, dt: float) -> float:
    """How near [m] a pair may come between instants dt apart at which it is at least `least` apart.

    lower, upper  (3,) or (N, 3), what the channels can be at

    A path that is accelerated by at most A leaves its chord by A dt^2 / 8 at most, and a chord of length L
    between two points at least D from a third is at least sqrt(D^2 - L^2 / 4) from it.
    """
    chord, sag = _moved(channels, lower, upper, dt)
    return float(np.sqrt(max(least**2 - 0.25 * chord**2, 0.0))) - sag


def grid_margin(d_safe: float, channels: Channels, lower: Array, upper: Array, dt: float) -> float:
    """The margin [m] with which pairs that keep it at the samples keep d_safe between them."""
    chord, sag = _moved(channels, lower, upper, dt)
    return float(np.sqrt((d_safe + sag) ** 2 + 0.25 * chord**2)) - d_safe


def _moved(channels: Channels, lower: Array, upper: Array, dt: float) -> tuple[float, float]:
    """How far [m] a pair moves against each other in dt, and how far from the chord."""
    most = np.maximum(np.abs(lower), np.abs(upper))
    fastest = np.broadcast_to(most, channels.constant.shape)
    # A channel's rate is bounded by its limit, and by what is left to go.
    rate = np.minimum(np.maximum(channels.rise, channels.fall), (upper - lower) / channels.constant)
    pull = np.sqrt(rate[:, 0] ** 2 + (fastest[:, 0] * fastest[:, 1]) ** 2 + rate[:, 2] ** 2)
    speed = np.sqrt(fastest[:, 0] ** 2 + fastest[:, 2] ** 2)
    chord = 2 * float(speed.max()) * dt
    return chord, 2 * float(pull.max()) * dt**2 / 8


@dataclass(frozen=True)
class ModelError:
    """What the model was off in a flight [m], at samples where pairs were near.

    one_step     eps, the largest change of a distance along the flow that a period before did not predict
    accumulated  how much of a clearance such changes took, each (1 - kappa) times the one after it
    """

    one_step: float
    accumulated: float


class ErrorSum:
    """Adds up by how much the distances along the flow differ from what was predicted a period before.

    level  m, Ds + m; pairs are near at samples at which they are less than `near` further apart than that
    """

    def __init__(self, flow: Flow, kappa: float, level: float, near: float = 5.0) -> None:
        self._flow, self._kappa, self._near = flow, kappa, level + near
        self._i, self._j = np.triu_indices(len(flow.gamma), 1)
        self._sum = np.zeros((self._i.size, _INSTANTS - 1 + _PHASES))
        self._before: Array | None = None
        self._steps = 0
        self.error = ModelError(0.0, 0.0)
        self._times: Array = np.asarray(flow.dt * np.arange(1.0, _INSTANTS + 1))

    def see(self, state: State, rates: Array, queued: Array, u: Array) -> None:
        """One period: states, rates believed (N, 3), commands given (depth, N, 3), and the next (N, 3)."""
        flow = self._flow
        begun = flow.begin(state, rates, queued, self._times)
        paths = flow.roll(begun, np.stack([flow.gamma, u]))
        now = self._distances(paths[0], slice(None, -1))
        if self._before is not None:
            self._add(now - self._before, now < self._near)
        # Both are of the circle's arms at the last instant, which turn on with every period.
        self._before = self._distances(paths[1], slice(1, None))
        self._steps += 1

    def _distances(self, paths: Paths, instants: slice) -> Array:
        """Of the pairs, at the instants and at phases that stand still on the circles."""
        i, j = self._i, self._j
        turned = self._flow.gamma[0, 1] * self._flow.dt * self._steps
        turn = np.exp(1j * (np.arange(_PHASES) * (2 * np.pi / _PHASES) - turned))
        circle = (paths.centre[i] - paths.centre[j])[:, None] + (paths.arm[i] - paths.arm[j])[:, None] * turn
        level = np.concatenate([(paths.at[i] - paths.at[j])[:, instants], circle], axis=1)
        height = paths.z[i] - paths.z[j]
        up = np.concatenate([height[:, instants], np.repeat(height[:, -1:], _PHASES, axis=1)], axis=1)
        return np.asarray(np.sqrt(level.real**2 + level.imag**2 + up**2))

    def _add(self, change: Array, near: NDArray[np.bool_]) -> None:
        # What was an instant's sum is now that of the instant before.
        few = _INSTANTS - 2
        self._sum[:, :few] = self._sum[:, 1 : few + 1]
        self._sum = (1 - self._kappa) * self._sum + change
        one = float(np.where(near, np.abs(change), 0.0).max(initial=0.0))
        taken = float(np.where(near, -self._sum, 0.0).max(initial=0.0))
        self.error = ModelError(max(self.error.one_step, one), max(self.error.accumulated, taken))
