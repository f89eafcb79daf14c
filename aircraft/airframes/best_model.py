"""The model of a command channel that predicts other steps best, as an airframe's files state it."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from aircraft.airframes.setup import Positive, Strict


class Best(Strict):
    """The model of a channel that predicts other steps best: see `aircraft.autopilots.channel_family`."""

    kind: Literal["first order", "short turn", "second order", "tracked loop"]
    validation_rms: Annotated[float, Field(ge=0)] = Field(
        description="rms error on steps that were not fitted, as a share of the step"
    )
    values: dict[str, Positive] = Field(description="the model's parameters")
    low: dict[str, Positive] = Field({}, description="lower end of each parameter's 90 % interval")
    high: dict[str, Positive] = Field({}, description="upper end; absent where no step shows the parameter")

    @model_validator(mode="after")
    def within(self) -> Best:
        if self.low.keys() != self.high.keys():
            raise ValueError("low and high are of the same parameters")
        for name in self.low:
            if not self.low[name] <= self.values.get(name, math.nan) <= self.high[name]:
                raise ValueError(f"low, values and high of {name} must be in this order")
        return self
