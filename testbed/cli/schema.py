"""`testbed schema`: prints the fields of scenario files, as JSON Schema or as Markdown."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from testbed.errors import UserError

EXAMPLE = "Example: testbed schema > scenario.schema.json"


def schema(
    as_markdown: Annotated[
        bool, typer.Option("--markdown", help="print the reference page of the guide instead")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON Schema, which is the default")] = False,
) -> None:
    """Print the JSON Schema of scenario files, or their reference page as Markdown."""
    from testbed.scenario.scenario import Scenario

    if as_markdown and as_json:
        raise UserError("--markdown and --json: one at a time")
    if as_markdown:
        from testbed.scenario.reference_page import markdown

        print(markdown(), end="")
        return
    print(json.dumps(Scenario.model_json_schema(), indent=2))
