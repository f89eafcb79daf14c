"""Defines the fields and tables of a scenario, each checked alone."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from testbed.scenario.barrier import BARRIERS, Barrier, Turn
from testbed.scenario.control import (
    ALPHAS,
    FILTERS,
    Alpha,
    Centralised,
    Cubic,
    Filter,
)
from testbed.scenario.fence import FENCES, Fence
from testbed.scenario.fields import Name, Positive, Section
from testbed.scenario.guidance import GUIDANCES, Guidance, NearIdentity
from testbed.scenario.installed import PLANTS
from testbed.scenario.installed import plant as installed_plant
from testbed.scenario.kinds import Kinds
from testbed.scenario.nonideal import LAGS, AirframeLags, Gusts, Lags, Network, Sensing, Wind
from testbed.scenario.remedy import Remedy
from testbed.scenario.start import STARTS, Circle, Start
from testbed.scenario.tables import Checks, Goal, InputSet, Navigation, Rates
from testbed.scenario.vehicle import Intruders, Vehicle

SCHEMA_VERSION: Literal[2] = 2


# The tables that come in kinds.
KINDS: dict[str, Kinds] = {
    "start": STARTS,
    "guidance": GUIDANCES,
    "filter": FILTERS,
    "barrier": BARRIERS,
    "alpha": ALPHAS,
    "lags": LAGS,
}
# The lists of tables that come in kinds.
LISTED_KINDS: dict[str, Kinds] = {"fence": FENCES}
# Tables that plain data leave out while they are at their defaults: scenarios without them keep the names
# that their runs had before there were such tables.
ABSENT_BY_DEFAULT = ("goal", "fence", "vehicle", "intruders", "sensors")
# Fields of tables, likewise.
FIELDS_ABSENT_BY_DEFAULT = {("sensing", "range_m"): None, ("filter", "cost"): "raw"}


class Contents(Section):
    """What a scenario file may say; `Scenario` checks the fields against one another."""

    schema_version: Literal[2] = Field(default=SCHEMA_VERSION, description="of this format")
    name: Name = Field(description="of the run, in titles and folder names")
    description: Annotated[str, Field(max_length=2000)] = Field(
        default="", description="a sentence for people"
    )
    vehicles: Annotated[int, Field(ge=1, le=1000)] = Field(
        description="how many; counted from 1; with [[vehicle]] tables their number, and then not needed"
    )
    duration_s: Annotated[float, Field(ge=0, le=86400)] = Field(
        default=20.0, description="flown time; a multiple of the filter period"
    )
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = Field(
        default=1, description="of everything random in the run"
    )
    plant: Annotated[str, AfterValidator(installed_plant)] = Field(
        default="unicycle",
        description="unicycle: the paper's; lagged: with identified lags and limits; jsbsim: 6-DOF aircraft",
        json_schema_extra={"examples": list(PLANTS)},
    )
    airframes: list[Annotated[str, Field(min_length=1, max_length=1000)]] = Field(
        default=["x8"], min_length=1, max_length=1000, description="names or folders, repeated in turn"
    )
    airframes_folder: Annotated[str, Field(max_length=4000)] = Field(
        default="", description="where relative airframes start; absent: the file's own folder"
    )
    sensors: Literal["", "perfect", "typical", "poor"] = Field(
        default="",
        description="what the autopilots sense; absent: what each airframe says, as a rule perfect",
    )
    d_safe_m: Positive = Field(default=5.0, description="Ds, the separation to keep")
    goal_radius_m: Positive = Field(default=20.0, description="a goal counts as reached within it")
    goal: Goal = Goal()
    rates: Rates = Rates()
    limits: InputSet = InputSet()
    start: Start = Circle()
    guidance: Guidance = NearIdentity()
    filter: Filter = Centralised()
    barrier: Barrier = Turn()
    alpha: Alpha = Cubic()
    navigation: Navigation = Navigation()
    checks: Checks = Checks()
    lags: Lags = AirframeLags()
    remedy: Remedy = Remedy()
    wind: Wind = Wind()
    gusts: Gusts = Gusts()
    sensing: Sensing = Sensing()
    network: Network = Network()
    fence: list[Fence] = Field(default=[], max_length=100, description="areas to stay in or out of")
    vehicle: list[Vehicle] = Field(default=[], max_length=1000, description="vehicles one by one")
    intruders: Intruders = Intruders()

    @model_validator(mode="before")
    @classmethod
    def counted(cls, data: Any) -> Any:
        """With the number of vehicles that the tables have, and the kind of guidance that they leave out."""
        said = data.get("vehicle") if isinstance(data, dict) else None
        if not isinstance(said, list) or not said:
            return data
        made = {"vehicles": len(said)} | data
        key, own = GUIDANCES.key, data.get("guidance")
        if isinstance(own, dict) and isinstance(own.get(key), str):
            made["vehicle"] = [
                one | {"guidance": {key: own[key]} | one["guidance"]}
                if isinstance(one, dict) and isinstance(one.get("guidance"), dict)
                else one
                for one in said
            ]
        return made

    @model_serializer(mode="wrap")
    def plain(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Plain data without the tables of `ABSENT_BY_DEFAULT` that say nothing."""
        made: dict[str, Any] = handler(self)
        for name in ABSENT_BY_DEFAULT:
            if name in made and getattr(self, name) == type(self).model_fields[name].default:
                del made[name]
        for (name, leaf), default in FIELDS_ABSENT_BY_DEFAULT.items():
            known, said = type(getattr(self, name)).model_fields.get(leaf), made.get(name, {})
            # Without defaults, as a counterexample is written, neither table nor field may be there.
            if known is not None and leaf in said and known.default == default == said[leaf]:
                del said[leaf]
        return made

    @property
    def filter_steps(self) -> int:
        return round(self.duration_s / self.rates.filter_dt_s)

    @property
    def nominal(self) -> Guidance:
        """The guidance; `[nominal]` is its table's older name."""
        return self.guidance
