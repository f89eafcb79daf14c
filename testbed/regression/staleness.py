"""Refuses airframes whose derived numbers are stale: a baseline of them would record another aircraft."""

from __future__ import annotations

from testbed.components import catalogue
from testbed.errors import UserError
from testbed.scenario.scenario import Scenario


def refuse_stale(s: Scenario) -> None:
    """UserError naming the airframe and the command that remakes its feed-forward or lags."""
    from aircraft.autopilots.freshness import stale_feedforward, stale_lags

    for airframe in {a.name: a for a in catalogue.airframes(s)}.values():
        if (why := stale_feedforward(airframe) or stale_lags(airframe)) is not None:
            raise UserError(f"airframe {airframe.name}: {why}")
