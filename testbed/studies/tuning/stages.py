"""Says what an optimisation varies: gains or parameters of each channel, and the rows that they move."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from testbed.errors import UserError

if TYPE_CHECKING:
    from aircraft.airframes.schema import Airframe

# What is varied unless --vary says otherwise: gains of each channel, and the rows they move.
CHANNELS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "climb": (("bandwidth", "model_lag", "feedback_", "filter_radps"), ("climb", "margins")),
    "speed": (("bandwidth", "feedback_", "model_lag"), ("speed", "margins")),
    "turn": (("bandwidth", "damping", "model_lag", "feedback", "bank_feedback"), ("turn", "all", "margins")),
}
# The same of autopilots that people fly, by their parameters.
PARAMETERS: dict[str, dict[str, tuple[tuple[str, ...], tuple[str, ...]]]] = {
    "arduplane": {
        "climb": (
            ("PTCH2SRV_TCONST", "PTCH_RATE_P", "PTCH_RATE_I", "TECS_TIME_CONST", "TECS_PTCH_DAMP"),
            ("climb", "margins"),
        ),
        "speed": (("TECS_THR_DAMP", "TECS_INTEG_GAIN"), ("speed", "margins")),
        "turn": (("RLL2SRV_TCONST", "RLL_RATE_FF", "RLL_RATE_P", "RLL_RATE_I"), ("turn", "all", "margins")),
    },
    "px4": {
        "climb": (("FW_P_TC", "FW_PR_FF", "FW_PR_P", "FW_T_PTCH_DAMP"), ("climb", "margins")),
        "speed": (("FW_T_TAS_TC", "FW_T_THR_DAMPING", "FW_T_THR_INTEG"), ("speed", "margins")),
        "turn": (("FW_R_TC", "FW_RR_FF", "FW_RR_P"), ("turn", "all", "margins")),
    },
}


def stages(airframe: Airframe, vary: Sequence[str]) -> tuple[tuple[tuple[str, ...], tuple[str, ...]], ...]:
    """(gains, groups of rows) of each stage of a search: one a channel, or one of all the gains in `vary`."""
    from aircraft.airframes.schema import INVERTING
    from aircraft.autopilots.gains import resolve

    sections = {
        channel: (tuple(f"{channel}.{name}" for name in names), groups)
        for channel, (names, groups) in CHANNELS.items()
    }
    inverting = airframe.autopilot == INVERTING
    channels = sections if inverting else PARAMETERS.get(airframe.autopilot, {})
    if not channels and not vary:
        known = ", ".join(list(airframe.parameters)[:5])
        raise UserError(
            f"--optimise: say what may change in {airframe.autopilot} with --vary NAME; it has {known}, ..."
        )
    try:
        if vary:
            gains = tuple(resolve(airframe, name) for name in vary)
            touched = {
                channel
                for channel, (names, _) in channels.items()
                for g in gains
                if g.split(".")[0] == channel or g in names
            }
            everything = channels or sections
            groups = {row for channel in touched or everything for row in everything[channel][1]}
            return ((gains, tuple(sorted(groups))),)
        return tuple(
            (tuple(resolve(airframe, name) for name in names), groups) for names, groups in channels.values()
        )
    except ValueError as error:
        raise UserError(f"--vary: {error}") from None
