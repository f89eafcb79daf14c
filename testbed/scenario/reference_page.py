"""The scenario file's reference as Markdown, made from the schema: `testbed schema --markdown`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from testbed.scenario.scenario import Scenario, builtin

TITLE = "# Scenario files"
PREFACE = """\
A scenario file is TOML. Every number carries its unit in its name; a field that is not there has the
default below, the settings of Squires et al. 2022, Section III.D. Unknown fields are refused, with the
nearest name. The smallest file is a name and a number of vehicles:

```toml
name = "head-on"
vehicles = 2
```

`--set FIELD=VALUE` overrides a field of a file or of a built-in scenario (`testbed list`), by its dotted
path or, where that is unambiguous, by its last part: `--set start.radius_m=100`, `--set radius_m=100`.
Values are TOML, lists and tables included: `--set 'airframes=["x8", "rascal"]'`.

This page is written by `testbed schema --markdown`; `testbed schema` prints the same as JSON Schema, for
editors."""


def markdown() -> str:
    """The whole page."""
    schema = Scenario.model_json_schema()
    known = schema["$defs"]
    parts = [TITLE, PREFACE, "## The scenario itself", schema["description"].splitlines()[0]]
    sections = {name: field for name, field in schema["properties"].items() if _reference(field) in known}
    own = {name: field for name, field in schema["properties"].items() if name not in sections}
    parts.append(_table(own, schema.get("required", []), known))
    shown: list[str] = []
    for name, field in sections.items():
        model = known[_reference(field)]
        parts += [
            f"## `[{name}]`",
            _sentence(model),
            _table(model["properties"], model.get("required", []), known),
        ]
        for inner in _items(model["properties"]):
            if inner not in shown:
                shown.append(inner)
                entry = known[inner]
                parts += [
                    f"### {inner.lower()}: an entry of a list above",
                    _sentence(entry),
                    _table(entry["properties"], entry.get("required", []), known),
                ]
    example = builtin()["paper-20-turn"].strip()
    parts += ["## An example", "The built-in `paper-20-turn`:", f"```toml\n{example}\n```"]
    return "\n\n".join(parts) + "\n"


def _sentence(model: dict[str, Any]) -> str:
    return " ".join(model.get("description", "").split())


def _reference(field: dict[str, Any]) -> str:
    where = field.get("$ref") or next((a["$ref"] for a in field.get("allOf", []) if "$ref" in a), "")
    return str(where).rpartition("/")[2]


def _items(fields: dict[str, Any]) -> Iterator[str]:
    """Names of the models that lists among the fields hold."""
    for field in fields.values():
        if name := _reference(field.get("items", {})):
            yield name


def _table(fields: dict[str, Any], required: list[str], known: dict[str, Any]) -> str:
    rows = ["| field | value | default | meaning |", "|---|---|---|---|"]
    for name, field in fields.items():
        default = "**needed**" if name in required else _value(field.get("default"))
        meaning = field.get("description", "").replace("|", "\\|")
        rows.append(f"| `{name}` | {_kind(field)} | {default} | {meaning} |")
    return "\n".join(rows)


def _value(value: Any) -> str:
    if value is None:
        return "not set"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, str):
        return f'`"{value}"`'
    if isinstance(value, list):
        return "`[" + ", ".join(_value(v).strip("`") for v in value) + "]`"
    return f"`{value:g}`" if isinstance(value, float) else f"`{value}`"


def _kind(field: dict[str, Any]) -> str:
    """Choices, or the type and its bounds."""
    if "anyOf" in field:
        kinds = [_kind(k) for k in field["anyOf"] if k.get("type") != "null"]
        return " or ".join(dict.fromkeys(kinds))
    if "const" in field:
        return _value(field["const"])
    if "enum" in field:
        return ", ".join(_value(v) for v in field["enum"])
    if field.get("type") == "array":
        inner = _reference(field["items"])
        return f"list of {inner.lower()}" if inner else f"list: {_kind(field['items'])}"
    word = {"number": "number", "integer": "whole number", "string": "text", "boolean": "`true`, `false`"}
    bounds = [
        f"{sign} {_value(field[key]).strip('`')}"
        for key, sign in (
            ("exclusiveMinimum", ">"),
            ("minimum", ">="),
            ("exclusiveMaximum", "<"),
            ("maximum", "<="),
        )
        if key in field
    ]
    return " ".join([word[field["type"]], " and ".join(bounds)]).strip()
