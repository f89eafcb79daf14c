"""Tables that come in kinds, each with its own keys: finds the kind and the keys of other kinds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from testbed.scenario.fields import Section
from testbed.scenario.installed import names

# The tag of a kind that an installed package offers.
INSTALLED = "installed"


@dataclass(frozen=True)
class Kinds:
    """The kinds of one table.

    key       the field that says the kind
    default   the kind where that field is absent
    models    tag -> the kind's fields; kinds that differ in a second field say it in their tags
    titles    tag -> the kind in a message, such as "a straight barrier"
    role      "filter" or "guidance" where installed packages offer more kinds, as `other`; else ""
    """

    key: str
    default: str
    models: Mapping[str, type[Section]]
    titles: Mapping[str, str]
    role: str = ""
    other: type[Section] | None = None

    def tag(self, data: Any) -> str | None:
        """The tag of a table, plain or validated; what is no known kind is named as it stands."""
        if not isinstance(data, dict):
            found = next((tag for tag, model in self.models.items() if isinstance(data, model)), None)
            installed = self.other is not None and isinstance(data, self.other)
            return INSTALLED if installed else found
        said = data.get(self.key, self.default)
        if not isinstance(said, str):
            return None
        # A second field tells kinds of one name apart: the tag is its text, "turn, shared = false".
        for tag in self.models:
            name, _, second = tag.partition(", ")
            field, _, value = second.partition(" = ")
            if second and name == said and str(data.get(field)).lower() == value:
                return tag
        return INSTALLED if self.role and said not in self.models and said in names(self.role) else said

    def fields(self) -> list[str]:
        """The fields of all kinds."""
        return list(dict.fromkeys(name for model in self.models.values() for name in model.model_fields))

    def takers(self, name: str) -> list[str]:
        """Tags of the kinds that take a field."""
        return [tag for tag, model in self.models.items() if name in model.model_fields]

    def foreign(self, data: Mapping[str, Any]) -> list[str]:
        """Fields said in a table that its kind does not take, and another kind does."""
        model = self.models.get(self.tag(dict(data)) or "")
        if model is None:
            return []
        return [name for name in data if name not in model.model_fields and self.takers(name)]

    def settled(self, data: Any) -> Any:
        """A plain table without fields of other kinds that are at their defaults: those say nothing."""
        if not isinstance(data, dict):
            return data
        said = {
            name
            for name in self.foreign(data)
            if any(data[name] == self.models[tag].model_fields[name].default for tag in self.takers(name))
        }
        return {name: value for name, value in data.items() if name not in said}

    def refusal(self, name: str, tag: str) -> str:
        """Why a field of another kind is refused."""
        own, _, second = tag.partition(", ")
        seconds, kinds = [], []
        for taker in self.takers(name):
            kind, _, other = taker.partition(", ")
            if kind == own:  # told apart by the second field alone
                seconds.append(other or second.replace("false", "true"))
            else:
                kinds.append(repr(kind))
        said = seconds + ([f"{self.key} = " + " or ".join(kinds)] if kinds else [])
        return f"has no effect on {self.titles.get(tag, tag)}; {' or '.join(said)} takes it"
