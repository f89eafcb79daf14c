"""The [filter] and [alpha] tables: the filter that alters what guidance asks for, the class-K function."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag, model_validator

from testbed.scenario.fields import NonNegative, Positive, Section
from testbed.scenario.installed import installed
from testbed.scenario.kinds import INSTALLED, Kinds
from testbed.scenario.rivals import (
    RIVALS,
    TITLES,
    Backup,
    CollisionCone,
    Gatekeeper,
    OptimalDecay,
    RecedingHorizon,
    VelocityObstacles,
)


class _QP(Section):
    solver: Literal["auto", "osqp"] = Field(
        default="auto", description="of the QPs: auto is the fastest one measured; every answer is checked"
    )
    monitor: bool = Field(default=False, description="check Theorems 3 and 4 at every step, and compare QPs")
    cost: Literal["raw", "range"] = Field(
        default="raw",
        description="raw: |u - u_hat|^2 in m/s and rad/s, the paper's; range: each channel as a share of its"
        " range, so that turning is not nearly free",
    )


class Centralised(_QP):
    """One QP for all vehicles."""

    kind: Literal["centralised"] = "centralised"


class Limited(_QP):
    """One QP per vehicle, from what it knows itself."""

    kind: Literal["limited"]


class NavigationFunction(Section):
    """The navigation function of [navigation]; it solves no QP."""

    kind: Literal["navigation"]


class Flow(Section):
    """One QP per vehicle, whose barrier is along the flow of a model with lags: see the guide, flow.md."""

    kind: Literal["flow"]
    margin_m: NonNegative | Literal["identified"] = Field(
        default=0.0,
        description="the flow keeps Ds and this: what the model misses; identified flies encounters of"
        " each airframe in calm air, measures that, and adds what is missed between samples",
    )
    kappa: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.1, description="share of the clearance on the flow that one filter period may use up"
    )
    h_margin_m: NonNegative | None = Field(
        default=None, description="the flow keeps the paper's h at this, at any instant; absent: it does not"
    )
    trust: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.1,
        description="share of the difference between measured and modelled rates believed in a period",
    )
    speed_slew_mps2: Positive | None = Field(
        default=None,
        description="speed commands change by at most this, which aircraft can do in a descent too; absent:"
        " no bound",
    )
    climb_slew_mps2: Positive | None = Field(
        default=None,
        description="climb commands change by at most this: in turns, a jump also changes the course; absent:"
        " no bound",
    )
    cost: Literal["range", "raw"] = Field(
        default="range", description="range divides what each channel is changed by through its range"
    )


class NoFilter(Section):
    """Guidance flown as it is."""

    kind: Literal["none"]


class InstalledFilter(Section):
    """A filter that an installed package offers by name."""

    kind: Annotated[str, AfterValidator(installed("filter"))]


MODELS_LAGS = ("flow", "backup", "gatekeeper", "receding-horizon")
"""Kinds of filters that know how the vehicles' channels lag, and whose claims are of that model."""

FILTERS = Kinds(
    "kind",
    "centralised",
    {
        "centralised": Centralised,
        "limited": Limited,
        "navigation": NavigationFunction,
        "flow": Flow,
        **RIVALS,
        "none": NoFilter,
    },
    {
        "centralised": "the centralised filter",
        "limited": "the limited filter",
        "navigation": "the navigation function, which solves no QP",
        "flow": "the flow filter",
        **TITLES,
        "none": "filter 'none', which solves no QP",
    },
    role="filter",
    other=InstalledFilter,
)
Filter = Annotated[
    Annotated[Centralised, Tag("centralised")]
    | Annotated[Limited, Tag("limited")]
    | Annotated[NavigationFunction, Tag("navigation")]
    | Annotated[Flow, Tag("flow")]
    | Annotated[Backup, Tag("backup")]
    | Annotated[Gatekeeper, Tag("gatekeeper")]
    | Annotated[RecedingHorizon, Tag("receding-horizon")]
    | Annotated[CollisionCone, Tag("collision-cone")]
    | Annotated[OptimalDecay, Tag("optimal-decay")]
    | Annotated[VelocityObstacles, Tag("velocity-obstacles")]
    | Annotated[NoFilter, Tag("none")]
    | Annotated[InstalledFilter, Tag(INSTALLED)],
    Discriminator(FILTERS.tag),
    BeforeValidator(FILTERS.settled),
]


class Linear(Section):
    """a h."""

    kind: Literal["linear"]
    coefficient: Positive = Field(default=0.1, description="a")


class Cubic(Section):
    """a h^3."""

    kind: Literal["cubic"] = "cubic"
    coefficient: Positive = Field(default=0.1, description="a")


class OddPolynomial(Section):
    """A sum of odd powers of h."""

    kind: Literal["odd-polynomial"]
    coefficients: list[NonNegative] = Field(default=[], max_length=5, description="of h, h^3, h^5, ...")

    @model_validator(mode="after")
    def complete(self) -> OddPolynomial:
        if not any(self.coefficients):
            raise ValueError("coefficients: an odd polynomial needs at least one positive coefficient")
        return self


ALPHAS = Kinds(
    "kind",
    "cubic",
    {"cubic": Cubic, "linear": Linear, "odd-polynomial": OddPolynomial},
    {"cubic": "a cubic alpha", "linear": "a linear alpha", "odd-polynomial": "an odd polynomial"},
)
Alpha = Annotated[
    Annotated[Cubic, Tag("cubic")]
    | Annotated[Linear, Tag("linear")]
    | Annotated[OddPolynomial, Tag("odd-polynomial")],
    Discriminator(ALPHAS.tag),
    BeforeValidator(ALPHAS.settled),
]
