"""Gusts: a frozen, isotropic, divergence-free random field with the Dryden spectra of MIL-F-8785C.

The Dryden model gives the correlations of the velocity along and across a straight line,
f(r) = exp(-r/L) and g(r) = (1 - r/(2L)) exp(-r/L); g = f + r f'/2, so they are those of one incompressible
isotropic field in space. Its energy spectrum follows from the longitudinal one,
E11(k) = (2 sigma^2 L/pi) / (1 + (kL)^2), by E = (k^3/2) d/dk((1/k) dE11/dk) (Batchelor 1953, 3.4):
E(k) = sigma^2 (8/pi) L (kL)^4 / (1 + (kL)^2)^3, whose integral is 3 sigma^2 / 2.
A field, unlike a filter per vehicle, is felt by every plant and by neighbouring vehicles alike.

At the origin's 300 m above ground MIL-F-8785C's low-altitude formulas give L_u 304.7 m, L_w 300 m and
sigma_u/sigma_w 1.005: isotropic to 2 %. Height changes little over a scenario, so one L and sigma hold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from filters.model import Array

# The wind at 20 ft (6.1 m) that MIL-F-8785C calls so; sigma_w at low altitude, a tenth of it; JSBSim's index.
W20_KNOTS = {"none": 0.0, "light": 15.0, "moderate": 30.0, "severe": 45.0}
W20_MPS = {name: knots * 1852.0 / 3600.0 for name, knots in W20_KNOTS.items()}
SIGMA_MPS = {name: 0.1 * wind for name, wind in W20_MPS.items()}
JSBSIM_SEVERITY = {"light": 3, "moderate": 4, "severe": 6}
# Some 16 wave numbers to the factor of e: an aircraft passing through meets no visible gap in the spectrum.
MODES = 192
# Strata of kL: 8e-9 of the energy lies below and 6e-4 above; the outermost strata reach 0 and infinity.
LOWEST, HIGHEST = 0.03, 3000.0


def energy_above(kl: Array) -> Array:
    """The share of the field's energy in wave numbers above kl / L, for kl (...) from 0 to infinity.

    With y = 1/(1 + (kL)^2) the energy is spread over y as a beta distribution with 1/2 and 5/2.
    """
    from scipy.special import betainc

    return np.asarray(betainc(0.5, 2.5, 1.0 / (1.0 + np.square(kl))))


def wave_number(above: Array) -> Array:
    """The inverse of `energy_above`: kL (...) above which that share of the energy lies."""
    from scipy.special import betaincinv

    y = betaincinv(0.5, 2.5, above)
    return np.asarray(np.sqrt((1.0 - y) / y))


@dataclass(frozen=True, eq=False)
class GustField:
    """Gusts as sums of plane waves: u(x) = sum over modes of cosine cos(k.x) + sine sin(k.x).

    k             (F, M, 3)  rad/m, wave vectors of F independent fields: one for all vehicles, or one each
    cosine, sine  (F, M, 3)  m/s, square to k, so that the field is free of divergence
    carried       (3,)       m/s, the velocity with which the frozen field passes over the ground (Taylor)
    """

    k: Array
    cosine: Array
    sine: Array
    carried: Array

    def __call__(self, t: float, position: Array) -> Array:
        """Gusts (N, 3) m/s, east, north and up, at time t [s] and `position` (N, 3) m."""
        place = position - self.carried * t
        if len(self.k) == 1:
            phase = place @ self.k[0].T
            return np.asarray(np.cos(phase) @ self.cosine[0] + np.sin(phase) @ self.sine[0])
        phase = (self.k @ place[:, :, None])[:, None, :, 0]
        return np.asarray((np.cos(phase) @ self.cosine + np.sin(phase) @ self.sine)[:, 0])


def draw(
    rng: np.random.Generator, sigma: float, length: float, carried: Array, fields: int = 1, modes: int = MODES
) -> GustField:
    """`fields` independent realisations; the first is the same however many there are.

    sigma    m/s, of each component
    length   m, the Dryden L
    carried  (3,) m/s, usually the steady wind
    Each mode draws its wave number from its own stratum of E(k), so the mean over draws is exactly Dryden.
    The numbers drawn do not depend on sigma and length: equal seeds stay paired.
    """
    parts = [_draw_one(child, modes) for child in rng.spawn(fields)]
    k, cosine, sine = (np.stack(part) for part in zip(*parts, strict=True))
    return GustField(k / length, sigma * cosine, sigma * sine, np.asarray(carried, dtype=float))


def _draw_one(rng: np.random.Generator, modes: int) -> tuple[Array, Array, Array]:
    """Wave vectors (times L), cosine and sine amplitudes (M, 3) of a field with sigma = L = 1."""
    edges = np.concatenate([[0.0], np.geomspace(LOWEST, HIGHEST, modes - 1), [np.inf]])
    above = energy_above(edges)
    share = above[:-1] - above[1:]
    kl = wave_number(above[:-1] - share * rng.random(modes))
    direction = rng.standard_normal((modes, 3))
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    # 3/2 share in each of two directions square to k: |u|^2 has mean 3 share, a component a third of it.
    amplitude = np.sqrt(1.5 * share)[:, None] * rng.standard_normal((2, modes, 3))
    amplitude -= np.sum(amplitude * direction, axis=-1, keepdims=True) * direction
    return kl[:, None] * direction, amplitude[0], amplitude[1]
