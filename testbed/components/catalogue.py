"""Makes the barrier, filter, plant, guidance and environment that a scenario names: one entry a kind."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from aircraft.kinematic import Lag
from aircraft.plant import Plant
from filters.barriers.class_k import OddPolynomial, cubic, linear
from filters.barriers.pairs import Barrier, ForwardDifference
from filters.cbf.collision import CollisionFilter, Passthrough
from filters.cbf.fence_constraints import FenceConstraints
from filters.cbf.intruders import Intruders
from filters.cbf.theorem_monitor import Monitor
from filters.filter import Choose, Filter
from filters.model import Array, Command, Limits
from testbed.components import remedies, rivals
from testbed.components.barriers import MAKERS
from testbed.components.fences import fences
from testbed.components.fleet_workers import fleet_workers
from testbed.components.following.arrival import CircleAtGoal
from testbed.components.following.making import Fleet, fleet_guidance
from testbed.components.guidance import Guidance
from testbed.components.initial_conditions import generators, places
from testbed.errors import UserError
from testbed.scenario import control, fleet, guidance_rules
from testbed.scenario.location import path_of, relative
from testbed.scenario.scenario import Scenario

if TYPE_CHECKING:
    from testbed.environment.environment import Environment


def limits(s: Scenario) -> Limits:
    """The input set U of every vehicle."""
    boxes = fleet.limits(s)
    return Limits(
        np.array([box.v_min_mps for box in boxes]),
        np.array([box.v_max_mps for box in boxes]),
        np.radians([box.omega_max_degps for box in boxes]),
        np.array([box.zeta_max_mps for box in boxes]),
    )


def barrier(s: Scenario) -> Barrier:
    """The barrier as the scenario states it, which verdicts use.

    Raises UserError where the manoeuvre gives no barrier, such as two equal straight speeds.
    """
    try:
        table = fleet.barrier(s)
        return MAKERS[type(table)](table, s)
    except ValueError as error:
        raise UserError(f"barrier: {error}") from None


def alpha(s: Scenario) -> OddPolynomial:
    a = s.alpha
    if a.kind == "odd-polynomial":
        return OddPolynomial(tuple(a.coefficients))
    return {"linear": linear, "cubic": cubic}[a.kind](a.coefficient)


def _collision(s: Scenario, b: Barrier, goal: Array) -> Filter:
    said = s.filter
    if not isinstance(said, control.Centralised | control.Limited):
        raise ValueError(f"filter {said.kind!r} solves no QP")
    own = ForwardDifference(b, s.barrier.gradient_step) if s.barrier.gradient == "forward" else b
    fenced = fences(s, b, s.remedy.ds_buffer_m)
    made = CollisionFilter(
        own,
        alpha(s),
        mode=said.kind,
        shared=s.barrier.shared,
        margin=remedies.margin(s),
        solver=said.solver,
        also=() if fenced is None else (FenceConstraints(fenced, alpha(s)),),
        intruders=intruders(s),
        cost=said.cost,
    )
    return Monitor(made) if said.monitor else made


def intruders(s: Scenario) -> Intruders | None:
    """Who is not under the filter, and what the scenario assumes of them; None without intruders."""
    who = fleet.intruders(s)
    return Intruders(who, limits(s), s.intruders.assume) if who else None


def _navigation(s: Scenario, b: Barrier, goal: Array) -> Filter:
    from filters.rivals.navigation import NavigationFilter

    p = s.navigation
    # The paper's potential draws each vehicle back to the line from its start; the same seed gives it again.
    start, _ = places(s, generators(s.seed)["start"])
    return NavigationFilter(
        goal,
        start.position,
        speed=p.speed_mps,
        gain=p.heading_gain_per_s,
        path_radius=p.path_radius_m,
        path_gain=p.path_gain,
        exponent=p.potential_exponent,
        swirl=p.swirl,
        vehicle_radius=p.vehicle_radius_m,
        vehicle_margin=p.vehicle_margin_m,
        disc_radius=p.disc_radius_m,
        disc_margin=p.disc_margin_m,
        sensing_range=p.sensing_range_m,
        step=p.difference_step_m,
    )


def _flow(s: Scenario, b: Barrier, goal: Array) -> Filter:
    from filters.flow.flow_filter import FlowFilter
    from testbed.components.flow_margin import flow_margin, flow_slew, spare_airspeed

    said = s.filter
    if not isinstance(said, control.Flow):
        raise ValueError(f"filter {said.kind!r} is no flow filter")
    for what, there in (("fences", bool(s.fence)), ("intruders", bool(fleet.intruders(s)))):
        if there:
            raise UserError(f"filter.kind: 'flow' knows no {what}; 'centralised' and 'limited' do")
    gamma = b.manoeuvre(s.vehicles)
    if gamma is None:
        raise UserError("filter.kind: 'flow' needs one evading manoeuvre, and this barrier has none for all")
    try:
        flying = airframes(s) if s.plant == "jsbsim" else []
        margin, numbers = flow_margin(s, gamma, model_lags(s), limits(s), flying)
        made = FlowFilter(
            model_lags(s),
            gamma,
            s.d_safe_m,
            s.rates.filter_dt_s,
            margin,
            said.kappa,
            said.cost,
            said.trust,
            numbers,
            said.h_margin_m,
            flow_slew(said),
        )
        made.record.checks["flow_wind"].see(0, *spare_airspeed(s, gamma, flying))
        return made
    except ValueError as error:
        raise UserError(f"filter: {error}") from None


def _plans(s: Scenario, b: Barrier, goal: Array) -> Filter:
    return rivals.plans_filter(s, b, model_lags(s))


def _rival(s: Scenario, b: Barrier, goal: Array) -> Filter:
    return rivals.rival(s, b, alpha(s), intruders(s))


def _passthrough(s: Scenario, b: Barrier, goal: Array) -> Filter:
    return Passthrough()


FILTERS: dict[str, Callable[[Scenario, Barrier, Array], Filter]] = {
    "centralised": _collision,
    "limited": _collision,
    "navigation": _navigation,
    "flow": _flow,
    "collision-cone": _rival,
    "optimal-decay": _rival,
    "velocity-obstacles": _rival,
    "backup": _plans,
    "gatekeeper": _plans,
    "receding-horizon": _plans,
    "none": _passthrough,
}


def filter_(s: Scenario, b: Barrier, goal: Array) -> Choose:
    """The filter of the scenario with its remedies; `b` is the barrier that verdicts use."""
    changed = remedies.scenario(s)
    own = b if changed is s else barrier(changed)
    return remedies.wrap(s, FILTERS[s.filter.kind](s, own, goal), own, lags)


def guidance(s: Scenario, goal: Array, b: Barrier) -> Guidance:
    """What the vehicles want, for goals (N, 3) m."""

    def gamma() -> Command:
        found = b.manoeuvre(s.vehicles)
        if found is None:
            raise UserError(
                "guidance.kind: 'manoeuvre' and 'roundabout' need one evading manoeuvre; this barrier has one"
                " per pair"
            )
        return found

    def start() -> Array:
        return places(s, generators(s.seed)["start"])[0].position

    law = fleet_guidance(
        Fleet(fleet.guidances(s), limits(s), goal, gamma, start, s.d_safe_m, s.goal_radius_m)
    )
    if s.goal.on_arrival != "loiter":
        return law
    seeks = guidance_rules.seeking(s)
    return CircleAtGoal(law, goal, s.goal_radius_m, seeks, b.manoeuvre(s.vehicles), limits(s))


def _unicycle(s: Scenario) -> Plant:
    from aircraft.kinematic import KinematicFleet

    return KinematicFleet(s.vehicles, s.rates.fdm_dt_s)


def _jsbsim(s: Scenario) -> Plant:
    from aircraft.jsbsim.fleet import JsbsimFleet
    from testbed.environment.gusts import JSBSIM_SEVERITY, W20_MPS

    own = s.gusts.jsbsim_turbulence
    turbulence = None if own == "none" else (W20_MPS[own], JSBSIM_SEVERITY[own])
    return JsbsimFleet(airframes(s), s.rates.fdm_dt_s, turbulence=turbulence, workers=fleet_workers(s))


def _lagged(s: Scenario) -> Plant:
    from aircraft.kinematic import KinematicFleet

    return KinematicFleet(s.vehicles, s.rates.fdm_dt_s, lags(s))


PLANTS = {"unicycle": _unicycle, "lagged": _lagged, "jsbsim": _jsbsim}


def plant(s: Scenario, wind: Array | None = None) -> Plant:
    """The vehicles, still to be `reset`; `wind` is not used: `reset` is given it."""
    return PLANTS[s.plant](s)


def disturbance(s: Scenario, rngs: dict[str, np.random.Generator]) -> Environment:
    """The air and what the vehicles know, drawing from the generators named gust, noise and network."""
    from testbed.environment.environment import build

    return build(s, rngs)


def lags(s: Scenario) -> list[tuple[Lag, ...]]:
    """The lags of the channels, per vehicle or once for all: of the lagged plant, and for predictions."""
    if s.lags.source == "table" and s.plant != "jsbsim":
        return [remedies.lag_table(s.lags)]
    each = airframes(s)
    # Once for each airframe: whether its lags are still those of its files is read from the files.
    of = {name: remedies.identified_lags(a, s.lags.limits) for name, a in {a.name: a for a in each}.items()}
    return [of[airframe.name] for airframe in each]


def model_lags(s: Scenario) -> list[tuple[Lag, ...]]:
    """The lags in the model of a filter that has one; a unicycle has none, unless the table says some."""
    if s.plant == "unicycle" and s.lags.source == "airframe":
        return [(Lag(0.0),) * 3]
    return lags(s)


def airframes(s: Scenario) -> list[Any]:
    known = {name: _airframe(s, name) for name in sorted(set(fleet.named_airframes(s)))}
    # Tables, recordings and hashes tell airframes apart by name.
    for (one, a), (other, b) in itertools.combinations(known.items(), 2):
        if a.name == b.name and (a.folder, a.gains) != (b.folder, b.gains):
            raise UserError(f"airframes: {one} and {other} are both called {a.name}; rename one in its files")
    return [known[name] for name in fleet.airframes(s)]


def _airframe(s: Scenario, name: str) -> Any:
    from aircraft.airframe import load

    try:
        return load(path_of(name, s.airframes_folder) + (f"@{s.sensors}" if s.sensors else ""))
    except (FileNotFoundError, ValueError) as error:
        hint = "; a relative folder starts beside the scenario file, or where the command is given"
        missing = isinstance(error, FileNotFoundError) and any(relative([name]))
        own = (f"vehicle.{k}.airframe" for k, v in enumerate(s.vehicle, 1) if v.airframe == name)
        where = "airframes" if name in s.airframes else next(own)
        raise UserError(f"{where}: {error}{hint if missing else ''}") from None


def airframe_hashes(s: Scenario, loaded: Sequence[Any] = ()) -> dict[str, str]:
    """SHA-256 of the files and gains of each airframe that flies, or whose lags are used.

    loaded  `airframes(s)`, where they have been loaded
    """
    lags = s.lags.source == "airframe" and (
        s.plant == "lagged" or s.remedy.predict_lags or s.filter.kind in control.MODELS_LAGS
    )
    if s.plant != "jsbsim" and not lags:
        return {}
    known = {airframe.name: airframe for airframe in loaded or airframes(s)}
    return {name: airframe.fingerprint() for name, airframe in known.items()}
