"""Chooses the model of a command channel that predicts other manoeuvres best, and says how sure it is.

Each of the family is fitted to some steps by least squares; the one with the least error on held-out steps is
chosen, the simplest of those within 2 % of it. Intervals are of a jackknife over manoeuvres: what each
parameter would be without one step, to first order. They hold what differs from step to step - noise, and
what the aircraft does otherwise at another speed - and assume that the steps flown are a sample of those to
come.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aircraft.autopilots.channel_models import BOUNDS, OF_CHANNEL, Steps, names, simulate

Array = NDArray[np.floating[Any]]

LEVEL = 0.9  # of the intervals
_NEAR = 1.02  # errors within this ratio of the least are equal: the simplest is taken
_STEP = 1e-4  # of a parameter's logarithm, for derivatives
_EVALUATIONS = 60
# A parameter that moves the answer by less, in shares of the step for a factor e, is not seen; nor is one
# whose interval reaches over more than a factor of 20 to either side.
_UNSEEN, _WIDEST = 1e-3, 3.0


@dataclass(frozen=True)
class FittedModel:
    """A model fitted to the steps of a channel.

    values         by parameter name: see `channel_models.PARAMETERS`
    low, high      bounds that hold each with probability LEVEL; without those that no step shows
    misfit         rms error on the steps that it was fitted to, as a share of the step
    validation     the same on held-out steps
    """

    kind: str
    values: dict[str, float]
    low: dict[str, float]
    high: dict[str, float]
    misfit: float
    validation: float


def choose(channel: str, fits: Steps, checks: Steps) -> tuple[FittedModel, list[FittedModel]]:
    """The chosen model, and all that were tried, the simplest first.

    fits, checks  steps to fit, and others to choose by
    """
    tried = [fitted(kind, channel, fits, checks) for kind in OF_CHANNEL[channel]]
    least = min(f.validation for f in tried)
    return next(f for f in tried if f.validation <= _NEAR * least), tried


def fitted(kind: str, channel: str, fits: Steps, checks: Steps) -> FittedModel:
    """One model of the family, fitted to `fits`. Raises ValueError if a step has no size."""
    from scipy.optimize import least_squares

    if not np.all(fits.size > 0) or not np.all(checks.size > 0):
        raise ValueError("a step from a value to the same value tells nothing of a channel")
    called = names(kind, channel)
    fastest = max(float(np.abs(np.diff(fits.flown, axis=1)).max()) / fits.dt, 1e-6)
    bounds = BOUNDS | {name: (0.02 * fastest, 50.0 * fastest) for name in ("falls", "rises")}
    low, high = (np.log([bounds[name][k] for name in called]) for k in (0, 1))

    def modelled(logs: Array) -> Array:
        return simulate(kind, dict(zip(called, np.exp(logs).T, strict=True)), fits)

    def errors(x: Array) -> Array:
        return np.ravel(fits.errors(modelled(x)))

    def slopes(x: Array) -> Array:
        shifted = x + _STEP * np.vstack([np.eye(len(x)), -np.eye(len(x))])
        moved = fits.errors(modelled(shifted)).reshape(2 * len(x), -1)
        return np.asarray((moved[: len(x)] - moved[len(x) :]).T / (2 * _STEP))

    best = None
    for start in _starts(kind, fits, fastest):
        x0 = np.clip(np.log([start[name] for name in called]), low + 1e-6, high - 1e-6)
        found = least_squares(errors, x0, jac=slopes, bounds=(low, high), max_nfev=_EVALUATIONS)
        if best is None or found.cost < best.cost:
            best = found
    assert best is not None
    values = dict(zip(called, np.exp(best.x).tolist(), strict=True))
    spread = _spread(slopes(best.x), errors(best.x), len(fits.size))
    known = {name: s for name, s in zip(called, spread.tolist(), strict=True) if s < _WIDEST}
    return FittedModel(
        kind,
        values,
        {name: values[name] * math.exp(-s) for name, s in known.items()},
        {name: values[name] * math.exp(s) for name, s in known.items()},
        _rms(errors(best.x)),
        _rms(checks.errors(simulate(kind, values, checks))),
    )


def _starts(kind: str, fits: Steps, fastest: float) -> list[dict[str, float]]:
    """Where searches begin: from the area between command and answer, which is delay and lag together."""
    share = (fits.flown - fits.before[:, None]) / (fits.after - fits.before)[:, None]
    lag = float(np.clip(np.median(np.sum(1.0 - share, axis=1) * fits.dt), 0.05, 10.0))
    level = float(np.clip(np.median(share[:, -1]), 0.6, 1.4))
    common = {"share": level, "falls": 2 * fastest, "rises": 2 * fastest}
    late = (0.2, 0.6)
    if kind == "second order":
        return [
            common | {"radps": 2 * d / ((1 - part) * lag), "damping": d, "delay_s": part * lag}
            for part, d in zip(late, (0.8, 1.0), strict=True)
        ]
    if kind == "tracked loop":  # the area between command and answer is (1 - forward) loop_s, and the delay
        return [
            common
            | {"forward": part, "loop_s": 0.8 * lag / (1 - part)}
            | {"time_constant_s": 0.3 * lag, "delay_s": 0.2 * lag}
            for part in (0.1, 0.5)
        ]
    return [
        common
        | {"time_constant_s": (1 - part) * lag, "delay_s": part * lag}
        | {"falls": limit * fastest, "rises": limit * fastest}
        for part, limit in zip(late, (2.0, 1.2), strict=True)
    ]


def _spread(jacobian: Array, errors: Array, steps: int) -> Array:
    """Half width of each parameter's interval, in its logarithm; NaN of those that no step shows.

    A jackknife that leaves out one step at a time, to first order: x without step s is x + H_s^-1 g_s, with
    the gradient g_s of the step's share of the squared errors and the Hessian H_s of the others'.
    """
    from scipy.stats import t as student

    n, p = jacobian.shape
    seen = np.sqrt(np.mean(jacobian**2, axis=0)) > _UNSEEN
    half = np.full(p, np.nan)
    if steps < 2 or not seen.any():
        return half
    slopes = jacobian[:, seen].reshape(steps, n // steps, -1)
    residuals = errors.reshape(steps, n // steps)
    hessian = np.einsum("sti,stj->sij", slopes, slopes)
    gradient = np.einsum("sti,st->si", slopes, residuals)
    moved = np.array([np.linalg.pinv(hessian.sum(axis=0) - hessian[s]) @ gradient[s] for s in range(steps)])
    variance = (steps - 1) / steps * np.sum((moved - moved.mean(axis=0)) ** 2, axis=0)
    half[seen] = student.ppf(0.5 + LEVEL / 2, steps - 1) * np.sqrt(variance)
    return half


def _rms(errors: Array) -> float:
    return float(np.sqrt(np.mean(errors**2)))
