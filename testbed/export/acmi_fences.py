"""Writes the fences of a run as static objects of a Tacview recording: waypoints linked round each outline.

Source  https://www.tacview.net/documentation/acmi/, properties Type and Next
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import cos, degrees, pi, sin
from typing import Any

from aircraft.jsbsim.geodesy import Origin
from testbed.export.acmi_text import escaped
from testbed.report.fences import outlines

# Far above those of vehicles, of which there are a thousand at most.
FIRST_ID = 0x10000
# Waypoints of a circle.
ROUND = 24


def lines(scenario: Mapping[str, Any], origin: Origin) -> Iterator[str]:
    """The lines of all waypoints, for the first frame; they lie at the height of the shared origin."""
    first = FIRST_ID
    for shape in outlines(scenario):
        points = shape.get("corners") or list(_round(shape["centre"], shape["radius"]))
        name = escaped(shape["title"])
        for k, (x, y) in enumerate(points):
            latitude, longitude, altitude = origin.geodetic(x, y, 0.0)
            place = f"{degrees(longitude) - origin.longitude_deg:.10f}"
            place += f"|{degrees(latitude) - origin.latitude_deg:.10f}|{altitude:.3f}"
            following = first + (k + 1) % len(points)
            colour = "Violet" if shape["inside"] else "Red"
            yield (
                f"{first + k:x},T={place},Type=Navaid+Static+Waypoint,Name={name},Color={colour},"
                f"Next={following:x}"
            )
        first += len(points)


def _round(centre: list[float], radius: float) -> Iterator[tuple[float, float]]:
    for k in range(ROUND):
        angle = 2 * pi * k / ROUND
        yield centre[0] + radius * cos(angle), centre[1] + radius * sin(angle)
