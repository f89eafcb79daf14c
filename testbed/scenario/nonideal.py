"""The tables of departures from the paper's assumptions: [wind], [gusts], [sensing], [network], [lags]."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from testbed.scenario.fields import NonNegative, Positive, Section
from testbed.scenario.kinds import Kinds


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
    range_m: Positive | None = Field(
        default=None,
        description="how far vehicles know of each other, by sensors or by radio; absent: however far."
        " `testbed range` prints how much is enough",
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


class _Lags(Section):
    limits: bool = Field(default=True, description="false: without the rate limits")


class AirframeLags(_Lags):
    """What was identified on each vehicle's airframe."""

    source: Literal["airframe"] = "airframe"


class TableLags(_Lags):
    """The numbers below, per channel a delay, a first-order lag and a rate limit."""

    source: Literal["table"]
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


LAGS = Kinds(
    "source",
    "airframe",
    {"airframe": AirframeLags, "table": TableLags},
    {"airframe": "lags that the airframe says", "table": "lags that the table says"},
)
Lags = Annotated[
    Annotated[AirframeLags, Tag("airframe")] | Annotated[TableLags, Tag("table")],
    Discriminator(LAGS.tag),
    BeforeValidator(LAGS.settled),
]
