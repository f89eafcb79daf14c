"""Reads the limits of surfaces and throttle from the flight model."""

from __future__ import annotations

from aircraft.airframes.schema import Airframe
from aircraft.airframes.xml import read


def actuator_limits(airframe: Airframe) -> dict[str, tuple[float, float]]:
    """Telemetry name -> least and greatest position, for the surfaces that the model clips, and the throttle.

    rad, the throttle 0 to 1. A surface without a <clipto> of numbers has no limit and is left out.
    """
    root = read(airframe.folder / f"{airframe.model}.xml")
    stops = {}
    for clip in root.all("clipto"):
        low, high = clip.first("min"), clip.first("max")
        ends = [e.number() if e is not None else None for e in (low, high)]
        if clip.parent is None or ends[0] is None or ends[1] is None:
            continue
        output = clip.parent.first("output")
        for name in (clip.parent.attributes.get("name"), output.text.strip() if output is not None else None):
            stops[name] = (ends[0], ends[1])
    found = {name: stops[path] for name, path in airframe.surfaces.items() if path in stops}
    return found | {"throttle": (0.0, 1.0)}
