"""What the tests of a user's own parts behind the border share: three vehicles, and what a breach says."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from filters.model import Command, Limits, State
from testbed.components.border.contract import Breach, Contract

DT = 0.02
RNG = np.random.default_rng(3)
START = State.of([[0.0, 0.0, 0.0, 0.0], [50.0, -20.0, 3.0, 5.0], [90.0, 10.0, -2.0, 1.0]])
FLOWN = Command.of([[20.0, 0.1, 0.0], [21.0, -0.1, 1.0], [19.0, 0.0, -1.0]])
CALM = np.zeros((3, 3))
SPEED = np.full(3, 20.0)
LIMITS = Limits(*(np.full(3, v) for v in (15.0, 25.0, 0.2, 1.0)))


def contract(part: str = "plant", vehicles: int = 3) -> Contract:
    return Contract(part, "my.Own", vehicles)


def said(function: Callable[..., Any], *arguments: Any, **named: Any) -> str:
    """The clause of the breach that the call raises."""
    with pytest.raises(Breach) as raised:
        function(*arguments, **named)
    assert raised.value.whose == "my.Own"
    return raised.value.clause


def refuses_writing(array: np.ndarray) -> bool:
    with pytest.raises(ValueError, match="read-only"):
        array += 1.0
    return True


def raising(*_: Any, **__: Any) -> Any:
    raise RuntimeError("the engine fell off")
