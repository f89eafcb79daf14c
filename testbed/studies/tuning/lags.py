"""Identifies the lags of tuned gains anew, and says which channels got slower."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from aircraft.airframe import Airframe
    from aircraft.airframes.schema import Identified

CHANNELS = {"v": "speed", "omega": "turn rate", "zeta": "climb rate"}
# A channel counts as slower from this share of its time to 63 % on.
SLOWER = 0.03


def identify_again(gains_file: Path, final: Path, progress: Callable[[str], None]) -> Identified:
    """Add [identified] tables to a gains file, found on step responses with its gains; returns them.

    final   where the file will stand: the command that remakes the tables names it so
    Raises  FdmError if the airframe cannot fly the steps
    """
    from aircraft.airframe import load
    from aircraft.autopilots.remaking import remade_lags

    made = remade_lags(load(gains_file), progress)
    text = made.text.replace(gains_file.as_posix(), final.as_posix())
    gains_file.write_text(text, encoding="utf-8")
    known = load(gains_file).identified
    assert known is not None
    return known


def known_lags(airframe: Airframe) -> Identified | None:
    """The lags identified on the airframe as it is; None if there are none or they are of another one."""
    from aircraft.autopilots.freshness import stale_lags

    return None if stale_lags(airframe) else airframe.identified


def rows(before: Identified | None, after: Identified) -> list[dict[str, Any]]:
    """One row per channel: time constant and delay before and after [s], and their sum, the time to 63 %."""
    made = []
    for channel, name in CHANNELS.items():
        new, old = getattr(after, channel), getattr(before, channel, None)
        row: dict[str, Any] = {"channel": name}
        for key in ("time_constant_s", "delay_s"):
            row[f"{key} before"] = None if old is None else getattr(old, key)
            row[key] = getattr(new, key)
        row["t63_s before"] = None if old is None else round(old.time_constant_s + old.delay_s, 6)
        row["t63_s"] = round(new.time_constant_s + new.delay_s, 6)
        made.append(row)
    return made


def sentences(found: list[dict[str, Any]]) -> list[str]:
    """Which channels got slower, by the time to 63 % of a step."""
    said = []
    for row in found:
        old, new = row["t63_s before"], row["t63_s"]
        if old is not None and new > old * (1.0 + SLOWER):
            share = 100.0 * (new / old - 1.0)
            said.append(
                f"{row['channel']} got slower by {share:.0f} %: 63 % after {new:.3f} s, before {old:.3f} s"
            )
    if not said:
        known = all(row["t63_s before"] is not None for row in found)
        said = (
            ["no channel got slower"] if known else ["the lags before are not known: nothing to compare with"]
        )
    return said
