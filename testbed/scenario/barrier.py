"""The [barrier] table: the evading manoeuvre gamma, and the barrier function built from it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from testbed.scenario.fields import ClimbRate, NonNegative, Section, Speed, SpeedRatio, TurnRate
from testbed.scenario.kinds import Kinds


class Manoeuvre(Section):
    """A constant input: straight, a turn, a climb, or any mixture."""

    v_mps: Speed = Field(description="ground speed")
    omega_degps: TurnRate = Field(default=0.0, description="turn rate, counter-clockwise")
    zeta_mps: ClimbRate = Field(default=0.0, description="climb rate")


class Pair(Section):
    """The turn that one pair evades by, where every pair has a manoeuvre of its own."""

    i: Annotated[int, Field(ge=1)] = Field(description="vehicle")
    j: Annotated[int, Field(ge=2)] = Field(description="vehicle, above i")
    v_mps: Speed = Field(description="ground speed of their turn")
    omega_degps: TurnRate = Field(description="turn rate")


class _Barrier(Section):
    form: Literal["root", "squared"] = Field(default="root", description="root: h in m; squared: h in m^2")
    gradient: Literal["analytic", "forward"] = Field(
        default="analytic", description="forward: by differences, as in the published runs"
    )
    gradient_step: Annotated[float, Field(gt=0, le=1)] = Field(
        default=1e-4, description="of gradient = 'forward': m and rad"
    )


class _Shared(_Barrier):
    """A barrier whose manoeuvre is the same in every pair."""

    @property
    def shared(self) -> bool:
        return True


class Turn(_Barrier):
    """h by a turn that all vehicles share."""

    kind: Literal["turn"] = "turn"
    shared: Literal[True] = Field(
        default=True, description="false lets every pair have its own manoeuvre, which voids Theorem 3"
    )
    v_mps: Speed = Field(default=16.0, description="ground speed of the turn")
    omega_degps: TurnRate = Field(default=11.7, description="turn rate")
    sigma: SpeedRatio | Annotated[list[SpeedRatio], Field(min_length=1)] = Field(
        default=1.0, description="speed ratio, one or per vehicle"
    )
    delta_m2: NonNegative = Field(default=0.01, description="the paper's rounding of the kink")
    smoothing_m2: NonNegative = Field(
        default=0.0, description="eps of the smoothed barrier; 0 is the paper's, we recommend 30"
    )

    @model_validator(mode="after")
    def turns(self) -> Turn:
        if self.omega_degps == 0:
            raise ValueError("omega_degps: a turn needs a turn rate other than zero")
        return self


class PairTurns(_Barrier):
    """h by a turn that every pair has for itself."""

    kind: Literal["turn"] = "turn"
    shared: Literal[False]
    pairs: list[Pair] = Field(default=[], description="the turn of each pair, (1, 2), (1, 3), ...")
    delta_m2: NonNegative = Field(default=0.01, description="the paper's rounding of the kink")

    @model_validator(mode="after")
    def listed(self) -> PairTurns:
        if not self.pairs:
            raise ValueError("pairs: shared = false needs each pair's manoeuvre listed")
        return self


class Straight(_Shared):
    """h by straight flight, each vehicle at a speed of its own."""

    kind: Literal["straight"]
    v_mps: Speed = Field(default=16.0, description="ground speed of the manoeuvre, before speed_step")
    speed_step: Annotated[float, Field(ge=0, le=10)] = Field(
        default=0.01, description="vehicle i (from 1) evades at v_mps (1 + speed_step i)"
    )
    zeta_mps: ClimbRate | Annotated[list[ClimbRate], Field(min_length=1)] = Field(
        default=0.0, description="climb rate, one or per vehicle"
    )


class Rollout(_Shared):
    """h by any constant manoeuvres, flown on numerically."""

    kind: Literal["rollout"]
    manoeuvres: list[Manoeuvre] = Field(default=[], description="one for all, or one per vehicle")

    @model_validator(mode="after")
    def listed(self) -> Rollout:
        if not self.manoeuvres:
            raise ValueError("manoeuvres: a rollout needs at least one manoeuvre")
        return self


class Euclidean(_Shared):
    """h is the distance alone; the turn is flown where the QP has no solution."""

    kind: Literal["euclidean"]
    v_mps: Speed = Field(default=16.0, description="ground speed of the turn flown as fallback")
    omega_degps: TurnRate = Field(default=11.7, description="its turn rate")


BARRIERS = Kinds(
    "kind",
    "turn",
    {
        "turn": Turn,
        "turn, shared = false": PairTurns,
        "straight": Straight,
        "rollout": Rollout,
        "euclidean": Euclidean,
    },
    {
        "turn": "a turn barrier that all pairs share (the paper's Assumption 1)",
        "turn, shared = false": "a turn barrier with a manoeuvre for each pair",
        "straight": "a straight barrier",
        "rollout": "a rollout barrier",
        "euclidean": "a euclidean barrier",
    },
)
Barrier = Annotated[
    Annotated[Turn, Tag("turn")]
    | Annotated[PairTurns, Tag("turn, shared = false")]
    | Annotated[Straight, Tag("straight")]
    | Annotated[Rollout, Tag("rollout")]
    | Annotated[Euclidean, Tag("euclidean")],
    Discriminator(BARRIERS.tag),
    BeforeValidator(BARRIERS.settled),
]
