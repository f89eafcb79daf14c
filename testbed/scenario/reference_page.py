"""Writes the reference page of scenario files as Markdown: `testbed schema --markdown`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from testbed.scenario.contents import KINDS, LISTED_KINDS
from testbed.scenario.kinds import Kinds
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
Values are TOML, lists and tables included: `--set 'airframes=["x8", "rascal"]'`. A field of one vehicle's
table is named with its number, counted from 1: `--set vehicle.2.speed_mps=20`.

Vehicles that differ have a `[[vehicle]]` table each, in order; their number is then that of the tables. A
table says what is particular to its vehicle, and the scenario's own tables say the rest:

```toml
name = "overtaking"

[[vehicle]]
x_m = -100
y_m = 0
course_deg = 0
goal_x_m = 300
goal_y_m = 0
speed_mps = 24

[[vehicle]]
x_m = 0
y_m = 0
course_deg = 0
goal_x_m = 300
goal_y_m = 0
speed_mps = 16
[vehicle.limits]
v_max_mps = 18
```

A field that would have no effect is refused, with what would take it: `sigma` on a straight barrier,
airframes on unicycles, `monitor` where no QP is solved. A field at its default says nothing and is never
refused. Where `--set` or `--plant` changes a kind, what the file said for the old kind is left out, with a
note. Where the program makes the change (`compare`, the ladder, the cells of a campaign), a field is left out
of the runs in which it has no effect, and refused if it has none in any of them.

`plant`, `filter.kind` and `guidance.kind` may also be the name of a part that an installed package offers by
an entry point ([extend.md](extend.md#an-installed-package)).

This is schema version 2. A file that says `schema_version = 1` is read as it was meant: what had no effect in
it is left out.

This page is written by `testbed schema --markdown`; `testbed schema` prints the same as JSON Schema, for
editors."""


def markdown() -> str:
    """The whole page."""
    schema = Scenario.model_json_schema()
    known = schema["$defs"]
    parts = [TITLE, PREFACE, "## The scenario itself", schema["description"].splitlines()[0]]
    tables = {name: _models(name, field, known) for name, field in schema["properties"].items()}
    own = {name: field for name, field in schema["properties"].items() if not tables[name]}
    parts.append(_table(own, schema.get("required", []), known))
    shown: list[str] = []
    for name, kinds in LISTED_KINDS.items():
        models = [known[model.__name__] for model in kinds.models.values()]
        said = [f"A list of tables: {own[name]['description']}."]
        parts += [f"## `[[{name}]]`", *said, *_kinds(f"[[{name}]]", kinds, models, known)]
    for name, field in own.items():
        if (inner := _reference(field.get("items", {}))) in known:
            shown.append(inner)
            parts += [f"## `[[{name}]]`", *_one(known[inner], known)]
            parts += _inner(name, known[inner], known)
    for name, models in tables.items():
        if not models:
            continue
        parts.append(f"## `[{name}]`")
        parts += _kinds(f"[{name}]", KINDS[name], models, known) if name in KINDS else _one(models[0], known)
        for model in models:
            for inner in _items(model["properties"]):
                if inner not in shown:
                    shown.append(inner)
                    parts += [f"### {inner.lower()}: an entry of a list above", *_one(known[inner], known)]
    example = builtin()["paper-20-turn"].strip()
    parts += ["## An example", "The built-in `paper-20-turn`:", f"```toml\n{example}\n```"]
    return "\n\n".join(parts) + "\n"


def _models(name: str, field: dict[str, Any], known: dict[str, Any]) -> list[dict[str, Any]]:
    """The schemas of a table's kinds, or of the one table; none for what is no table."""
    if name in KINDS:
        return [known[model.__name__] for model in KINDS[name].models.values()]
    return [known[_reference(field)]] if _reference(field) in known else []


def _one(model: dict[str, Any], known: dict[str, Any]) -> list[str]:
    return [_sentence(model), _table(model["properties"], model.get("required", []), known)]


def _inner(name: str, model: dict[str, Any], known: dict[str, Any]) -> Iterator[str]:
    """The tables inside an entry of a list of tables, but those that have the kinds of a table above."""
    for leaf, field in model["properties"].items():
        options = [field, *field.get("anyOf", [])]
        found = next((r for r in map(_reference, options) if r in known), "")
        if found:
            yield f"### `[{name}.{leaf}]`"
            yield from _one(known[found], known)


def _kinds(name: str, kinds: Kinds, models: list[dict[str, Any]], known: dict[str, Any]) -> list[str]:
    """What says the kind of the table `name`, what every kind takes, and what each takes besides."""
    every = [f for f in models[0]["properties"] if all(f in m["properties"] for m in models)]
    common = {f: models[0]["properties"][f] for f in every if f != kinds.key}
    values = list(dict.fromkeys(tag.partition(", ")[0] for tag in kinds.models))
    said = {kinds.key: {"enum": values, "default": kinds.default, "description": "the kind"}}
    needed = [] if kinds.default else [kinds.key]
    parts = ["Every kind takes:", _table(said | common, needed, known)]
    for tag, model in zip(kinds.models, models, strict=True):
        kind, _, second = tag.partition(", ")
        fields = {f: v for f, v in model["properties"].items() if f not in every}
        more = _table(fields, model.get("required", []), known) if fields else ""
        title = f'{kinds.key} = "{kind}"' + (f", {second}" if second else "")
        parts += [f"### `{name}` with `{title}`", _sentence(model), *([more] if more else [])]
    return parts


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
    if isinstance(value, dict):
        return "`{}`"
    if isinstance(value, list):
        return "`[" + ", ".join(_value(v).strip("`") for v in value) + "]`"
    return f"`{value:g}`" if isinstance(value, float) else f"`{value}`"


def _kind(field: dict[str, Any]) -> str:
    """Choices, or the type and its bounds."""
    if _reference(field) or "oneOf" in field:
        return "table"
    if "anyOf" in field:
        kinds = [_kind(k) for k in field["anyOf"] if k.get("type") != "null"]
        return " or ".join(dict.fromkeys(kinds))
    if "const" in field:
        return _value(field["const"])
    if "enum" in field:
        return ", ".join(_value(v) for v in field["enum"])
    if "examples" in field:
        return ", ".join(_value(v) for v in field["examples"]) + ", or installed"
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
