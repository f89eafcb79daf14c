"""Says in one line how to install the extra `gym` where it is missing."""

from __future__ import annotations

from importlib.util import find_spec

from testbed.errors import UserError


def require(package: str) -> None:
    """UserError if `package`, of the extra `gym`, is not installed."""
    if find_spec(package) is None:
        raise UserError(f"testbed.gym: {package} is not installed; pip install 'cbf-jsbsim-testbed[gym]'")
