"""Writes lags that were identified on a flight log into an airframe's file, with the log's name and hash."""

from __future__ import annotations

import json
import shlex
from collections.abc import Sequence
from pathlib import Path

from aircraft.airframes.editing import replace_tables
from aircraft.airframes.schema import Airframe
from aircraft.autopilots.remaking import Remade
from aircraft.logs.fitting import Fit
from aircraft.logs.record import CHANNELS, FlightLog, LogError


def remade(airframe: Airframe, log: FlightLog, path: Path, fits: Sequence[Fit]) -> Remade:
    """airframe.toml, or the gains file, with the lags of a log's aircraft as [identified].

    path    of the log, as the command named it
    Raises  LogError if a channel has no fit
    """
    by_name = {f.channel: f for f in fits}
    if missing := [name for name in CHANNELS if name not in by_name]:
        raise LogError(
            f"{path}: no steps of {' and '.join(missing)} in the log; [identified] needs all three channels."
            " Fly steps that hold for 1.5 s, one channel at a time"
        )
    words = shlex.join(["testbed", "aircraft", "log", str(path), "--airframe", airframe.argument, "--write"])
    found = "[identified]\n"
    found += f'command = {json.dumps(words)}\nlog = {json.dumps(log.source)}\nlog_sha256 = "{log.sha256}"\n'
    for name in CHANNELS:
        f = by_name[name]
        found += (
            f"\n[identified.{name}]\ntime_constant_s = {f.time_constant_s:.3f}\ndelay_s = {f.delay_s:.3f}\n"
        )
        # A limit that no step reached would be the fit's guess. But rate_min alone may not be left out: the
        # file takes it for -rate_max.
        falls, rises = f.reached
        if falls or rises:
            found += f"rate_min = {f.rate_min:.3g}\n"
        if rises:
            found += f"rate_max = {f.rate_max:.3g}\n"
    file = airframe.gains_file or airframe.folder / "airframe.toml"
    return Remade(file, replace_tables(file.read_text(encoding="utf-8"), "identified", found), found)
