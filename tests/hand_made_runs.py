"""Runs as the verification reads them, made by hand from tracks instead of from a folder."""

from __future__ import annotations

from typing import Any

import numpy as np

from filters.model import Command, State, step
from testbed.scenario.scenario import load
from testbed.verification.recorded import Recorded

Array = np.ndarray
PLAIN = load("paper-2-turn").model_dump(mode="json")


def scenario(rates: tuple[float, float, float], **fields: Any) -> dict[str, Any]:
    """paper-2-turn with these periods (fdm, filter, record) [s] and other fields."""
    names = ("fdm_dt_s", "filter_dt_s", "record_dt_s")
    return PLAIN | {"rates": dict(zip(names, rates, strict=True))} | fields


def recorded(
    s: dict[str, Any],
    state: Array,
    rates: Array,
    command: Array | None = None,
    ended: str | None = None,
    left_s: Array | None = None,
    **manifest: Any,
) -> Recorded:
    """States (T, N, 4) over x, y, theta, z, rates and commands (T, N, 3), at the recorded instants."""
    count, n, _ = state.shape
    i, j = np.triu_indices(n, 1)
    t = s["rates"]["record_dt_s"] * np.arange(count)
    names = ("x_m", "y_m", "theta_rad", "z_m")
    columns = {name: state[..., k] for k, name in enumerate(names)}
    for suffix, values in (("", rates), ("_command", rates if command is None else command)):
        for k, (channel, unit) in enumerate((("v", "mps"), ("omega", "radps"), ("zeta", "mps"))):
            columns[f"{channel}{suffix}_{unit}"] = values[..., k]
    s = s | {"vehicles": n}
    return Recorded(manifest, s, ended, [], t, columns, {}, i, j, [], {}, {}, left_s)


def flown(start: Array, command: Array, dt: float) -> Array:
    """States (T, N, 4) of unicycles that begin at `start` (N, 4) and fly `command` (T, N, 3), for dt each."""
    states = [State.of(np.asarray(start, dtype=float))]
    for u in command[:-1]:
        states.append(step(states[-1], Command.of(u), dt))
    return np.array([x.array() for x in states])
