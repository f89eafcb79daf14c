"""The tables of a scenario file, each with its defaults and the checks it can make alone."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
TurnRate = Annotated[float, Field(ge=-360, le=360)]


class Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class Rates(Section):
    """Periods of the flight dynamics, of the filter and of recording; the latter two are multiples."""

    fdm_dt_s: Annotated[float, Field(ge=1e-4, le=1)] = 0.005
    filter_dt_s: Positive = 0.005
    record_dt_s: Positive = 0.005

    @model_validator(mode="after")
    def divide(self) -> Rates:
        for name in ("filter", "record"):
            period = getattr(self, f"{name}_dt_s")
            ratio = period / self.fdm_dt_s
            if abs(ratio - round(ratio)) > 1e-6 or round(ratio) < 1:
                below, above = max(1, math.floor(ratio)), max(1, math.ceil(ratio))
                choices = " or ".join(f"{k * self.fdm_dt_s:g}" for k in sorted({below, above}))
                raise ValueError(
                    f"{name} period {period:g} s is not a multiple of the FDM period {self.fdm_dt_s:g} s;"
                    f" try {choices}"
                )
        ratio = self.record_dt_s / self.filter_dt_s
        if abs(ratio - round(ratio)) > 1e-6 or round(ratio) < 1:
            below, above = max(1, math.floor(ratio)), max(1, math.ceil(ratio))
            choices = " or ".join(f"{k * self.filter_dt_s:g}" for k in sorted({below, above}))
            raise ValueError(
                f"record period {self.record_dt_s:g} s is not a multiple of the filter period"
                f" {self.filter_dt_s:g} s; try {choices}"
            )
        return self

    @property
    def fdm_steps(self) -> int:
        """FDM periods per filter period."""
        return round(self.filter_dt_s / self.fdm_dt_s)

    @property
    def record_steps(self) -> int:
        """Filter periods per recording."""
        return round(self.record_dt_s / self.filter_dt_s)


class InputSet(Section):
    """The input set U: what the filter may command."""

    v_min_mps: Positive = 15.0
    v_max_mps: Positive = 25.0
    omega_max_degps: Annotated[float, Field(ge=0, le=360)] = 13.0
    zeta_max_mps: NonNegative = 3.9

    @model_validator(mode="after")
    def ordered(self) -> InputSet:
        if self.v_min_mps > self.v_max_mps:
            raise ValueError(f"v_min_mps {self.v_min_mps:g} is above v_max_mps {self.v_max_mps:g}")
        return self


class Place(Section):
    """Where one vehicle starts, and its goal."""

    x_m: float
    y_m: float
    course_deg: Annotated[float, Field(ge=-720, le=720)]
    z_m: float = 0.0
    goal_x_m: float
    goal_y_m: float
    goal_z_m: float = 0.0


class Start(Section):
    """Initial poses: on a circle facing its centre with the goal opposite, or listed one by one."""

    pattern: Literal["circle", "list"] = "circle"
    radius_m: Positive = 200.0
    course_offset_deg: Annotated[float, Field(ge=-180, le=180)] = 0.0
    heights_m: list[float] = Field(
        default=[0.0], min_length=1, description="one for all, or one per vehicle, repeated in turn"
    )
    places: list[Place] = Field(default=[], description="for pattern = 'list': one per vehicle")
    speed_mps: Positive = Field(
        default=20.0, description="an aircraft's first ground speed; a unicycle has none"
    )
    round_decimals: Annotated[int, Field(ge=0, le=12)] | None = Field(
        default=None, description="x, y [m] and course [deg] rounded so, as in the published runs"
    )
    lateral_perturbation_m: NonNegative = Field(default=0.0, description="uniform, across the course")
    heading_perturbation_deg: Annotated[float, Field(ge=0, le=180)] = Field(
        default=0.0, description="uniform"
    )
    height_perturbation_m: NonNegative = Field(default=0.0, description="uniform")


class Nominal(Section):
    """The goal-seeking controller that the filter alters."""

    controller: Literal["near-identity", "manoeuvre"] = "near-identity"
    lookahead_m: Positive = 1.0
    gain_per_s: Positive = 0.1
    delay_steps: Annotated[int, Field(ge=0, le=1000)] = Field(
        default=0, description="filter steps by which u_hat is old; before there is one it is zero"
    )


class Alpha(Section):
    """The extended class-K function alpha(h)."""

    kind: Literal["linear", "cubic", "odd-polynomial"] = "cubic"
    coefficient: Positive = 0.1
    coefficients: list[NonNegative] = Field(default=[], description="of h, h^3, h^5, ... for odd-polynomial")

    @model_validator(mode="after")
    def complete(self) -> Alpha:
        if self.kind == "odd-polynomial" and not any(self.coefficients):
            raise ValueError("coefficients: an odd polynomial needs at least one positive coefficient")
        return self


class Manoeuvre(Section):
    """A constant input: straight, a turn, a climb, or any mixture."""

    v_mps: Positive
    omega_degps: TurnRate = 0.0
    zeta_mps: float = 0.0


class Pair(Section):
    """The turn that one pair evades by, where every pair has a manoeuvre of its own."""

    i: Annotated[int, Field(ge=1)]
    j: Annotated[int, Field(ge=2)]
    v_mps: Positive
    omega_degps: TurnRate


class Barrier(Section):
    """The evading manoeuvre gamma and the barrier function built from it."""

    kind: Literal["turn", "straight", "rollout", "euclidean"] = "turn"
    form: Literal["root", "squared"] = "root"
    v_mps: Positive = 16.0
    omega_degps: TurnRate = Field(default=11.7, description="of the turn")
    sigma: Positive | list[Positive] = Field(default=1.0, description="turn: speed ratio, one or per vehicle")
    delta_m2: NonNegative = Field(default=0.01, description="turn: the paper's rounding of the kink")
    smoothing_m2: NonNegative = Field(
        default=0.0, description="turn: eps of the smoothed barrier; 0 is the paper's, we recommend 30"
    )
    speed_step: NonNegative = Field(
        default=0.01, description="straight: vehicle i (from 1) evades at v_mps (1 + speed_step i)"
    )
    zeta_mps: float | list[float] = Field(default=0.0, description="straight: climb rate, one or per vehicle")
    manoeuvres: list[Manoeuvre] = Field(default=[], description="rollout: one for all, or one per vehicle")
    shared: bool = Field(
        default=True, description="false lets every pair have its own manoeuvre, which voids Theorem 3"
    )
    pairs: list[Pair] = Field(default=[], description="turn, with shared = false: each pair's manoeuvre")
    gradient: Literal["analytic", "forward"] = Field(
        default="analytic", description="forward: by differences, as in the published runs"
    )
    gradient_step: Annotated[float, Field(gt=0, le=1)] = Field(default=1e-4, description="m and rad")

    @model_validator(mode="after")
    def complete(self) -> Barrier:
        if self.kind == "turn" and self.omega_degps == 0:
            raise ValueError("omega_degps: a turn needs a turn rate other than zero")
        if self.kind == "rollout" and not self.manoeuvres:
            raise ValueError("manoeuvres: a rollout needs at least one manoeuvre")
        if self.pairs and self.shared:
            raise ValueError(
                "pairs: a manoeuvre for each pair breaks the shared-manoeuvre assumption"
                " (Assumption 1 of the paper); say shared = false to study just that"
            )
        if not self.shared and not self.pairs:
            raise ValueError("pairs: shared = false needs each pair's manoeuvre listed")
        return self


class Filter(Section):
    """What stands between the nominal controller and the vehicles."""

    kind: Literal["centralised", "limited", "navigation", "none"] = "centralised"
    solver: Literal["auto", "osqp"] = Field(
        default="auto", description="of the QPs: auto is the fastest one measured; every answer is checked"
    )
    monitor: bool = Field(default=False, description="check Theorems 3 and 4 at every step, and compare QPs")


class Checks(Section):
    """Checks that cost more than watching the run."""

    manoeuvre_instants: Annotated[int, Field(ge=0, le=1000)] = Field(
        default=4,
        description="instants, besides that of least h, from which vehicles really fly gamma; 0 is none",
    )


class Navigation(Section):
    """The navigation-function baseline, with the parameters its authors' comparison used."""

    speed_mps: Positive = 20.0
    heading_gain_per_s: Positive = 0.6
    path_radius_m: Positive = Field(default=20.0, description="r_p: closer to the goal the path fades")
    path_gain: NonNegative = Field(default=20.0, description="K_p: pull towards the line from start to goal")
    potential_exponent: Positive = Field(default=0.2, description="k of the navigation function")
    swirl: NonNegative = Field(default=0.08, description="K_s: share of the gradient across lines of sight")
    vehicle_radius_m: NonNegative = Field(default=0.0, description="rho_j: contact with a vehicle")
    vehicle_margin_m: Positive = Field(default=5.0, description="delta_j: a vehicle repels from there on")
    disc_radius_m: Positive = Field(default=2000.0, description="rho_c: disc about the origin to stay in")
    disc_margin_m: Positive = Field(default=5.0, description="delta_c: its edge repels from there on")
    sensing_range_m: Positive = 400.0
    difference_step_m: Positive = Field(default=1.0, description="of the gradient's central differences")


