"""The [filter] tables of rivals whose plans end in the evading manoeuvre."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from testbed.scenario.fields import NonNegative, Positive, Section


class _Plans(Section):
    margin_m: NonNegative = Field(
        default=0.0, description="what is kept beyond Ds on the model of vehicles that lag"
    )
    trust: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.1,
        description="share of the difference between measured and modelled rates believed in a period",
    )


class Backup(_Plans):
    """Backup CBF: the nominal command blended with the evading manoeuvre (Singletary 2022, van Wijk 2025)."""

    kind: Literal["backup"]
    blending: Literal["regulation", "interpolated"] = Field(
        default="regulation",
        description="regulation: the manoeuvre's share is exp(-beta h); interpolated: the smallest share that"
        " keeps hdot + alpha h >= 0 along the manoeuvre",
    )
    beta_per_m: Positive = Field(default=0.3, description="beta of the regulation function")
    alpha_per_s: Positive = Field(default=2.0, description="alpha of the interpolation")

    @model_validator(mode="after")
    def heard(self) -> Backup:
        name = "alpha_per_s" if self.blending == "regulation" else "beta_per_m"
        other = "interpolated" if self.blending == "regulation" else "regulation"
        if getattr(self, name) != type(self).model_fields[name].default:
            raise ValueError(f"{name}: has no effect on this blending; filter.blending = '{other}' takes it")
        return self


class Gatekeeper(_Plans):
    """Gatekeeper: commit to the nominal command only while the evading manoeuvre after it is safe (2024)."""

    kind: Literal["gatekeeper"]
    horizon_s: Positive = Field(
        default=1.0, description="longest time for which the nominal command is committed to"
    )


class RecedingHorizon(_Plans):
    """A predictive safety filter: one QP per vehicle over some seconds, then the evading manoeuvre (2021)."""

    kind: Literal["receding-horizon"]
    blocks: Annotated[int, Field(ge=1, le=20)] = Field(
        default=3, description="blocks of constant commands that a plan has after its first filter period"
    )
    block_s: Positive = Field(default=1.0, description="how long each block lasts")
    later_weight: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.01, description="weight in the cost of the blocks against the first period's command"
    )
    kappa: Annotated[float, Field(gt=0, lt=1)] = Field(
        default=0.5, description="share of the clearance of plans that one filter period may use up"
    )
