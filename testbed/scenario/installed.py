"""Knows which kinds of plant, filter and guidance the testbed has, and which installed packages offer."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import lru_cache
from importlib.metadata import entry_points

# Role -> group of entry points.
GROUPS = {
    "plant": "cbf_jsbsim_testbed.plants",
    "filter": "cbf_jsbsim_testbed.filters",
    "guidance": "cbf_jsbsim_testbed.guidance",
    "environment": "cbf_jsbsim_testbed.environments",
}
PLANTS = ("unicycle", "lagged", "jsbsim")


def names(role: str) -> list[str]:
    """Names that installed packages offer for a role; nothing of them is imported."""
    return list(_names(GROUPS[role], tuple(sys.path)))


@lru_cache(maxsize=32)
def _names(group: str, path: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(sorted({point.name for point in entry_points(group=group)}))


def installed(role: str) -> Callable[[str], str]:
    """A check that an installed package offers a name for `role`; it raises ValueError, listing them."""

    def check(name: str) -> str:
        if name not in names(role):
            offered = ", ".join(map(repr, names(role))) or "none"
            raise ValueError(f"no installed package offers this {role}; installed: {offered}")
        return name

    return check


def plant(name: str) -> str:
    """A plant of the testbed's or an installed one; ValueError, listing both, for any other name."""
    known = [*PLANTS, *names("plant")]
    if name not in known:
        raise ValueError(f"input should be {', '.join(map(repr, known[:-1]))} or {known[-1]!r}")
    return name
