"""How we measure: scenarios, the simulation loop, guarantees, reports."""

from testbed.store import load

__all__ = ["load"]
