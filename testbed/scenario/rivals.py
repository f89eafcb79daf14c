"""The [filter] tables of rival filters: how other authors' filters are set, with their kinds and titles."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from testbed.scenario.fields import Divisor, NonNegative, Positive, Section


class _Plans(Section):
    margin_m: NonNegative = Field(
        default=0.2,
        description="what is kept beyond Ds on the model of vehicles that lag; at 20 Hz 0.165 m are missed"
        " between samples",
    )
    trust: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.1,
        description="share of the difference between measured and modelled rates believed in a period",
    )


class Backup(_Plans):
    """Backup CBF: the nominal command blended with the evading manoeuvre (Singletary 2022, van Wijk 2025)."""

    kind: Literal["backup"]
    blending: Literal["regulation", "interpolated"] = Field(
        default="interpolated",
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
        default=2.0, description="longest time for which the nominal command is committed to"
    )


class RecedingHorizon(_Plans):
    """A predictive safety filter: one QP per vehicle over some seconds, then the evading manoeuvre (2021)."""

    kind: Literal["receding-horizon"]
    blocks: Annotated[int, Field(ge=1, le=20)] = Field(
        default=2, description="blocks of constant commands that a plan has after its first filter period"
    )
    block_s: Positive = Field(default=0.5, description="how long each block lasts")
    later_weight: Annotated[float, Field(gt=0, le=1)] = Field(
        default=1e-4, description="weight in the cost of the blocks against the first period's command"
    )
    kappa: Annotated[float, Field(gt=0, lt=1)] = Field(
        default=0.5, description="share of the clearance of plans that one filter period may use up"
    )


class CollisionCone(Section):
    """Keeps relative velocities out of the cone of collision: see the guide, rivals.md."""

    kind: Literal["collision-cone"]
    decay_per_s: Positive = Field(default=1.0, description="gamma: hdot + gamma h >= 0 of the cone's h")
    speed_response_s: Divisor = Field(
        default=1.0, description="time in which a commanded change of speed is taken to be flown"
    )
    climb_response_s: Divisor = Field(default=1.0, description="and one of climb rate")
    range_m: NonNegative = Field(default=150.0, description="vehicles further away have no row")
    cost: Literal["range", "raw"] = Field(
        default="range", description="range divides what each channel is changed by through its range"
    )


class OptimalDecay(Section):
    """The centralised QP in which the decay rate of every row is a decision variable: see rivals.md."""

    kind: Literal["optimal-decay"]
    decay_weight: Divisor = Field(
        default=1.0, description="p: the cost has p (w - 1)^2 of every row's decay factor w"
    )
    cost: Literal["range", "raw"] = Field(default="raw", description="of the inputs, as of 'centralised'")


class VelocityObstacles(Section):
    """Reciprocal velocity obstacles (ORCA) with turn limits: see the guide, rivals.md."""

    kind: Literal["velocity-obstacles"]
    horizon_s: Divisor = Field(default=10.0, description="tau: velocities that collide within it are avoided")
    response_s: Divisor = Field(default=1.0, description="time in which the chosen velocity is to be flown")
    responsibility: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.5, description="share of the needed change of velocity that each vehicle takes"
    )
    range_m: NonNegative = Field(default=300.0, description="vehicles further away are not seen")
    space: Literal["level", "full"] = Field(
        default="level", description="level: others are discs at one height; full: they are spheres"
    )


RIVALS: dict[str, type[Section]] = {
    "backup": Backup,
    "gatekeeper": Gatekeeper,
    "receding-horizon": RecedingHorizon,
    "collision-cone": CollisionCone,
    "optimal-decay": OptimalDecay,
    "velocity-obstacles": VelocityObstacles,
}
TITLES = {
    "backup": "the backup filter",
    "gatekeeper": "the gatekeeper filter",
    "receding-horizon": "the receding-horizon filter",
    "collision-cone": "the collision-cone filter",
    "optimal-decay": "the optimal-decay filter",
    "velocity-obstacles": "the velocity-obstacle filter",
}
# The remedies that each takes: those of the barrier it is built from, and those around any filter.
REMEDIES: dict[str, tuple[str, ...]] = {
    "backup": (),
    "gatekeeper": (),
    "receding-horizon": (),
    "collision-cone": ("ds_buffer_m", "prediction_s"),
    "optimal-decay": (
        *("ds_buffer_m", "derate", "derate_speed", "smoothing_m2"),
        *("prediction_s", "predict_lags", "air_mass"),
    ),
    "velocity-obstacles": ("ds_buffer_m", "prediction_s"),
}
