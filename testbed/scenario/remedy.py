"""The [remedy] table: changes of the filter for vehicles that do not move like unicycles."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from testbed.scenario.barrier import Barrier, Turn
from testbed.scenario.control import Centralised, Filter, Limited
from testbed.scenario.fields import NonNegative, Positive, Section
from testbed.scenario.rivals import REMEDIES

# Remedies that change what the filter's barrier is built from, not its QPs.
OF_THE_BARRIER = ("ds_buffer_m", "derate", "derate_speed", "smoothing_m2")
# Those that a kind of filter takes, where it does not take all.
TAKEN = {"none": (), "flow": (), "navigation": ("prediction_s",), **REMEDIES}
Share = Annotated[float, Field(gt=0, le=1)]


class Remedy(Section):
    """Changes of the filter for vehicles that do not move like unicycles. Verdicts do not depend on them.

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
            taken = TAKEN.get(filter_.kind)
            if taken is not None and name not in taken:
                raise ValueError(f"remedy.{name}: filter '{filter_.kind}' cannot take it")
            if isinstance(filter_, Centralised | Limited) and filter_.monitor and name not in OF_THE_BARRIER:
                raise ValueError(f"remedy.{name}: filter.monitor checks the paper's own QPs; set it to false")
            if name == "smoothing_m2" and not isinstance(barrier, Turn):
                raise ValueError("remedy.smoothing_m2: only a turn barrier shared by all pairs has smoothing")
            if name == "derate" and barrier.kind not in ("turn", "rollout"):
                raise ValueError(f"remedy.derate: a '{barrier.kind}' barrier has no turn; try derate_speed")
            if name == "derate_speed" and barrier.kind == "euclidean":
                raise ValueError("remedy.derate_speed: a 'euclidean' barrier has no manoeuvre")
            if name == "predict_lags" and (not barrier.shared or barrier.kind == "euclidean"):
                raise ValueError("remedy.predict_lags: needs one evading manoeuvre, that of the barrier")
