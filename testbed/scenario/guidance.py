"""The [guidance] table: what the vehicles want to do, before the filter alters it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag

from testbed.scenario.fields import Divisor, Positive, Section
from testbed.scenario.installed import installed
from testbed.scenario.kinds import INSTALLED, Kinds


class _Guidance(Section):
    delay_steps: Annotated[int, Field(ge=0, le=1000)] = Field(
        default=0, description="filter steps by which u_hat is old; before there is one it is zero"
    )


class NearIdentity(_Guidance):
    """Flies towards the goal."""

    kind: Literal["near-identity"] = "near-identity"
    lookahead_m: Divisor = Field(
        default=1.0, description="the point ahead that is steered, the paper's lambda"
    )
    gain_per_s: Positive = Field(default=0.1, description="on position and height")


class EvadingManoeuvre(_Guidance):
    """Flies the barrier's evading manoeuvre for ever."""

    kind: Literal["manoeuvre"]


class InstalledGuidance(_Guidance):
    """Guidance that an installed package offers by name."""

    kind: Annotated[str, AfterValidator(installed("guidance"))]


GUIDANCES = Kinds(
    "kind",
    "near-identity",
    {"near-identity": NearIdentity, "manoeuvre": EvadingManoeuvre},
    {"near-identity": "guidance towards the goal", "manoeuvre": "guidance that flies the manoeuvre"},
    role="guidance",
    other=InstalledGuidance,
)
Guidance = Annotated[
    Annotated[NearIdentity, Tag("near-identity")]
    | Annotated[EvadingManoeuvre, Tag("manoeuvre")]
    | Annotated[InstalledGuidance, Tag(INSTALLED)],
    Discriminator(GUIDANCES.tag),
    BeforeValidator(GUIDANCES.settled),
]
