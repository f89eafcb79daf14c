"""Computes the datasheet of an airframe, which `testbed aircraft describe` prints: units in the names."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from aircraft.airframes.schema import Airframe
from aircraft.autopilots.linear_autopilot import loops
from aircraft.autopilots.linear_model import linear_model, linear_or_none
from aircraft.autopilots.margins import (
    Margins,
    Mode,
    Response,
    margins,
    model_margins,
    model_response,
    modes,
    response,
    waits_of,
)
from aircraft.autopilots.specification import (
    CLIMB,
    Row,
    Step,
    climb_rate,
    flown,
    margin_rows,
    turbulence_rows,
)
from aircraft.autopilots.specification import steps_of as specified
from aircraft.autopilots.stability import Instability, instabilities
from aircraft.autopilots.tuning import Flight
from aircraft.datasheets.envelope import Box, Corner, Limits, box_of, corners, envelope
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import M_PER_FT, Origin
from aircraft.jsbsim.rest import Start
from aircraft.jsbsim.trim import trim_map

KG_PER_SLUG = 14.593902937
# Where model and measurement are compared: above what 30 s of record resolve, below where L has faded.
BAND_RADPS = (0.3, 100.0)
FADED = 0.03
_CLIMBS_MPS = (-2.0, 0.0, 3.9)


@dataclass(frozen=True)
class Loop:
    """One loop at one speed: of the linear model, measured, and the largest difference of L over the band."""

    v: float
    name: str
    model: Margins
    measured: Margins
    off_db: float
    off_deg: float
    model_l: Response
    measured_l: Response


@dataclass(frozen=True)
class Datasheet:
    """One airframe."""

    airframe: Airframe
    geometry: dict[str, float]
    trims: list[dict[str, float]]
    box: Box
    envelope: list[Limits]
    corners: list[Corner]
    modes: dict[float, list[Mode]]
    unstable: list[Instability]  # under the autopilot; at these speeds there are no margins
    loops: list[Loop]
    steps: list[tuple[Step, Flight]]
    rows: list[Row]

    def as_dict(self) -> dict[str, Any]:
        """For JSON: no curves, angles in degrees."""
        a = self.airframe
        return {
            "name": a.name,
            "title": a.title,
            "licence": a.licence,
            "speeds": a.speeds.model_dump(),
            "geometry": self.geometry,
            "trim": self.trims,
            "envelope": envelope_rows(self.envelope),
            "corners": corner_rows(self.corners),
            "modes": mode_rows(self.modes),
            "unstable": [asdict(x) | {"says": str(x)} for x in self.unstable],
            "margins": loop_rows(self.loops),
            "specification": [asdict(r) | {"met": r.met} for r in self.rows],
            "identified": a.identified.model_dump() if a.identified else None,
            "gains": a.gains,
        }


def describe(
    airframe: Airframe, box: Box | None = None, progress: Callable[[str], None] = lambda what: None
) -> Datasheet:
    """Compute everything; some ten seconds.

    progress  called with what is computed next
    Raises    FdmError where the model cannot be flown
    """
    box = box or box_of(airframe.speeds)
    progress("geometry and trim")
    sizes = geometry(airframe)
    trims = trim_rows(airframe, box)
    progress("envelope")
    reach, ends = envelope(airframe, box), corners(airframe, box)
    progress("stability")
    unstable = instabilities(airframe)
    shaky = {x.v for x in unstable}
    found_loops, found_modes = [], {}
    for v in airframe.speeds.trim_mps:
        progress(f"modes and margins at {v:g} m/s")
        model = linear_or_none(airframe, v)
        found_modes[v] = [] if model is None else modes(model.point)
        if v not in shaky and model is not None:
            found_loops += [compare(airframe, v, loop) for loop in loops(airframe)]
    progress("steps")
    steps, rows = [], []
    for step in specified(airframe):
        flight, scored = flown(airframe, step)
        steps.append((step, flight))
        rows += scored
    rows += margin_rows(airframe, unstable=shaky)
    progress("turbulence")
    rows += turbulence_rows(airframe)
    return Datasheet(
        airframe, sizes, trims, box, reach, ends, found_modes, unstable, found_loops, steps, rows
    )


def compare(airframe: Airframe, v: float, loop: str) -> Loop:
    """One loop by the linear model and by injection."""
    model = linear_model(airframe, v)
    measured = response(airframe, v, loop, waits=waits_of(model))
    some = np.unique(np.geomspace(1, len(measured.frequency), 400).astype(int)) - 1
    thin = Response(measured.frequency[some], measured.loop[some])
    same = model_response(model, loop, thin.frequency)
    w, ratio = thin.frequency, same.loop / thin.loop
    band = (w > BAND_RADPS[0]) & (w < BAND_RADPS[1]) & (np.abs(thin.loop) > FADED)
    return Loop(
        v,
        loop,
        model_margins(model, loop),
        margins(measured),
        float(np.abs(20 * np.log10(np.abs(ratio[band]))).max()),
        float(np.abs(np.degrees(np.angle(ratio[band]))).max()),
        same,
        thin,
    )


def geometry(airframe: Airframe) -> dict[str, float]:
    """Sizes, mass and inertia as JSBSim has loaded them; inertia about the centre of gravity, body axes.

    Jxz is the integral of x z over the mass, as in the equations of motion; JSBSim's property is minus that.
    """
    fdm = Fdm(airframe, 0.005, Origin())
    fdm.trim(Start(0.0, 0.0, 0.0, 0.0, airframe.speeds.start_mps))
    return measured(fdm)


def measured(fdm: Fdm) -> dict[str, float]:
    """`geometry` of an aircraft that is initialised, whether it can fly or not."""
    inertia = KG_PER_SLUG * M_PER_FT**2
    area, span = fdm.read("metrics/Sw-sqft") * M_PER_FT**2, fdm.read("metrics/bw-ft") * M_PER_FT
    mass = fdm.read("inertia/mass-slugs") * KG_PER_SLUG
    jx, jy, jz, minus_jxz = (fdm.read(f"inertia/i{a}-slugs_ft2") * inertia for a in ("xx", "yy", "zz", "xz"))
    principal = np.linalg.eigvalsh([[jx, 0.0, minus_jxz], [0.0, jy, 0.0], [minus_jxz, 0.0, jz]])
    return {
        "mass_kg": mass,
        "wing_area_m2": area,
        "span_m": span,
        "chord_m": fdm.read("metrics/cbarw-ft") * M_PER_FT,
        "aspect_ratio": span**2 / area,
        "wing_loading_npm2": mass * 9.80665 / area,
        "jx_kgm2": jx,
        "jy_kgm2": jy,
        "jz_kgm2": jz,
        "jxz_kgm2": -minus_jxz,
        "principal_1_kgm2": float(principal[0]),
        "principal_2_kgm2": float(principal[1]),
        "principal_3_kgm2": float(principal[2]),
    }


def trim_rows(airframe: Airframe, box: Box) -> list[dict[str, float]]:
    """Steady flights over speed: level, climbing, sinking and in the box's turn; NaN where there is none."""
    speeds = airframe.speeds.trim_mps
    climbs = [climb * (climb_rate(airframe.speeds) / CLIMB) for climb in _CLIMBS_MPS]
    found = trim_map(airframe, speeds, climbs) | trim_map(airframe, speeds, (0.0,), (box.omega,))
    rows = []
    for (v, zeta, omega), at in found.items():
        row = {"v_mps": v, "zeta_mps": zeta, "omega_degps": math.degrees(omega)}
        names = ("alpha_deg", "beta_deg", "roll_deg", "elevator", "aileron", "rudder", "throttle")
        if at is None:
            rows.append(row | dict.fromkeys(names, math.nan))
            continue
        angles = [math.degrees(x) for x in (at.alpha, at.beta, at.roll)]
        values = [*angles, at.elevator, at.aileron, at.rudder, at.throttle]
        rows.append(row | dict(zip(names, values, strict=True)))
    return sorted(rows, key=lambda r: (r["omega_degps"], r["zeta_mps"], r["v_mps"]))


