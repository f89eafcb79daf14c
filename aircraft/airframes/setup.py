"""How a model is set up for its flights and how its engines are run: [setup] and [engines]."""

from __future__ import annotations

import re
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, model_validator

Positive = Annotated[float, Field(gt=0, le=1e6)]
Finite = Annotated[float, Field(ge=-1e9, le=1e9)]
Share = Annotated[float, Field(ge=0, le=1)]


class Strict(BaseModel):
    """A table of airframe.toml: exactly its own keys, each of its own type."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class Setup(Strict):
    """How the model is set up before a flight; what is absent stays as the model has it."""

    gear: Share | None = Field(default=None, description="0 up, 1 down")
    flaps: Share | None = Field(default=None, description="share of their travel")
    fuel_freeze: bool = Field(default=False, description="tanks keep their contents in flight")
    captive: bool = Field(
        default=False,
        description="the model's own flight control has filters: trims wait for them, as for engines",
    )
    properties: dict[str, Finite] = Field(default={}, description="JSBSim property -> value")

    @model_validator(mode="after")
    def named(self) -> Setup:
        for path in self.properties:
            if not is_property(path):
                raise ValueError(f"setup.properties.{path}: cannot name a property of JSBSim")
        return self


class Engines(Strict):
    """How the engines are run: all get the same throttle, between `idle` and `full`."""

    count: Annotated[int, Field(ge=1, le=16)] = 1
    mixture: Share = 1.0
    propeller: Share = Field(default=1.0, description="lever of a constant-speed propeller; 1 is full speed")
    idle: Share = Field(default=0.0, description="least throttle: below, an engine may stop")
    full: Share = Field(default=1.0, description="largest throttle: above, an afterburner may light")

    @model_validator(mode="after")
    def ordered(self) -> Engines:
        if not self.idle < self.full:
            raise ValueError("idle must be below full")
        return self


def is_property(path: str) -> bool:
    """Whether JSBSim can parse a property's name: it aborts the process where it cannot."""
    return bool(re.fullmatch(r"/?[A-Za-z_][\w.-]*(\[\d+\])?(/[A-Za-z_][\w.-]*(\[\d+\])?)*", path, re.ASCII))
