"""Checks the surfaces that airframe.toml names: the model has them, each once, and they are angles."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from difflib import get_close_matches

from aircraft.airframes.files import Files, Finding, toml_line
from aircraft.airframes.references import declared

# Last words of JSBSim's properties that say a unit other than rad.
OTHER_UNITS = frozenset(
    "norm cmd pct R deg dps rad_sec rad_sec2 rpm hz kts mps fps fps_sec ft ft2 ft_sec ft_sec2 m m2 sec lbs"  # noqa: SIM905
    " lbsft slug slugs_ft2 psf psi pa gal hp".split()
)
# Roots of JSBSim's tree that hold the state of the aircraft, the air and the engines, never a surface.
STATE = frozenset(
    "accelerations aero atmosphere attitude energy flight-path forces gear ic inertia metrics moments"  # noqa: SIM905
    " position propulsion simulation velocities".split()
)


def surfaces(files: Files, exists: Callable[[str], bool]) -> Iterator[Finding]:
    """Surfaces that the model does not have, that stand under two names, or that are no surface's angle.

    exists  whether the loaded model has a property
    """
    toml, named = files.folder / "airframe.toml", files.airframe.surfaces
    seen: dict[str, str] = {}
    for name, path in named.items():
        where = toml_line(toml, f"surfaces.{name}")
        if (first := seen.setdefault(path, name)) != name:
            message = f"surfaces.{name}: {path} is already the property of surfaces.{first}"
            yield Finding("surface", "error", toml.name, where, message, "name each surface's own property")
        if not exists(path):
            others = sorted(p for p in declared(files) - set(named.values()) if "pos" in p and exists(p))
            near = get_close_matches(path, others, 1, 0.5)
            remedy = f"did you mean {near[0]}?" if near else "name the property of its position, in rad"
            message = f"surfaces.{name}: the model has no property {path}"
            yield Finding("surface", "error", toml.name, where, message, remedy)
        elif said := _no_angle(path):
            rad = f"{path.rpartition('-')[0]}-rad"
            free = rad not in named.values() and exists(rad)
            remedy = (
                f'write "{rad}"' if free else "name the property of its position, in rad, or leave it out"
            )
            yield Finding("surface", "error", toml.name, where, f"surfaces.{name}: {path} is {said}", remedy)


def _no_angle(path: str) -> str:
    """What a property is, if its name says that it is no surface's angle in rad; else ""."""
    root, unit = path.partition("/")[0], path.rpartition("-")[2]
    if root in STATE:
        return "no surface: JSBSim keeps the state of the aircraft, its air and its engines there"
    if unit in OTHER_UNITS:
        return f"no angle in rad, by its last word {unit}"
    return ""
