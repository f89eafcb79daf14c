"""Reads a flight log of any known format, told by the end of its name."""

from __future__ import annotations

from pathlib import Path

from aircraft.logs.record import FlightLog, LogError

FORMATS = {".bin": "ArduPilot's DataFlash", ".ulg": "PX4's ULog", ".csv": "CSV"}
_PACKAGES = {".bin": "pymavlink", ".ulg": "pyulog"}


def read(path: Path, vehicle: int | None = None) -> FlightLog:
    """The flight of a log. `vehicle` is the one of a CSV table that holds several, counted from 1.

    Raises  LogError in one line, begun by the file's name; FileNotFoundError
    """
    kind = path.suffix.lower()
    if kind not in FORMATS:
        known = ", ".join(f"{end} ({what})" for end, what in FORMATS.items())
        raise LogError(f"{path}: logs that can be read end in {known}")
    if not path.is_file():
        raise FileNotFoundError(f"flight log {path} does not exist")
    if vehicle is not None and kind != ".csv":
        raise LogError(f"{path}: this format holds one vehicle; leave --vehicle out")
    try:
        if kind == ".csv":
            from aircraft.logs import table

            return table.read(path, vehicle)
        if kind == ".bin":
            from aircraft.logs import ardupilot

            return ardupilot.read(path)
        from aircraft.logs import px4

        return px4.read(path)
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] not in _PACKAGES.values():
            raise
        raise LogError(
            f"{path}: reading {FORMATS[kind]} needs {_PACKAGES[kind]}; install the extra `logs`"
        ) from None
    except LogError as error:
        raise LogError(f"{path}: {error}") from None
