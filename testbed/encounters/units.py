"""Reads units that files name, and converts what they measure to metres, seconds and radians."""

from __future__ import annotations

from math import pi

from aircraft.jsbsim.geodesy import M_PER_FT
from testbed.errors import nearest

FT, NMI, KNOT, FPM = M_PER_FT, 1852.0, 1852.0 / 3600.0, M_PER_FT / 60.0

# What is measured -> unit, in small letters -> how many of m, s, m/s or rad it is.
UNITS: dict[str, dict[str, float]] = {
    "length": {"m": 1.0, "km": 1000.0, "ft": FT, "nmi": NMI, "nm": NMI, "mi": 1609.344},
    "time": {"s": 1.0, "sec": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0, "hr": 3600.0},
    "speed": {
        "mps": 1.0, "m/s": 1.0, "knot": KNOT, "knots": KNOT, "kn": KNOT, "kt": KNOT, "kts": KNOT,
        "fpm": FPM, "ft/min": FPM, "fps": FT, "ft/s": FT, "kmh": 1 / 3.6, "km/h": 1 / 3.6, "mph": 0.44704,
    },
    "angle": {"deg": pi / 180.0, "rad": 1.0},
    "word": {"none": 1.0, "unitless": 1.0, "unspecified": 1.0},
}  # fmt: skip


def is_unit(word: str) -> bool:
    """Whether a word, without brackets, is a unit known here."""
    return any(word.lower() in known for known in UNITS.values())


def factor(unit: str, measured: str, column: str) -> float:
    """How many of the SI unit one `unit` is; ValueError, saying what would do, if it is no unit of that."""
    known = UNITS[measured]
    if unit.lower() in known:
        return known[unit.lower()]
    of = next((what for what, units in UNITS.items() if unit.lower() in units), None)
    if of is None:
        raise ValueError(f"column {column} has the unit {unit!r}, which is not known; {nearest(unit, known)}")
    listed = ", ".join(known)
    raise ValueError(f"column {column} is a {measured}, and [{unit}] is a unit of {of}; give one of {listed}")
