"""Lists the defaults of a scenario's fields, for the kinds that its tables have."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from testbed.scenario.contents import KINDS, Contents
from testbed.scenario.fields import Section


def defaults(data: Mapping[str, Any]) -> dict[str, Any]:
    """Dotted path -> default of the fields that a scenario's plain data may say, with the kinds it has."""
    found: dict[str, Any] = {}
    for name, field in Contents.model_fields.items():
        model = field.annotation
        if name in KINDS:
            model = KINDS[name].models.get(KINDS[name].tag(data.get(name, {})) or "")
        if isinstance(model, type) and issubclass(model, Section):
            found |= {f"{name}.{leaf}": inner.default for leaf, inner in model.model_fields.items()}
            # The kind itself is the table's default or it is worth telling.
            if name in KINDS:
                found[f"{name}.{KINDS[name].key}"] = KINDS[name].default
        else:
            found[name] = field.default
    return found