def envelope_rows(found: list[Limits]) -> list[dict[str, float]]:
    """The envelope with units in the names."""
    return [
        {
            "v_mps": x.v,
            "bank_deg": math.degrees(x.bank),
            "load_in_turn": x.load_in_turn,
            "load_available": x.load_available,
            "climb_mps": x.climb,
            "sink_mps": x.sink,
            "acceleration_mps2": x.acceleration,
            "deceleration_mps2": x.deceleration,
            "stall_speed_mps": x.stall_speed,
            "speed_over_stall": x.stall_margin,
            "alpha_deg": math.degrees(x.alpha),
            "alpha_stall_deg": math.degrees(x.alpha_stall),
        }
        for x in found
    ]


def corner_rows(found: list[Corner]) -> list[dict[str, Any]]:
    """The corners of the box; absent where a corner is sustainable."""
    return [
        {
            "v_mps": c.v,
            "omega_degps": math.degrees(c.omega),
            "zeta_mps": c.zeta,
            "sustainable": c.sustainable,
            "speed_lasts_s": None if c.sustainable else c.lasts,
            "autopilot_holds_s": None if c.sustainable else c.held,
            "gives_way": c.gives or None,
            "sustainable_at_mps": c.balances,
        }
        for c in found
    ]


def mode_rows(found: dict[float, list[Mode]]) -> list[dict[str, Any]]:
    """Modes by speed."""
    return [
        {
            "v_mps": v,
            "mode": m.name,
            "real_per_s": m.eigenvalue.real,
            "imaginary_per_s": m.eigenvalue.imag,
            "frequency_radps": m.frequency,
            "damping": m.damping,
        }
        for v, listed in found.items()
        for m in listed
    ]


def loop_rows(found: list[Loop]) -> list[dict[str, Any]]:
    """Margins by speed and loop, of the model and measured."""
    rows = []
    for x in found:
        row: dict[str, Any] = {"v_mps": x.v, "loop": x.name}
        for kind, m in (("model", x.model), ("measured", x.measured)):
            row |= {f"{name}_{kind}": value for name, value in asdict(m).items()}
        rows.append(row | {"off_db": x.off_db, "off_deg": x.off_deg})
    return rows
