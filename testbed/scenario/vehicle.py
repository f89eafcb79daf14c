"""The [[vehicle]] tables: what one vehicle has of its own; and [intruders], what is assumed of some."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from testbed.scenario.barrier import Manoeuvre
from testbed.scenario.fields import Coordinate, Section, Speed, TurnLimit
from testbed.scenario.guidance import GUIDANCES, Guidance, InstalledGuidance

COURSE = Annotated[float, Field(ge=-720, le=720)]


class _Said(Section):
    """A table whose absent fields come from another table: plain data hold only what was said."""

    @model_serializer(mode="wrap")
    def said(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        made = handler(self)
        said = (name for name in made if name in self.model_fields_set)
        return {name: _said_in(getattr(self, name), made[name]) for name in said}


def _said_in(value: Any, plain: Any) -> Any:
    """The plain data of a field, of an inner table only what was said in it."""
    if not isinstance(value, Section) or not isinstance(plain, dict):
        return plain
    return {name: inner for name, inner in plain.items() if name in value.model_fields_set}


class VehicleLimits(_Said):
    """The vehicle's own input set; what it does not say comes from [limits]."""

    v_min_mps: Speed | None = Field(default=None, description="least ground speed")
    v_max_mps: Speed | None = Field(default=None, description="largest ground speed")
    omega_max_degps: TurnLimit | None = Field(default=None, description="largest turn rate, to either side")
    zeta_max_mps: Annotated[float, Field(ge=0, le=1000)] | None = Field(
        default=None, description="largest climb and sink rate"
    )


class Vehicle(_Said):
    """One vehicle, counted from 1 in order. What it does not say comes from the scenario's own tables."""

    airframe: Annotated[str, Field(min_length=1, max_length=1000)] | None = Field(
        default=None, description="name or folder; absent: its turn in `airframes`"
    )
    filter: bool = Field(default=True, description="false: an intruder, which flies its guidance unfiltered")
    x_m: Coordinate | None = Field(
        default=None, description="start, east; absent: x, y and course from [start]"
    )
    y_m: Coordinate | None = Field(default=None, description="start, north; goes with x_m and course_deg")
    course_deg: COURSE | None = Field(default=None, description="counter-clockwise from east")
    z_m: Coordinate | None = Field(
        default=None, description="start, height above the shared origin; absent: 0 with x_m, else of [start]"
    )
    speed_mps: Speed | None = Field(default=None, description="at t = 0; absent: start.speed_mps")
    goal_x_m: Coordinate | None = Field(default=None, description="east; absent: the goal from [start]")
    goal_y_m: Coordinate | None = Field(default=None, description="north; goes with goal_x_m")
    goal_z_m: Coordinate | None = Field(
        default=None, description="height; absent: 0 with goal_x_m, else of [start]"
    )
    limits: VehicleLimits = Field(default=VehicleLimits(), description="`[vehicle.limits]`: its input set")
    manoeuvre: Manoeuvre | None = Field(
        default=None,
        description="`[vehicle.manoeuvre]`: its gamma; the barrier is then the rollout over each vehicle's",
    )
    guidance: Guidance | None = Field(
        default=None, description="`[vehicle.guidance]`: of any kind; absent: the scenario's"
    )

    @model_validator(mode="after")
    def together(self) -> Vehicle:
        for names in (("x_m", "y_m", "course_deg"), ("goal_x_m", "goal_y_m")):
            missing = [name for name in names if getattr(self, name) is None]
            if 0 < len(missing) < len(names):
                said = ", ".join(name for name in names if name not in missing)
                raise ValueError(f"{said} without {' and '.join(missing)}; give {', '.join(names)} together")
        if isinstance(self.guidance, InstalledGuidance):
            raise ValueError("guidance.kind: installed guidance flies all vehicles; name it in [guidance]")
        return self

    @property
    def placed(self) -> bool:
        """Whether it says where it starts."""
        return self.x_m is not None


def field_names() -> list[str]:
    """The fields of a [[vehicle]] table, those of its inner tables dotted, of all kinds of guidance."""
    inner = {
        "limits": list(VehicleLimits.model_fields),
        "manoeuvre": list(Manoeuvre.model_fields),
        # All vehicles have one delay.
        "guidance": [name for name in GUIDANCES.fields() if name != "delay_steps"],
    }
    found = []
    for name in Vehicle.model_fields:
        found += [f"{name}.{leaf}" for leaf in inner[name]] if name in inner else [name]
    return found


class Intruders(Section):
    """What the filter assumes of vehicles with `filter = false`."""

    assume: Literal["keep-course", "nothing"] = Field(
        default="keep-course",
        description="keep-course: they keep their present speed and climb rate and do not turn;"
        " nothing: the worst input within their limits",
    )
