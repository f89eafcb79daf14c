"""The tables of a scenario file in which the world departs from the paper's, and what is done about it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from testbed.scenario.tables import Barrier, Filter, NonNegative, Positive, Section


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
