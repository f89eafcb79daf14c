"""Flies an airframe with other inertia and other thrust, to measure the effect of its assumptions.

    python -m testbed.studies.sensitivity.sensitivity x8

prints the table in the airframe's README. The autopilot's gains stay those of airframe.toml.
"""

from __future__ import annotations

import math
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from aircraft.airframe import load
from aircraft.airframes.schema import Airframe
from testbed.claims.nearest import nearest_approach

TURN = math.radians(11.7)  # rad/s
_SPEED_MPS = 20.0
_PRODUCTS = ("ixy", "ixz", "iyz")


@dataclass(frozen=True)
class Change:
    """A name and the factors on inertia (Jx, Jy, Jz) and on thrust."""

    name: str
    inertia: tuple[float, float, float] = (1.0, 1.0, 1.0)
    thrust: float = 1.0


def _both(name: str, axes: str, share: float = 0.3) -> list[Change]:
    """Less and more inertia about `axes` by `share`."""
    factors = [(1 + sign * share, 100 * sign * share) for sign in (-1, 1)]
    return [
        Change(
            f"{name} {percent:+.0f} %",
            (f if "x" in axes else 1, f if "y" in axes else 1, f if "z" in axes else 1),
        )
        for f, percent in factors
    ]


# Jx and Jz go together: a body cannot have one of them alone changed by 30 %.
CHANGES = (
    Change("as it is"),
    *_both("inertia", "xyz", 0.05),
    *_both("inertia", "xyz"),
    *_both("Jx and Jz", "xz"),
    *_both("Jy", "y"),
    Change("thrust -20 %", thrust=0.8),
    Change("thrust +20 %", thrust=1.2),
)


@dataclass(frozen=True)
class Effect:
    """The turn-rate step 0 to 11.7 deg/s at 20 m/s, and the paper's head-on encounter evaded by turning."""

    change: Change
    t63_s: float
    overshoot: float
    altitude_change_m: float
    least_distance_m: float


def changed(airframe: Airframe, change: Change, folder: Path) -> Airframe:
    """A copy of the airframe in `folder` with its model changed.

    Raises  ValueError if the model does not state an inertia or marks no C_prop.
    """
    shutil.copytree(airframe.folder, folder)
    path = folder / f"{airframe.model}.xml"
    text = path.read_text()
    factors = dict(zip(("ixx", "iyy", "izz"), change.inertia, strict=True))
    # A product of inertia is scaled only where all moments are, by the same factor.
    factors |= dict.fromkeys(_PRODUCTS, change.inertia[0] if len(set(change.inertia)) == 1 else 1.0)
    patterns = {rf"(<{tag}[^>]*>\s*)([-+.\deE]+)": factor for tag, factor in factors.items()}
    patterns[r"(<value>\s*)([-+.\deE]+)(?=\s*</value>\s*<!-- C_prop)"] = change.thrust
    for pattern, factor in patterns.items():
        text, found = re.subn(pattern, partial(_scaled, factor), text)
        if found != 1:
            raise ValueError(f"{path}: {found} places match {pattern}, not one")
    path.write_text(text)
    return load(folder)


def _scaled(factor: float, found: re.Match[str]) -> str:
    return f"{found[1]}{float(found[2]) * factor!r}"


def effects(name: str, changes: tuple[Change, ...] = CHANGES) -> Iterator[Effect]:
    """Fly both cases for every change."""
    from aircraft.autopilots.tuning import fly, score
    from testbed.scenario.scenario import load as scenario
    from testbed.simulation.simulate import run

    for change in changes:
        with tempfile.TemporaryDirectory() as folder:
            airframe = changed(load(name), change, Path(folder) / "airframe")
            f = fly(airframe, _SPEED_MPS, (_SPEED_MPS, TURN, 0.0))
            s = score(f.t, f.omega, 0.0, TURN)
            flown = run(
                scenario("paper-2-turn", ["plant=jsbsim", f'airframes=["{airframe.folder.as_posix()}"]'])
            )
        yield Effect(
            change,
            s.t63,
            s.overshoot,
            float(np.abs(f.position[:, 2]).max()),
            float(nearest_approach(flown)["value"]),
        )


def main(name: str) -> None:
    """Print the table as Markdown."""
    print("| change | t63 [s] | overshoot [%] | altitude change [m] | least distance head-on [m] |")
    print("|---|---|---|---|---|")
    for e in effects(name):
        print(
            f"| {e.change.name} | {e.t63_s:.3f} | {100 * e.overshoot:.1f} | {e.altitude_change_m:.2f} |"
            f" {e.least_distance_m:.2f} |"
        )


if __name__ == "__main__":
    main(sys.argv[1])
