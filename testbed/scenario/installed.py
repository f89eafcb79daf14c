"""Knows which kinds of plant, filter and guidance the testbed has, and which installed packages offer."""

from __future__ import annotations

import sys
from functools import lru_cache
from importlib.metadata import entry_points
from typing import Any

# Role -> group of entry points.
GROUPS = {
    "plant": "cbf_jsbsim_testbed.plants",
    "filter": "cbf_jsbsim_testbed.filters",
    "guidance": "cbf_jsbsim_testbed.guidance",
    "environment": "cbf_jsbsim_testbed.environments",
}
# Role -> the testbed's own kinds.
BUILT_IN = {
    "plant": ("unicycle", "lagged", "jsbsim"),
    "filter": ("centralised", "limited", "navigation", "none"),
}


def names(role: str) -> list[str]:
    """Names that installed packages offer for a role; nothing of them is imported."""
    return list(_names(GROUPS[role], tuple(sys.path)))


@lru_cache(maxsize=32)
def _names(group: str, path: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(sorted({point.name for point in entry_points(group=group)}))


def named(s: Any) -> dict[str, str]:
    """Role -> the kind that a scenario names."""
    return {"plant": s.plant, "filter": s.filter.kind}


def refusal(role: str, name: str) -> str | None:
    """Why a scenario cannot name this kind: neither the testbed's nor installed; None if it can."""
    known = [*BUILT_IN[role], *names(role)]
    if name in known:
        return None
    listed = ", ".join(map(repr, known[:-1])) + f" or {known[-1]!r}"
    return f"input should be {listed}"
