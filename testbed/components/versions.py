"""Tells the versions of the project and of the packages that its numbers depend on."""

from __future__ import annotations

import platform
from functools import cache
from importlib import metadata

PACKAGES = ("jsbsim", "daqp", "osqp", "numpy", "scipy", "pandas", "pyarrow")


def versions() -> dict[str, str]:
    """Versions of everything a number in a run depends on."""
    return {
        "cbf-jsbsim-testbed": _version("cbf-jsbsim-testbed"),
        "python": platform.python_version(),
    } | {name: _version(name) for name in PACKAGES}


@cache
def _version(package: str) -> str:
    # Reading all of them takes as long as flying two aircraft for three seconds.
    return metadata.version(package)
