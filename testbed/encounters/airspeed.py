"""Converts calibrated airspeeds and Mach numbers to true airspeeds in the standard atmosphere.

Source  ICAO Doc 7488 (standard atmosphere, to 20 km); pitot pressure of isentropic flow, gamma = 1.4.
"""

from __future__ import annotations

from math import exp, sqrt

from aircraft.jsbsim.geodesy import G_MPS2

P0_PA, T0_K, A0_MPS = 101_325.0, 288.15, 340.294
_GAS = 287.05287  # J/(kg K)
_LAPSE, _TROPOPAUSE_M = 0.0065, 11_000.0


def atmosphere(height: float) -> tuple[float, float]:
    """Pressure [Pa] and temperature [K] at a height [m] above mean sea level, up to 20 km."""
    low = min(height, _TROPOPAUSE_M)
    temperature = T0_K - _LAPSE * low
    pressure = P0_PA * (temperature / T0_K) ** (G_MPS2 / (_LAPSE * _GAS))
    if height > _TROPOPAUSE_M:
        pressure *= exp(-G_MPS2 * (height - _TROPOPAUSE_M) / (_GAS * temperature))
    return pressure, temperature


def true_of_mach(mach: float, height: float) -> float:
    """m/s"""
    return mach * A0_MPS * sqrt(atmosphere(height)[1] / T0_K)


def true_of_calibrated(speed: float, height: float) -> float:
    """True airspeed [m/s] of a calibrated one [m/s] below the speed of sound."""
    pressure, _ = atmosphere(height)
    impact = P0_PA * ((1.0 + 0.2 * (speed / A0_MPS) ** 2) ** 3.5 - 1.0)
    mach = sqrt(5.0 * ((impact / pressure + 1.0) ** (2.0 / 7.0) - 1.0))
    return true_of_mach(mach, height)
