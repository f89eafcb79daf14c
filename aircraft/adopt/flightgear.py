"""Gives a model JSBSim's own properties where it reads FlightGear's copies of them."""

from __future__ import annotations

import re
from collections.abc import Iterable

from aircraft.airframes.xml import Element

_NUMBER = r"(\[\d+\])?"
# FlightGear's property, as FlightGear itself ties it to JSBSim's.
_COPIES = [
    (rf"controls/engines/engine{_NUMBER}/throttle", r"fcs/throttle-cmd-norm\1"),
    (rf"controls/engines/engine{_NUMBER}/mixture", r"fcs/mixture-cmd-norm\1"),
    (rf"controls/engines/engine{_NUMBER}/propeller-pitch", r"fcs/advance-cmd-norm\1"),
    (r"controls/flight/(elevator|aileron|rudder)", r"fcs/\1-cmd-norm"),
    (r"controls/flight/elevator-trim", "fcs/pitch-trim-cmd-norm"),
    (r"controls/flight/flaps", "fcs/flap-cmd-norm"),
    (r"controls/gear/gear-down", "gear/gear-cmd-norm"),
    (rf"engines/engine{_NUMBER}/mp-inhg", r"propulsion/engine\1/map-inhg"),
    (rf"engines/engine{_NUMBER}/rpm", r"propulsion/engine\1/engine-rpm"),
    (rf"engines/engine{_NUMBER}/(n1|n2)", r"propulsion/engine\1/\2"),
    (r"velocities/airspeed-kt", "velocities/vc-kts"),
    (r"position/altitude-ft", "position/h-sl-ft"),
    (r"position/altitude-agl-ft", "position/h-agl-ft"),
]
_SIGNED = re.compile(r"(?<![\w./-])(-?)/([A-Za-z][\w./\[\]-]*)")


def use_jsbsims_own(trees: Iterable[Element]) -> list[str]:
    """Replace names that are read; returns those replaced. A name that the model writes itself is left."""
    trees = list(trees)
    written = {e.text.strip() for tree in trees for e in tree.walk() if e.name == "output"}
    replaced: set[str] = set()

    def own(match: re.Match[str]) -> str:
        name = match[2]
        for copy, original in _COPIES:
            if (at := re.fullmatch(copy, name)) and f"/{name}" not in written:
                replaced.add(f"/{name}")
                return match[1] + at.expand(original).replace("[0]", "")
        return match[0]

    for tree in trees:
        for e in list(tree.walk()):
            if e.name == "property" and e.parent is not None and e.parent.name in ("system", "fdm_config"):
                if _SIGNED.sub(own, e.text) != e.text:  # a declaration: JSBSim has its own
                    e.parent.children = [child for child in e.parent.children if child is not e]
                continue
            e.text = _SIGNED.sub(own, e.text)
            if "value" in e.attributes:
                e.attributes["value"] = _SIGNED.sub(own, e.attributes["value"])
    return sorted(replaced)
