"""Measurement errors: bias, drift and white noise on poses and rates."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from filters.model import Array, Command, State, View

# The measured quantities along the last axis of the arrays here.
QUANTITIES = ("x", "y", "theta", "z", "v", "omega", "zeta")


def pack(view: View) -> Array:
    """A view's numbers, (..., 7) in the order of QUANTITIES."""
    return np.concatenate([view.state.array(), view.rates.array()], axis=-1)


def unpack(values: Array) -> View:
    """The inverse of `pack`."""
    return View(State.of(values[..., :4]), Command.of(values[..., 4:]))


def knowing(made: View, before: View) -> View:
    """`made`, with the vehicles known in `before`."""
    return made if before.known is None else View(made.state, made.rates, before.known)


@dataclass
class Sensing:
    """Constant errors, drifting errors and white noise, added at every filter step.

    noise, drift, bias  (7,)  standard deviations, SI: drawn anew at every step; a first-order Gauss-Markov
                              process; drawn once
    persistence         of the drift from one step to the next, exp(-dt / correlation time)
    everyone            every vehicle measures all others itself, with errors of its own; otherwise each
                        measures itself and the others hear of it
    All numbers are drawn whatever the deviations, so that equal seeds stay paired.
    """

    noise: Array
    drift: Array
    bias: Array
    persistence: float
    everyone: bool
    vehicles: int
    rng: np.random.Generator
    _drift_rng: np.random.Generator = field(init=False)
    _noise_rng: np.random.Generator = field(init=False)
    _drifted: Array = field(init=False)
    _biased: Array = field(init=False)

    def __post_init__(self) -> None:
        bias_rng, self._drift_rng, self._noise_rng = self.rng.spawn(3)
        n = self.vehicles
        shape = (n, n, len(QUANTITIES)) if self.everyone else (n, len(QUANTITIES))
        self._biased = self.bias * bias_rng.standard_normal(shape)
        self._drifted = self._drift_rng.standard_normal(shape)

    def __call__(self, view: View) -> View:
        """What is measured of the truth `view` (N,): (N,), or [observer, vehicle] if everyone measures.

        To be called once at every filter step.
        """
        shape = self._drifted.shape
        error = (
            self._biased + self.drift * self._drifted + self.noise * self._noise_rng.standard_normal(shape)
        )
        step = np.sqrt(1.0 - self.persistence**2) * self._drift_rng.standard_normal(shape)
        self._drifted = self.persistence * self._drifted + step
        return knowing(unpack(pack(view) + error), view)
