"""Identifies delay, lag and rate limits of each channel on the steps of a flight log.

The model is the channel of `aircraft.kinematic`: first order after a delay, its rate bounded. It hears the
command as it was logged. Course rates are means over 0.2 s, of the log and of the model alike, so that the
mean itself is no lag.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aircraft.logs.events import Event
from aircraft.logs.record import CHANNELS, GRID_S, RATE_SPAN_S, FlightLog, mean_rate
from filters.model import Array

_SHORTEST_S = 1e-3
_EVALUATIONS = 60


@dataclass(frozen=True)
class Fit:
    """A channel identified on `steps` steps.

    time_constant_s, delay_s
    rate_min, rate_max  largest fall and rise, the channel's unit per second
    misfit              rms of (model - flown) / size of the step
    held_out            the same on a third of the steps, fitted on the others; None with fewer than six
    reached             whether the fit ran into its fall and rise: a limit never reached is only a bound
    """

    channel: str
    steps: int
    time_constant_s: float
    delay_s: float
    rate_min: float
    rate_max: float
    misfit: float
    held_out: float | None
    reached: tuple[bool, bool]


def fit(log: FlightLog, found: Sequence[Event], channel: int) -> Fit | None:
    """The channel's lag from its events, None without any."""
    mine = [e for e in found if e.channel == channel]
    if not mine:
        return None
    best = _best(log, mine, channel)
    held_out = None
    if len(mine) >= 6:
        # Any third, but always the same: test flights repeat their steps in a fixed order.
        out = set(np.random.default_rng(0).permutation(len(mine))[: len(mine) // 3].tolist())
        others = _best(log, [e for k, e in enumerate(mine) if k not in out], channel)
        held_out = _Steps(log, [e for k, e in enumerate(mine) if k in out], channel).misfit(others)
    steps = _Steps(log, mine, channel)
    t, delay, falls, rises = best.tolist()
    down, up = steps.extremes(best)
    reached = (down <= -falls * (1 - 1e-6), up >= rises * (1 - 1e-6))
    name = CHANNELS[channel]
    return Fit(name, len(mine), t, delay, -falls, rises, steps.misfit(best), held_out, reached)


def _best(log: FlightLog, mine: Sequence[Event], channel: int) -> Array:
    """Time constant, delay, largest fall and rise that fit best in least squares."""
    from scipy.optimize import least_squares

    steps = _Steps(log, mine, channel)
    fastest = max(steps.fastest, 1e-3)
    best = None
    for share, limit in ((0.8, 1.2), (0.3, 4.0)):
        guess = np.log([share * steps.lag, (1 - share) * steps.lag, limit * fastest, limit * fastest])
        low = np.log([_SHORTEST_S, _SHORTEST_S, 0.05 * fastest, 0.05 * fastest])
        high = np.log([30.0, 1.0, 100 * fastest, 100 * fastest])
        tried = least_squares(
            lambda logs: steps.errors(np.exp(logs)),
            np.clip(guess, low + 1e-6, high - 1e-6),
            bounds=(low, high),
            diff_step=1e-4,
            max_nfev=_EVALUATIONS,
        )
        if best is None or tried.cost < best.cost:
            best = tried
    assert best is not None
    return np.asarray(np.exp(best.x))


def _half() -> int:
    """Rows by which a mean course rate reaches to either side."""
    return round(RATE_SPAN_S / GRID_S / 2)


class _Steps:
    """Events of one channel as padded arrays (S, n)."""

    def __init__(self, log: FlightLog, mine: Sequence[Event], channel: int) -> None:
        self._turning = CHANNELS[channel] == "omega"
        # Heard from a second before the step, so that delays reach back into what was asked before.
        lead = round(1.0 / GRID_S)
        n = max(e.end - e.begin for e in mine)
        at = np.stack([e.begin + np.arange(-lead, n) for e in mine])
        last = np.array([[e.end - 1] for e in mine])
        asked = log.command[np.clip(at, 0, last), channel]
        first = np.nan_to_num(asked[:, lead], nan=0.0)
        self._asked = np.where(np.isfinite(asked), asked, first[:, None])
        self._lead, self._n = lead, n
        flown = log.response[np.clip(at, 0, last), channel]
        self._flown = flown[:, lead:]
        self._kept = (at[:, lead:] <= last) & np.isfinite(self._flown)
        if self._turning:
            self._kept[:, -_half() :] = False
        self._size = np.array([[abs(e.size)] for e in mine])
        # Before the step, and so early that the mean over 0.2 s does not reach beyond it.
        before = flown[:, lead - round(0.45 / GRID_S) : lead - round(0.15 / GRID_S)]
        self._begin = np.nanmean(np.where(np.isfinite(before), before, first[:, None]), axis=1)
        known = np.abs(np.diff(self._flown, axis=1)[self._kept[:, 1:] & self._kept[:, :-1]]) / GRID_S
        self.fastest = float(np.quantile(known, 0.999)) if known.size else 1.0
        # The area between command and response is the step times delay and lag together.
        missing = (self._asked[:, lead:] - self._flown) / np.array([[e.size] for e in mine])
        area = np.nansum(np.where(self._kept, missing, 0.0), axis=1) * GRID_S
        self.lag = float(np.clip(np.median(area), 0.02, 10.0))

    def model(self, parameters: Array) -> Array:
        """The channel's value (S, n) at the grid's instants from the step on."""
        t, delay, falls, rises = parameters.tolist()
        share = -np.expm1(-GRID_S / max(t, _SHORTEST_S))
        back = min(delay / GRID_S, self._lead - 1.0)
        whole = int(back)
        part = back - whole
        start = self._lead - whole
        heard = self._asked[:, start : start + self._n]
        if part:
            earlier = self._asked[:, start - 1 : start - 1 + self._n]
            heard = heard + part * (earlier - heard)
        out = np.empty_like(heard)
        y = self._begin.copy()
        low, high = -falls * GRID_S, rises * GRID_S
        for k in range(self._n):
            out[:, k] = y
            y = y + np.clip(share * (heard[:, k] - y), low, high)
        return out

    def misfit(self, parameters: Array) -> float:
        """Root mean square of the model's error, in shares of the step."""
        return float(np.sqrt(np.mean(self.errors(parameters) ** 2)))

    def errors(self, parameters: Array) -> Array:
        """The model's errors at all known instants, in shares of the step."""
        y = self.model(parameters)
        if self._turning:
            # The trapezium is exact to second order, as the grid is fine. Before the step the rate is steady.
            early = np.repeat(y[:, :1], _half(), axis=1)
            y = np.concatenate([early, y], axis=1)
            turned = np.cumsum(0.5 * (y[:, 1:] + y[:, :-1]) * GRID_S, axis=1)
            y = mean_rate(np.concatenate([np.zeros((len(y), 1)), turned], axis=1))[:, _half() :]
        error = (y - self._flown) / self._size
        return np.asarray(error[self._kept])

    def extremes(self, parameters: Array) -> tuple[float, float]:
        """Steepest fall and rise [unit/s] of the model."""
        slope = np.diff(self.model(parameters), axis=1) / GRID_S
        return float(slope.min()), float(slope.max())
