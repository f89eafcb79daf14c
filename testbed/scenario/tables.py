"""The tables of a scenario file that have one kind: rates, input set, checks, the navigation function."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, model_validator

from testbed.scenario.fields import NonNegative, Positive, Section, Speed, TurnLimit

MOST_WORKERS = 256


def _whole(name: str, period_s: float, unit_name: str, unit_s: float) -> None:
    """ValueError with the nearest remedies unless one period is a whole multiple of the other."""
    ratio = period_s / unit_s
    if abs(ratio - round(ratio)) > 1e-6 or round(ratio) < 1:
        below, above = max(1, math.floor(ratio)), max(1, math.ceil(ratio))
        choices = " or ".join(f"{k * unit_s:g}" for k in sorted({below, above}))
        raise ValueError(
            f"{name} period {period_s:g} s is not a multiple of the {unit_name} period {unit_s:g} s;"
            f" try {choices}"
        )


def _workers(said: object) -> object:
    if said == "auto" or (type(said) is int and 1 <= said <= MOST_WORKERS):
        return said
    raise ValueError(f"a whole number of processes from 1 to {MOST_WORKERS}, or 'auto', not {said!r:.40}")


class Rates(Section):
    """Periods of the flight dynamics, of the filter and of recording; the latter two are multiples."""

    fdm_dt_s: Annotated[float, Field(ge=1e-4, le=1)] = Field(
        default=0.005, description="of flight dynamics and autopilot"
    )
    filter_dt_s: Annotated[float, Field(gt=0, le=10)] = Field(
        default=0.005, description="of the filter: a multiple of fdm_dt_s"
    )
    record_dt_s: Annotated[float, Field(gt=0, le=86400)] = Field(
        default=0.005, description="of the tables: a multiple of filter_dt_s"
    )
    # Not part of what a scenario is: plain data, manifests and names of runs leave it out.
    workers: Annotated[int | Literal["auto"], BeforeValidator(_workers)] = Field(
        default="auto",
        exclude=True,
        description="processes that step the aircraft of one run; the same numbers for any. auto: one per"
        " processor where the fleet is large enough to gain, one within a campaign's worker",
    )

    @model_validator(mode="after")
    def divide(self) -> Rates:
        _whole("filter", self.filter_dt_s, "FDM", self.fdm_dt_s)
        _whole("record", self.record_dt_s, "FDM", self.fdm_dt_s)
        _whole("record", self.record_dt_s, "filter", self.filter_dt_s)
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

    v_min_mps: Speed = Field(default=15.0, description="least ground speed")
    v_max_mps: Speed = Field(default=25.0, description="largest ground speed")
    omega_max_degps: TurnLimit = Field(default=13.0, description="largest turn rate, to either side")
    zeta_max_mps: Annotated[float, Field(ge=0, le=1000)] = Field(
        default=3.9, description="largest climb and sink rate"
    )

    @model_validator(mode="after")
    def ordered(self) -> InputSet:
        if self.v_min_mps > self.v_max_mps:
            raise ValueError(f"v_min_mps {self.v_min_mps:g} is above v_max_mps {self.v_max_mps:g}")
        return self


class Goal(Section):
    """What a vehicle does that has come within `goal_radius_m` of its goal."""

    on_arrival: Literal["fly-on", "loiter", "leave"] = Field(
        default="fly-on",
        description="fly-on: guidance goes on as before; loiter: it circles its goal as its manoeuvre turns;"
        " leave: from that filter step on it is neither seen nor judged",
    )


class Checks(Section):
    """Checks that need flights of their own after the run."""

    manoeuvre_instants: Annotated[int, Field(ge=0, le=1000)] = Field(
        default=6,
        description="instants from which vehicles really fly gamma, most where pairs drew near; 0 is none",
    )


class Navigation(Section):
    """The navigation-function baseline, with the parameters its authors' comparison used."""

    speed_mps: Positive = Field(default=20.0, description="constant ground speed")
    heading_gain_per_s: Positive = Field(default=0.6, description="turn rate per heading error")
    path_radius_m: Positive = Field(default=20.0, description="r_p: closer to the goal the path fades")
    path_gain: NonNegative = Field(default=20.0, description="K_p: pull towards the line from start to goal")
    potential_exponent: Positive = Field(default=0.2, description="k of the navigation function")
    swirl: NonNegative = Field(default=0.08, description="K_s: share of the gradient across lines of sight")
    vehicle_radius_m: NonNegative = Field(default=0.0, description="rho_j: contact with a vehicle")
    vehicle_margin_m: Positive = Field(default=5.0, description="delta_j: a vehicle repels from there on")
    disc_radius_m: Positive = Field(default=2000.0, description="rho_c: disc about the origin to stay in")
    disc_margin_m: Positive = Field(default=5.0, description="delta_c: its edge repels from there on")
    sensing_range_m: Positive = Field(default=400.0, description="vehicles farther away are not seen")
    difference_step_m: Positive = Field(default=1.0, description="of the gradient's central differences")
