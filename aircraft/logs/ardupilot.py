"""Reads ArduPilot's DataFlash logs (.bin): the only import of pymavlink."""

from __future__ import annotations

import contextlib
import io
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from aircraft.logs.autopilot_log import G_MPS2, Logged, flight
from aircraft.logs.record import FlightLog, LogError, Signal, wrapped

# Message -> its fields that are read. XKF1 is the state of the third Kalman filter, NKF1 of the second.
_WANTED = {
    "ATT": ("DesRoll", "Yaw"),
    "TECS": ("spdem", "dhdem"),
    "XKF1": ("VN", "VE", "VD"),
    "NKF1": ("VN", "VE", "VD"),
    "XKF2": ("VWN", "VWE"),
    "NKF2": ("VWN", "VWE"),
}


def read(path: Path) -> FlightLog:
    """The flight of a DataFlash log.

    Roll asked for comes from ATT.DesRoll, airspeed and climb rate from TECS.spdem and dhdem, the
    velocity from XKF1 (or NKF1) of the first core, the wind from XKF2 (or NKF2).
    Raises  LogError naming the message that is missing; ImportError without pymavlink
    """
    rows = _rows(path)
    for name in ("ATT", "TECS"):
        if name not in rows:
            raise LogError(f"there is no {name} message: {_why(name)}")
    state = next((name for name in ("XKF1", "NKF1") if name in rows), None)
    if state is None:
        raise LogError("there is no XKF1 or NKF1 message, which hold the velocity over the ground")
    notes: list[str] = []
    att, tecs, ekf = rows["ATT"], rows["TECS"], rows[state]
    roll = np.radians(att["DesRoll"])
    wind = None
    air = next((rows[name] for name in ("XKF2", "NKF2") if name in rows), None)
    if air is not None:
        wind = (Signal.of("VWE", air["t"], air["VWE"]), Signal.of("VWN", air["t"], air["VWN"]))
    heading = np.pi / 2 - np.radians(att["Yaw"])
    return flight(
        path,
        "ardupilot",
        Logged(
            # A bank to the right turns right, which is clockwise.
            Signal.of("ATT.DesRoll", att["t"], -G_MPS2 * np.tan(roll)),
            Signal.of("TECS.spdem", tecs["t"], tecs["spdem"]),
            Signal.of("TECS.dhdem", tecs["t"], tecs["dhdem"]),
            Signal.of("VE", ekf["t"], ekf["VE"]),
            Signal.of("VN", ekf["t"], ekf["VN"]),
            Signal.of("VD", ekf["t"], -ekf["VD"]),
            wrapped(att["t"], heading),
            wind,
        ),
        notes,
    )


def _why(name: str) -> str:
    if name == "TECS":
        return "it is written in modes that control speed and height, such as GUIDED and FBWB"
    return "the log holds no attitude"


def _rows(path: Path) -> dict[str, dict[str, Any]]:
    """Message -> field -> values (k,), with the time t [s]."""
    from pymavlink.DFReader import DFReader_binary

    found: dict[str, dict[str, list[float]]] = {}
    # The reader prints what it finds odd, and asks the terminal nothing we want to answer.
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        try:
            log = DFReader_binary(str(path))
        except Exception as error:
            raise LogError(f"is no DataFlash log: {error}") from None
        try:
            while (m := log.recv_match(type=list(_WANTED))) is not None:
                name = m.get_type()
                if getattr(m, "C", 0) != 0:  # cores after the first estimate the same
                    continue
                columns = found.setdefault(name, defaultdict(list))
                columns["t"].append(m.TimeUS * 1e-6)
                for field in _WANTED[name]:
                    columns[field].append(float(getattr(m, field)))
        except AttributeError as error:
            raise LogError(f"a message of the log lacks a field: {error}") from None
        finally:
            log.close()
    return {name: {k: np.array(v) for k, v in columns.items()} for name, columns in found.items()}
