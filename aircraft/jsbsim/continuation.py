"""Solves equations of steady flight: directly, and by continuation from a known flight.

A problem has unknowns x (attitude and commands) and parameters p (airspeed, climb and turn, say); its
residuals are the accelerations that remain. `aircraft.jsbsim.steady` and `climbs` state the problems.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BALANCED = 1e-6  # largest residual of a steady flight, in the residuals' units
# Of one whose engines have a state: a governor that hunts, and a shaft that creeps, leave as much.
_NEARLY_BALANCED = 1e-4
_TOLERANCE = 1e-13  # tolerance of the direct solver; its result is judged by BALANCED
_CONVERGED, _SLOWLY_CONVERGED = 1e-10, 5e-7  # residual at which Newton's steps end
_FAST = 0.3  # of the residual before: what a step with corrected derivatives may leave
_NEWTON_STEPS = 12
DIFFERENCE = 1e-7  # for derivatives by x: rad, or share of a command
_LONGEST, _SHORTEST = 0.5, 1 / 128  # steps of a continuation, as shares of its way


@dataclass(frozen=True)
class Problem:
    """residuals(p, x) -> (m,) with m unknowns x, which must lie between lowest and highest, (m,) each."""

    residuals: Callable[[Array, Array], Array]
    lowest: Array
    highest: Array
    difference: float = DIFFERENCE  # of an unknown, for derivatives
    longest: Array | None = None  # step of each unknown, (m,): what is far from linear is not jumped over
    slow: bool = False  # evaluations wait for engines: derivatives are corrected where that is enough

    @property
    def converged(self) -> float:
        """The residual at which Newton's steps end."""
        return _SLOWLY_CONVERGED if self.slow else _CONVERGED

    def solved(self, p: Array, x: Array) -> bool:
        """Whether x is within its bounds and balances the residuals; the model is left evaluated at x."""
        left = float(np.abs(self.residuals(p, x)).max())
        most = _NEARLY_BALANCED if self.slow else BALANCED
        return left < most and bool(np.all((x >= self.lowest) & (x <= self.highest)))


@dataclass(frozen=True)
class Reached:
    """The last solution of a continuation: its parameters and unknowns; whether it is the target."""

    p: Array
    x: Array
    arrived: bool


def solve(problem: Problem, p: Array, guess: Array) -> Array | None:
    """Unknowns that solve the problem at p, by Powell's hybrid method from `guess`; None if it finds none."""
    from scipy.optimize import root

    x: Array = root(lambda x: problem.residuals(p, x), guess, tol=_TOLERANCE).x
    return x if problem.solved(p, x) else None


def correct(problem: Problem, p: Array, guess: Array) -> Array | None:
    """Unknowns that solve the problem at p, by Newton's method within the bounds; None if it fails.

    Powell's method leaves the bounds. There a saturated command has no effect, so it finds no way back.
    """
    x = np.clip(guess, problem.lowest, problem.highest)
    left = problem.residuals(p, x)
    slope: Array | None = None
    for _ in range(_NEWTON_STEPS):
        if np.abs(left).max() < problem.converged:
            break
        if slope is None:
            slope = _jacobian(problem, p, x, left)
        try:
            step = -np.linalg.solve(slope, left)
        except np.linalg.LinAlgError:
            return None
        if problem.longest is not None:
            step /= max(1.0, float(np.abs(step / problem.longest).max()))
        for share in (1.0, 0.5, 0.25, 0.1):
            ahead = np.clip(x + share * step, problem.lowest, problem.highest)
            then = problem.residuals(p, ahead)
            if np.abs(then).max() < np.abs(left).max():
                break
        else:
            break
        slope = _updated(slope, ahead - x, then - left) if problem.slow and share == 1.0 else None
        if np.abs(then).max() > _FAST * np.abs(left).max():
            slope = None
        x, left = ahead, then
    return x if problem.solved(p, x) else None


def _updated(slope: Array, moved: Array, changed: Array) -> Array:
    """Broyden's correction of the derivatives by the step just made, which is never of no length."""
    corrected: Array = slope + np.outer(changed - slope @ moved, moved) / float(moved @ moved)
    return corrected


def _jacobian(problem: Problem, p: Array, x: Array, left: Array) -> Array:
    """d residuals / dx (m, m) by one-sided differences that stay within the bounds."""
    columns = []
    for k in range(len(x)):
        step = problem.difference if x[k] + problem.difference <= problem.highest[k] else -problem.difference
        moved = x.copy()
        moved[k] += step
        columns.append((problem.residuals(p, moved) - left) / step)
    return np.array(columns).T


def follow(problem: Problem, p: Array, x: Array, target: Array, shortest: float = _SHORTEST) -> Reached:
    """Continue the solution x at p along the straight line of parameters to `target`.

    Each step starts Newton's method from an extrapolation of the last two solutions. A step that fails is
    halved until it is `shortest`, as a share of the way; one that succeeds is doubled.
    """
    done, step = 0.0, _LONGEST
    before: tuple[float, Array] | None = None
    while done < 1.0:
        share = min(1.0, done + step)
        slope = 0.0 if before is None else (x - before[1]) / (done - before[0])
        at = target if share == 1.0 else p + share * (target - p)
        found = correct(problem, at, x + slope * (share - done))
        if found is not None:
            before, done, x = (done, x), share, found
            step = min(2 * step, _LONGEST)
        elif step > shortest:
            step /= 2
        else:
            return Reached(p + done * (target - p), x, False)
    return Reached(target, x, True)


def nearest(problem: Problem, p: Array, guesses: Iterable[Array]) -> Array:
    """The unknowns within bounds that leave the least squares of residuals at p, from some guesses."""
    from scipy.optimize import least_squares

    inside = 1e-9 * (problem.highest - problem.lowest)
    found = [
        least_squares(
            lambda x: problem.residuals(p, x),
            np.clip(guess, problem.lowest + inside, problem.highest - inside),
            bounds=(problem.lowest, problem.highest),
        )
        for guess in guesses
    ]
    x: Array = min(found, key=lambda f: float(f.cost)).x
    return x