class Wind(Section):
    """Steady wind: the air's motion over the ground at the shared origin's height, 300 m above the ground."""

    speed_mps: Annotated[float, Field(ge=0, le=100)] = 0.0
    towards_deg: Annotated[float, Field(ge=-360, le=360)] = Field(
        default=0.0, description="where the air moves to, counter-clockwise from east"
    )
    updraft_mps: Annotated[float, Field(ge=-30, le=30)] = 0.0
    shear_exponent: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.0, description="power law of the height above ground; 1/7 is usual over open land"
    )
    shear_per_s: Annotated[float, Field(ge=-1, le=1)] = Field(
        default=0.0, description="linear shear: m/s more along towards_deg per metre of height"
    )

    @model_validator(mode="after")
    def one_shear(self) -> Wind:
        if self.shear_exponent and self.shear_per_s:
            raise ValueError("shear_exponent and shear_per_s are two laws of one thing; set one of them")
        return self


class Gusts(Section):
    """Dryden gusts (MIL-F-8785C): one field in space, drawn from the seed, carried by the steady wind."""

    intensity: Literal["none", "light", "moderate", "severe"] = Field(
        default="none",
        description="sigma 0.77, 1.54 or 2.32 m/s: a tenth of 15, 30 or 45 kt of wind at 20 ft",
    )
    sigma_mps: Annotated[float, Field(ge=0, le=20)] | None = Field(
        default=None, description="of each component; replaces what intensity says"
    )
    length_scale_m: Annotated[float, Field(ge=1, le=1e5)] = Field(
        default=300.0, description="the Dryden L; 300 m belongs to 300 m above the ground"
    )
    independent: bool = Field(
        default=False, description="every vehicle meets a field of its own, however close they fly"
    )
    jsbsim_turbulence: Literal["none", "light", "moderate", "severe"] = Field(
        default="none",
        description="JSBSim's own MIL-F-8785C gusts, each aircraft's drawn apart and with gusts of rotation;"
        " plant 'jsbsim' only, and not in the recorded wind",
    )


