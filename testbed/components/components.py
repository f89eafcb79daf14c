"""Parts: the makers of plant, filter, guidance and environment; the catalogue's unless you give your own."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from aircraft.plant import Plant
from filters.barriers.pairs import Barrier
from filters.filter import Choose
from filters.model import Array
from testbed.components import catalogue
from testbed.components.guidance import Guidance
from testbed.components.named_parts import NamedPart
from testbed.components.provenance import Origin, origin
from testbed.environment.environment import Environment
from testbed.errors import UserError
from testbed.scenario.scenario import Scenario

# Role of a part -> the field of Parts that makes it.
FIELDS = {"plant": "plant", "filter": "filter", "guidance": "nominal", "environment": "disturbance"}


@dataclass(frozen=True)
class Parts:
    """Makers of the four parts of a run, each called once for a run.

    plant        (scenario, wind (N, 3) m/s at the start) -> `aircraft.plant.Plant`; twice where the
                 evading manoeuvre is flown as well
    filter       (scenario, barrier, goal (N, 3) m) -> `filters.filter.Filter`, or any callable
    nominal      (scenario, goal (N, 3) m, barrier) -> `testbed.components.guidance.Guidance`
    disturbance  (scenario, random generators by name) -> `testbed.environment.environment.Environment`
    A scenario file names no file and no code: parts of your own come from Python, from `--parts`, or by name
    from an installed package.
    """

    plant: Callable[[Scenario, Array], Plant] = catalogue.plant
    filter: Callable[[Scenario, Barrier, Array], Choose] = catalogue.filter_
    nominal: Callable[[Scenario, Array, Barrier], Guidance] = catalogue.guidance
    disturbance: Callable[[Scenario, dict[str, np.random.Generator]], Environment] = catalogue.disturbance

    def own(self) -> dict[str, Origin]:
        """Part -> where its maker comes from, for the parts that are not the catalogue's."""
        changed = {f.name: getattr(self, f.name) for f in fields(self) if getattr(self, f.name) != f.default}
        return {
            part: maker.origin if isinstance(maker, NamedPart) else origin(maker)
            for part, maker in changed.items()
        }

    @classmethod
    def of(cls, named: Iterable[NamedPart]) -> Parts:
        """The parts that a person named, the scenario's for the other roles.

        Raises  UserError for two parts of one role
        """
        makers: dict[str, Any] = {}
        for part in named:
            field = FIELDS[part.role]
            if field in makers:
                raise UserError(
                    f"--parts {part.label}: {makers[field].label} is the {part.role} already; give one"
                )
            makers[field] = part
        return cls(**makers)
