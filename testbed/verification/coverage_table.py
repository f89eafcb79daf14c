"""The table of what checks each column and field of a run folder: findings by name, or the reason for none.

A test compares it with everything that the writer of run folders knows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from testbed.claims import registry
from testbed.verification.recorded import Recorded
from testbed.verification.settings import box

FLY = "only flying it again shows it"


@dataclass(frozen=True)
class Checked:
    """What checks an item.

    by         names of findings, any of which may decide it; "" stands for the claim's own. Empty: none does
    otherwise  why it is not covered where none of them decides
    always     whether every run has it
    needs      whether it had an effect on the run; None: it always has
    given      what checks it in that run, where that is not the same in all; None: this
    """

    by: tuple[str, ...]
    otherwise: str = ""
    always: bool = True
    needs: Callable[[Recorded], bool] | None = None
    given: Callable[[Recorded], Checked] | None = None


def _by(*names: str, otherwise: str = "not checked in this run") -> Checked:
    return Checked(names, otherwise)


def _no(why: str) -> Checked:
    return Checked((), why)


def _sometimes(checked: Checked) -> Checked:
    return replace(checked, always=False)


_FLAG = _no("the autopilot's limiter is not modelled here")
AIRCRAFT = {
    "roll_rad": _by("roll_rad", "beta_rad"),
    "pitch_rad": _by("alpha_rad"),
    "heading_rad": _by("beta_rad"),
    "alpha_rad": _by("alpha_rad"),
    "beta_rad": _by("beta_rad"),
    "airspeed_mps": _by("airspeed_mps"),
    "throttle": _no("no formula gives the throttle"),
    "load_factor": _by("load_factor"),
    "limited_v": _FLAG,
    "limited_omega": _FLAG,
    "limited_zeta": _FLAG,
}
_WIND = _by("wind", "airspeed_mps")
WIND = {"wind_east_mps": _WIND, "wind_north_mps": _WIND, "wind_up_mps": _WIND}
DECLARED = ("h_declared", "alpha_declared")
VEHICLES = {
    "t_s": _by("rows"),
    "vehicle": _by("rows"),
    "x_m": _by("motion"),
    "y_m": _by("motion"),
    "z_m": _by("motion"),
    "theta_rad": _by("motion"),
    "v_mps": _by("motion"),
    "omega_radps": _by("course"),
    "zeta_mps": _by("motion"),
    "v_nominal_mps": _by("nominal", otherwise="what the controller saw is not recorded"),
    "omega_nominal_radps": _by("nominal", otherwise="what the controller saw is not recorded"),
    "zeta_nominal_mps": _by("nominal", otherwise="what the controller saw is not recorded"),
    "v_command_mps": _by("minimal", otherwise="the rows of the filter are not known"),
    "omega_command_radps": _by("minimal", otherwise="the rows of the filter are not known"),
    "zeta_command_mps": _by("minimal", otherwise="the rows of the filter are not known"),
    "override": _by("override"),
    "qp_status": _by("qp_status"),
    "left": _sometimes(_by("left")),
    **{name: _sometimes(checked) for name, checked in (AIRCRAFT | WIND).items()},
}
PAIRS = {
    "t_s": _by("rows"),
    "i": _by("rows"),
    "j": _by("rows"),
    "distance_m": _by("distance_m"),
    "h_m": _by("h_m"),
    "h_filter_m": _by("h_filter_m"),
    "hdot_predicted_mps": _by("hdot_predicted", otherwise="h is not known"),
    "hdot_realised_mps": _by("hdot_realised", otherwise="h is not known"),
    **{
        f"residual_{name}_mps": _by(f"residual_{name}", otherwise="the steps that follow are not recorded")
        for name in ("v", "omega", "zeta", "course")
    },
    # "declared" is compared, but shows little: forged columns that fit together agree.
    **{name: _sometimes(_no(f"only the filter's code gives its barrier; {FLY}")) for name in DECLARED},
}
FENCES = {
    "t_s": _by("rows"),
    "fence": _by("rows"),
    "vehicle": _by("rows"),
    "clearance_m": _by("clearance_m"),
    "h_m": _by("fence_h_m"),
}
MANIFEST = {
    "schema_version": _by("manifest"),
    "seed_streams": _by("manifest"),
    "versions": _no("the record does not depend on names of packages"),
    "airframes": _no("checksums of airframe files are compared when it is flown again"),
    "ended_early": _by("end"),
    "filter_steps": _by("end"),
    "worst_qp_residual": _no(FLY),
    "override_share": _by("override_share", otherwise="not every filter step was recorded"),
    "flow": _sometimes(_by("F1 monitor-flow_clear")),
    "qp_cost": _sometimes(_no("the solutions of the other QP are not recorded")),
    "declared": _sometimes(_by("entries")),
    "left_s": _sometimes(_by("left")),
    "near_pairs": _sometimes(_by("near_pairs")),
    "track_error": _sometimes(_by("track", otherwise="steps between recordings are not recorded")),
    "parts": _sometimes(_no("the user's own parts are named, not checked")),
    "files": _by("files"),
    "sha256": _by("files"),
}
TIMING = {"wall_s": _no("no two runs take the same time"), "sha256": _by("files")}
_TEXT, _OWN = _by("texts"), _by("")
# Fields of every claim but its detail.
FIELDS = {
    "id": _by("entries"),
    "number": _TEXT,
    "claim": _TEXT,
    "source": _TEXT,
    "quantity": _TEXT,
    "unit": _TEXT,
    "value": _OWN,
    "bound": _OWN,
    "margin": _OWN,
    "t_s": _OWN,
    "vehicles": _OWN,
    "verdict": _OWN,
    "why": _no("reasons in words are not checked"),
}
DETAILS = {
    registry.SEPARATION.id: {"between_steps_m": _OWN, "possible_m": _OWN},
    registry.SEPARATION_INTRUDERS.id: {"between_steps_m": _OWN, "possible_m": _OWN},
    registry.QP_FEASIBILITY.id: {"infeasible": _OWN, "iteration_limit": _OWN, "in_safe_set": _OWN},
    registry.COMMAND_LIMITS.id: {
        "achieved_v_mps": _OWN,
        "achieved_omega_radps": _OWN,
        "achieved_zeta_mps": _OWN,
        "share_at_stop": _no("surfaces' stops are not known; the autopilot's flags and the throttle are"),
    },
    registry.GOAL.id: {"last_passed_s": _by("", otherwise="not every step was recorded")},
    registry.PROGRESS.id: {
        **{name: _by("", otherwise="not every step was recorded") for name in ("arrived", "of", "waiting")},
        "added_s": _by("path-and-time"),
    },
    registry.INTERVENTION.id: {
        **{name: _OWN for name in ("altered_v_m", "altered_omega_rad", "altered_zeta_m")},
        **{name: _by("path-and-time") for name in ("path_added_m", "time_added_s")},
    },
    registry.MANOEUVRE_KEEPS_DS.id: {"branches": _OWN},
    registry.FENCE_CLEARANCE.id: {"fence": _OWN, "possible_m": _OWN},
    registry.FENCE_SAFE_SET.id: {"fence": _OWN},
}


def _reached(run: Recorded, name: str) -> bool:
    """Whether a command was at that limit."""
    channel = ("v", "omega", "zeta").index(name.partition("_")[0])
    low, high = (corner[:, channel] for corner in box(run.scenario))
    at_low, at_high = (np.any(np.abs(run.command[..., channel] - end) < 1e-9) for end in (low, high))
    return bool(at_low if "min" in name else at_high if name.startswith("v") else at_low or at_high)


def _altered(run: Recorded) -> bool:
    """Whether the filter altered any command."""
    return bool(run.vehicles["override"].any())


def _scales(run: Recorded) -> bool:
    """Whether the rows are raised by what the scales weigh."""
    return run.scenario["remedy"]["issf_epsilon"] is not None


_ROWS = _by("minimal", otherwise="what the filter saw is not recorded")
_FILTER = _by("h_filter_m", "solutions", otherwise="what the filter saw is not recorded")

_LINKS = _by("h_filter_m", otherwise="what links delivered is not recorded")


def _view(run: Recorded) -> Checked:
    """What decides where the filter's view came from: its h, if it reports one."""
    return _FILTER if _reports_h(run) else _no("the filter reports no h of what it saw")