class Sensing(Section):
    """Errors of what is known of a vehicle: white noise, drift (first-order Gauss-Markov) and constant bias.

    Every number is a standard deviation. Position errors hold for east, north and up alike, speed errors for
    ground speed and climb rate.
    """

    position_noise_m: NonNegative = Field(default=0.0, description="drawn anew at every filter step")
    position_drift_m: NonNegative = Field(default=0.0, description="correlated over drift_time_s")
    position_bias_m: NonNegative = Field(default=0.0, description="drawn once")
    course_noise_deg: NonNegative = 0.0
    course_drift_deg: NonNegative = 0.0
    course_bias_deg: NonNegative = 0.0
    speed_noise_mps: NonNegative = 0.0
    speed_drift_mps: NonNegative = 0.0
    speed_bias_mps: NonNegative = 0.0
    turn_rate_noise_degps: NonNegative = 0.0
    turn_rate_drift_degps: NonNegative = 0.0
    turn_rate_bias_degps: NonNegative = 0.0
    drift_time_s: Positive = Field(default=30.0, description="correlation time of all drifts")
    source: Literal["broadcast", "sensors"] = Field(
        default="broadcast",
        description="broadcast: each vehicle measures itself and tells the others; sensors: every vehicle"
        " measures itself and all others, each with errors of its own",
    )
    delay_s: Annotated[float, Field(ge=0, le=60)] = Field(
        default=0.0, description="age of every measurement, a vehicle's of itself too"
    )


class Network(Section):
    """Links between vehicles; with a centralised filter, from every vehicle to the one computer."""

    latency_s: Annotated[float, Field(ge=0, le=60)] = Field(
        default=0.0, description="added to sensing.delay_s; between filter steps states are interpolated"
    )
    loss: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.0, description="probability per link and filter step"
    )
    stale: Literal["hold", "extrapolate-lost", "extrapolate"] = Field(
        default="hold",
        description="hold: the last state heard, as it stands; extrapolate-lost: carried on at its rates over"
        " the steps lost; extrapolate: over its whole age, delay and latency included",
    )


