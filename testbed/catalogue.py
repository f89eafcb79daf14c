"""From a scenario to the objects it names. A new barrier, filter, plant or controller is one entry here."""

from __future__ import annotations

import hashlib
import platform
from importlib import metadata
from typing import Any

import numpy as np

from aircraft.plant import Plant
from filters.alpha import OddPolynomial, cubic, linear
from filters.barrier import Barrier, TurnBarrier
from filters.collision import CollisionFilter, Filter, Passthrough
from filters.unicycle import Array, Limits
from testbed.errors import UserError
from testbed.nominal import Constant, NearIdentity, NominalController
from testbed.scenario import Scenario

PACKAGES = ("jsbsim", "osqp", "numpy", "scipy", "pandas", "pyarrow")


def limits(s: Scenario) -> Limits:
    """The input set U of every vehicle."""
    box = s.limits
    values = (box.v_min_mps, box.v_max_mps, np.radians(box.omega_max_degps), box.zeta_max_mps)
    return Limits(*(np.full(s.vehicles, v) for v in values))


def _turn(s: Scenario) -> Barrier:
    b = s.barrier
    return TurnBarrier(
        v=b.v_mps,
        omega=float(np.radians(b.omega_degps)),
        d_safe=s.d_safe_m,
        delta=b.delta_m2,
        sigma=np.asarray(b.sigma, dtype=float) if isinstance(b.sigma, list) else b.sigma,
        form=b.form,
        smoothing=b.smoothing_m2,
    )


BARRIERS = {"turn": _turn}


def barrier(s: Scenario) -> Barrier:
    """The barrier as the scenario states it: the one verdicts use."""
    return BARRIERS[s.barrier.kind](s)


def alpha(s: Scenario) -> OddPolynomial:
    a = s.alpha
    if a.kind == "odd-polynomial":
        return OddPolynomial(a.coefficients)
    return {"linear": linear, "cubic": cubic}[a.kind](a.coefficient)


FILTERS = {
    "centralised": lambda s, b: CollisionFilter(b, alpha(s), mode="centralised"),
    "none": lambda s, b: Passthrough(),
}


def filter_(s: Scenario, b: Barrier) -> Filter:
    return FILTERS[s.filter.kind](s, b)


NOMINALS = {
    "near-identity": lambda s, goal, b: NearIdentity(goal, s.nominal.lookahead_m, s.nominal.gain_per_s),
    "manoeuvre": lambda s, goal, b: Constant(b.manoeuvre(s.vehicles)),
}


def nominal(s: Scenario, goal: Array, b: Barrier) -> NominalController:
    return NOMINALS[s.nominal.controller](s, goal, b)


def _unicycle(s: Scenario) -> Plant:
    from aircraft.kinematic import KinematicFleet

    return KinematicFleet(s.vehicles, s.rates.fdm_dt_s)


def _jsbsim(s: Scenario) -> Plant:
    from aircraft.fleet import JsbsimFleet

    return JsbsimFleet(_airframes(s), dt=s.rates.fdm_dt_s, start_speed=s.start.speed_mps)


PLANTS = {"unicycle": _unicycle, "jsbsim": _jsbsim}


def plant(s: Scenario) -> Plant:
    """The vehicles, ready for `reset`."""
    return PLANTS[s.plant](s)


def _airframes(s: Scenario) -> list[Any]:
    from aircraft.airframe import AirframeError, load

    try:
        known = {name: load(name) for name in sorted(set(s.airframes))}
    except AirframeError as error:
        raise UserError(f"airframes: {error}") from None
    return [known[s.airframes[i % len(s.airframes)]] for i in range(s.vehicles)]


def airframe_hashes(s: Scenario) -> dict[str, str]:
    """SHA-256 over every file of each airframe the scenario flies; empty on kinematic plants."""
    if s.plant != "jsbsim":
        return {}
    hashes = {}
    for airframe in _airframes(s):
        digest = hashlib.sha256()
        for file in sorted(p for p in airframe.folder.rglob("*") if p.is_file()):
            digest.update(str(file.relative_to(airframe.folder)).encode() + b"\0" + file.read_bytes())
        hashes[airframe.name] = digest.hexdigest()
    return hashes


def versions() -> dict[str, str]:
    """Versions of everything a number in a run depends on."""
    packages = {name: metadata.version(name) for name in PACKAGES}
    return {
        "cbf-jsbsim-testbed": metadata.version("cbf-jsbsim-testbed"),
        "python": platform.python_version(),
    } | packages