def _links(run: Recorded) -> Checked:
    """Links to one filter for all show in its h; those to the vehicles' own filters only in their rows."""
    if run.scenario["filter"]["kind"] == "limited":
        return _ROWS
    return _LINKS if _reports_h(run) else _view(run)


def _reports_h(run: Recorded) -> bool:
    return bool(np.isfinite(run.pairs.get("h_filter_m", np.empty(0))).any())


_LABEL = _no("a label")
# Settings of rival filters.
OF_RIVALS = (
    *("decay_per_s", "speed_response_s", "climb_response_s"),
    *("response_s", "responsibility", "space"),
)
# By field, or by table ("wind.").
_PLANS = "plans of programs are not solved again"
SCENARIO = {
    "schema_version": _by("scenario"),
    "name": _LABEL,
    "description": _LABEL,
    "vehicles": _by("rows"),
    "duration_s": _by("end"),
    "seed": _no("only starts are drawn again"),
    "plant": _by("plant"),
    "airframes": _by("manifest", otherwise="no aircraft flies"),
    "airframes_folder": _no("where the airframes were found"),
    "sensors": _by("manifest", otherwise="no aircraft flies"),
    "d_safe_m": _by("h_m", "G1 separation"),
    "goal_radius_m": _by("G7 goal", "left", otherwise="no vehicle has a goal"),
    "goal.": _by("left", "nominal", otherwise="what the controller saw is not recorded"),
    "rates.fdm_dt_s": _no("steps of the flight dynamics are not recorded"),
    "rates.": _by("rows", "end"),
    **{
        f"limits.{name}": replace(_by("minimal"), needs=partial(_reached, name=name))
        for name in ("v_min_mps", "v_max_mps", "omega_max_degps", "zeta_max_mps")
    },
    "start.speed_mps": _by("start-speed", otherwise="unicycles fly the first command at once"),
    "start.": _by("start", otherwise="the plant was not the scenario's"),
    "guidance.": _by("nominal", otherwise="what the controller saw is not recorded"),
    "filter.solver": _no("solvers find the same solution"),
    "filter.monitor": _by("entries"),
    "filter.margin_m": _by("F1 monitor-flow_clear", "R3 monitor-plan_clear", otherwise=_PLANS),
    "filter.trust": _by("F1 monitor-flow_clear", "R3 monitor-plan_clear", otherwise=_PLANS),
    "filter.speed_slew_mps2": _by("F1 monitor-flow_clear"),
    "filter.climb_slew_mps2": _by("F1 monitor-flow_clear"),
    "filter.kappa": _by("F2 monitor-flow_step", otherwise=_PLANS),
    "filter.range_m": _no("whom a rival looked at is not recorded"),
    **{f"filter.{name}": _no("the QPs of rivals are not solved again") for name in OF_RIVALS},
    "filter.horizon_s": _by("R3 monitor-plan_clear", otherwise="the QPs of rivals are not solved again"),
    "filter.": replace(_ROWS, needs=_altered),
    "barrier.gradient": _FILTER,
    "barrier.gradient_step": _FILTER,
    "barrier.": _by("h_m", otherwise="a manoeuvre that is not flown here"),
    "alpha.": _by("G3 barrier-condition", otherwise="h is not known"),
    "fence": _by("fence_h_m", "clearance_m"),
    "vehicle": _by("start", otherwise="the plant was not the scenario's"),
    "intruders.": replace(_ROWS, needs=_altered),
    "navigation.": _no("the navigation function is not computed again"),
    "checks.": _by("G9 manoeuvre-keeps-Ds", "entries"),
    "lags.": _no("lags are not computed again"),
    **{
        f"remedy.issf_{name}": replace(_ROWS, needs=lambda run: bool(_scales(run) and _altered(run)))
        for name in ("v_mps", "omega_degps", "zeta_mps")
    },
    **{
        f"remedy.{name}": replace(_ROWS, needs=_altered)
        for name in ("issf_epsilon", "robust_v_mps", "robust_omega_degps", "robust_zeta_mps")
    },
    "remedy.": replace(_FILTER, given=_view),
    "wind.": _by("wind", "columns"),
    "gusts.intensity": _by("wind", otherwise="gusts are not computed again"),
    "gusts.sigma_mps": _by("wind", otherwise="gusts are not computed again"),
    "gusts.jsbsim_turbulence": _by("airspeed_mps", otherwise="JSBSim's gusts are not recorded"),
    "gusts.": _no("gusts are not computed again"),
    "sensing.range_m": _sometimes(_by("P7 range-is-enough")),
    "sensing.drift_time_s": _no("errors of sensors are not recorded"),
    "sensing.source": _no("errors of sensors are not recorded"),
    "sensing.": replace(_FILTER, given=_view),
    "network.stale": _no("what links delivered is not recorded"),
    "network.": replace(_LINKS, given=_links),
}
