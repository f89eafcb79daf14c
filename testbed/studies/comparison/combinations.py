"""Makes the combinations of plants, filters and guidance that a comparison flies."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from testbed.components.choices import AXES, Choice, choices, everywhere, with_files
from testbed.components.components import Parts
from testbed.components.named_parts import NamedPart
from testbed.errors import UserError
from testbed.scenario.scenario import Scenario
from testbed.scenario.variants import load_changed

DEFAULT_PLANTS = "unicycle,jsbsim"
# More would be neither a table nor a figure that anybody reads.
MOST = 24


@dataclass(frozen=True)
class Combination:
    """One run of a comparison.

    parts  the user's own that fly in it; None for none
    """

    scenario: Scenario
    parts: Parts | None


def combinations(
    source: str,
    overrides: Sequence[str] | None,
    asked: Mapping[str, str | None],
    named: Sequence[NamedPart] = (),
) -> dict[str, Combination]:
    """Label -> combination, every choice of one axis with every one of the others.

    source, overrides  of the scenario, as `testbed.load_scenario` takes them
    asked   role -> names with commas between, kinds or FILE.py:NAME; None leaves the scenario's, and of
            plants, where nothing else is varied, unicycle and jsbsim
    named   the parts that `--parts` brings; one that no list names flies in every combination
    Raises  UserError as `choices` does, for a scenario that is refused, or more than MOST combinations
    """
    wanted = {role: text for role, text in asked.items() if text is not None}
    if not wanted and not any(part.role == "plant" for part in named):
        wanted = {"plant": DEFAULT_PLANTS}
    axes: dict[str, list[Choice]] = {}
    brought = {part.label: part for part in named}
    for role, axis in AXES.items():
        if role in wanted:
            names, more = with_files(axis, wanted[role], named)
            brought |= {part.label: part for part in more}
            roles = {label: part.role for label, part in brought.items()}
            axes[role] = choices(axis, names, roles, f"--{axis.name}")
    always = everywhere({label: part.role for label, part in brought.items()}, axes, "--")
    products = list(itertools.product(*axes.values()))
    if len(products) > MOST:
        raise UserError(f"{len(products)} combinations are more than {MOST}; compare fewer at a time")
    labelled = {label(chosen): chosen for chosen in products}
    fields = {
        name: {path: value for choice in chosen for path, value in choice.fields.items()}
        for name, chosen in labelled.items()
    }
    made = load_changed(source, overrides, fields)
    own = {name: [*always, *(c.name for c in chosen if c.own)] for name, chosen in labelled.items()}
    parts = {name: [brought[part] for part in of] for name, of in own.items()}
    if len(made) == 1:  # nothing varies: its plant tells what it is
        (s,) = made.values()
        plant = next((part.label for of in parts.values() for part in of if part.role == "plant"), s.plant)
        made, parts = {plant: s}, {plant: next(iter(parts.values()))}
    return {name: Combination(s, Parts.of(parts[name]) if parts[name] else None) for name, s in made.items()}


def label(chosen: Sequence[Choice]) -> str:
    """What tables and legends call a combination."""
    return ", ".join(choice.name for choice in chosen)