class Lags(Section):
    """How the lagged plant follows its commands: per channel a delay, a first-order lag and a rate limit."""

    source: Literal["airframe", "table"] = Field(
        default="airframe",
        description="airframe: what was identified on each vehicle's airframe; table: the numbers below",
    )
    limits: bool = Field(default=True, description="false: without the rate limits")
    v_time_constant_s: NonNegative | None = Field(default=None, description="absent: 1")
    v_delay_s: NonNegative = 0.0
    v_rise_max_mps2: Positive | None = Field(default=None, description="absent: no limit")
    v_fall_max_mps2: Positive | None = Field(default=None, description="deceleration; absent: no limit")
    omega_time_constant_s: NonNegative | None = Field(default=None, description="absent: 0.35")
    omega_delay_s: NonNegative = 0.0
    omega_change_max_degps2: Positive | None = Field(default=None, description="absent: no limit")
    zeta_time_constant_s: NonNegative | None = Field(default=None, description="absent: 0.3")
    zeta_delay_s: NonNegative = 0.0
    zeta_change_max_mps2: Positive | None = Field(default=None, description="absent: no limit")

    @model_validator(mode="after")
    def one_source(self) -> Lags:
        for name, field in type(self).model_fields.items():
            if name in ("source", "limits") or self.source == "table":
                continue
            if getattr(self, name) != field.default:
                raise ValueError(f'{name}: the airframe says how it lags; set lags.source = "table" too')
        return self


Share = Annotated[float, Field(gt=0, le=1)]


class Remedy(Section):
    """What the filter does about vehicles that are no unicycles. Verdicts never see any of it.

    In this order: the filter's barrier is built with a larger Ds, a derated manoeuvre or smoothing; its rows
    get margins; it looks at predicted poses; all of that in the frame of the air.
    """

    ds_buffer_m: NonNegative = Field(default=0.0, description="the filter keeps Ds and this")
    derate: Share = Field(default=1.0, description="the filter's gamma turns at this share of its turn rate")
    derate_speed: Share = Field(default=1.0, description="and flies at this share of its speed")
    smoothing_m2: NonNegative = Field(
        default=0.0, description="turn: eps of the filter's barrier, with delta 0; 30 is recommended"
    )
    robust_v_mps: NonNegative = Field(default=0.0, description="bound of |achieved - commanded| in the rows")
    robust_omega_degps: NonNegative = 0.0
    robust_zeta_mps: NonNegative = 0.0
    issf_epsilon: Positive | None = Field(
        default=None, description="m/s (m^2/s for a squared h): rows raised by |W L_g h|^2 / epsilon"
    )
    issf_v_mps: NonNegative = Field(default=1.0, description="W: errors of comparable weight")
    issf_omega_degps: NonNegative = 2.0
    issf_zeta_mps: NonNegative = 1.0
    prediction_s: Annotated[float, Field(ge=0, le=10)] = Field(
        default=0.0, description="poses advanced by so long at the measured rates"
    )
    predict_lags: bool = Field(
        default=False,
        description="poses predicted by each channel's lag: the airframe's identified one, or of [lags]",
    )
    air_mass: bool = Field(default=False, description="filter in the frame of the steady wind, then known")

    @model_validator(mode="after")
    def complete(self) -> Remedy:
        if self.prediction_s and self.predict_lags:
            raise ValueError("prediction_s and predict_lags both predict the pose; set one of them")
        scales = ("issf_v_mps", "issf_omega_degps", "issf_zeta_mps")
        if self.issf_epsilon is None:
            for name in scales:
                if getattr(self, name) != type(self).model_fields[name].default:
                    raise ValueError(f"{name}: has no effect without issf_epsilon")
        elif not any(getattr(self, name) for name in scales):
            raise ValueError("issf_epsilon: needs a scale above 0, such as issf_omega_degps = 2")
        return self

    @property
    def chosen(self) -> list[str]:
        """The fields that say something other than "off"."""
        return [name for name, f in type(self).model_fields.items() if getattr(self, name) != f.default]

    def check(self, filter_: Filter, barrier: Barrier) -> None:
        """Raises ValueError naming the first remedy that this filter or barrier cannot take."""
        for name in self.chosen:
            if filter_.kind == "none" or (filter_.kind == "navigation" and name != "prediction_s"):
                raise ValueError(f"remedy.{name}: filter '{filter_.kind}' cannot take it")
            if filter_.monitor and name not in ("ds_buffer_m", "derate", "derate_speed", "smoothing_m2"):
                raise ValueError(f"remedy.{name}: filter.monitor checks the paper's own QPs; set it to false")
            if name == "smoothing_m2" and (barrier.kind != "turn" or barrier.pairs):
                raise ValueError("remedy.smoothing_m2: only a turn barrier shared by all pairs has smoothing")
            if name == "derate" and barrier.kind not in ("turn", "rollout"):
                raise ValueError(f"remedy.derate: a '{barrier.kind}' barrier has no turn; try derate_speed")
            if name == "derate_speed" and barrier.kind == "euclidean":
                raise ValueError("remedy.derate_speed: a 'euclidean' barrier has no manoeuvre")
            if name == "predict_lags" and (barrier.pairs or barrier.kind == "euclidean"):
                raise ValueError("remedy.predict_lags: needs one evading manoeuvre, that of the barrier")
