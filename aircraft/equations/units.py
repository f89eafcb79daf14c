"""Tells the unit of a name of the equations by its ending: turn_bandwidth_radps is in rad/s."""

from __future__ import annotations

import re

_ENDINGS = {
    "mps": "m/s",
    "mps2": "m/s2",
    "mps3": "m/s3",
    "mps4": "m/s4",
    "radps": "rad/s",
    "radps2": "rad/s2",
    "radps3": "rad/s3",
    "rad": "rad",
    "deg": "deg",
    "degps": "deg/s",
    "per_s": "1/s",
    "per_s2": "1/s2",
    "per_m": "1/m",
    "m2": "m2",
    "kg": "kg",
    "fps": "ft/s",
    "psf": "lbf/ft2",
    "hz": "Hz",
    "norm": "share of full deflection",
    "s": "s",
    "m": "m",
}
_FORM = re.compile(rf"_({'|'.join(sorted(_ENDINGS, key=len, reverse=True))})$", re.IGNORECASE)


def unit_of(name: str) -> str:
    """The unit that a name ends with; nothing where it ends with none, as ratios do."""
    found = _FORM.search(re.sub(r"_\d+$", "", name))  # the second place of a delay, sent_v_mps_2
    return _ENDINGS[found[1].lower()] if found else ""
