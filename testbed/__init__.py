"""How we measure: scenarios, the simulation loop, guarantees, reports."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from testbed.simulate import run as run
    from testbed.store import load as load

# Loaded when first asked for, so that the command line answers at once.
_HOMES = {"load": "testbed.store", "run": "testbed.simulate"}

__all__ = ["load", "run"]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'testbed' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)
