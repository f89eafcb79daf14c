"""Computes the turn barrier of one pair in plain numbers, or of many pairs in arrays, by the same lines.

Planar vectors are complex, east + 1j north. For one pair numpy takes 50 us, nearly all of it for its calls;
plain numbers take 3 us.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from filters.barriers.pairs import Form, Kind

# Added under the square root of |Z|: keeps 0/0 from Z = 0, where it makes the subgradient 0, and changes no
# |Z| above 1e-142 m^2.
TINY = 1e-300


class Clearance(NamedTuple):
    """h of pairs and its derivatives; those by j's place are the opposite of those by i's."""

    h: Any
    x: Any
    y: Any
    z: Any
    theta_i: Any
    theta_j: Any


def clearance(
    arms: tuple[Any, Any],
    apart: tuple[Any, Any, Any],
    tilt: Any,
    delta: float,
    epsilon: float,
    d_safe: float,
    form: Form,
    kind: Kind,
) -> Clearance:
    """h and gradient of pairs that turn at one rate for ever.

    arms     r e^(1j theta) of vehicles i and j, m
    apart    the difference of arms q, of centres D, and of heights dz, i less j, m
    tilt     delta (-1 - 1j) e^(1j theta_i), m^2; not read if delta is 0
    epsilon  m^4, the smoothing squared
    kind     what the numbers are
    Source   see `closed_form.TurnBarrier`
    """
    arm_i, arm_j = arms
    q, d, dz = apart
    z = q * d.conjugate()
    z *= -2j
    excess = epsilon
    if delta:
        # |Z|^2 - |Z at delta 0|^2 + eps^2, without subtracting large numbers
        excess = 2 * (z.real * tilt.real + z.imag * tilt.imag) + (2 * delta**2 + epsilon)
        z += tilt
    amplitude = kind.sqrt(z.real * z.real + z.imag * z.imag + (epsilon + TINY))
    # A1 - |Z| = (|D| - |q|)^2 + dz^2 - 2 delta - (|Z| - 2 |D| |q|), which does not cancel.
    d_abs, q_abs = abs(d), abs(q)
    gap = d_abs - q_abs
    m = gap * gap + dz * dz
    m -= excess / (2 * d_abs * q_abs + amplitude) + 2 * delta
    h, slope = form(m, d_safe, kind)

    # dm = Re(conj(g_d) dD) + Re(g_q dq) + 2 dz d(dz) + the delta term's own share of theta_i
    slope = 2.0 * slope
    phase = z.conjugate() * (1j * slope / amplitude)
    g_d = slope * d + phase * q
    turn = 1j * (slope * q.conjugate() + phase * d.conjugate()) - g_d.conjugate()
    theta_i = turn.real * arm_i.real - turn.imag * arm_i.imag
    theta_j = turn.imag * arm_j.imag - turn.real * arm_j.real
    if delta:
        theta_i -= 0.5 * (phase.real * tilt.real - phase.imag * tilt.imag)
    return Clearance(h, g_d.real, g_d.imag, slope * dz, theta_i, theta_j)
