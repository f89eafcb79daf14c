"""`testbed list`: names the built-in scenarios."""

from __future__ import annotations

from testbed.cli.common import JsonOption, show_named

EXAMPLE = "Example: testbed list --json"


def list_(as_json: JsonOption = False) -> None:
    """List the built-in scenarios, each with a description."""
    from testbed.scenario.scenario import builtin, load

    rows = {name: load(name).description for name in builtin()}
    show_named(rows, as_json)
