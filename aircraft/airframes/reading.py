"""Reads an airframe.toml; what is wrong with it is one line that names the field and the line of the file."""

from __future__ import annotations

from pathlib import Path

from pydantic import ValidationError

from aircraft.airframes.schema import Airframe, first_error, names
from aircraft.textfile import TextError, line_of, parse_toml, read_text


class AirframeFileError(ValueError):
    """What is wrong with an airframe.toml: the message in one line, and the key and line that it is about."""

    def __init__(self, path: Path, message: str, key: str = "", line: int | None = None) -> None:
        super().__init__(f"{path}: {message}")
        self.message = message
        self.key = key
        self.line = line


def read_airframe(folder: Path) -> Airframe:
    """The airframe.toml of a folder, whatever else the folder holds.

    Raises  FileNotFoundError; AirframeFileError naming the file, the field and what is wrong with it
    """
    path = folder / "airframe.toml"
    try:
        text = read_text(path)
        tables = parse_toml(text)
    except FileNotFoundError:
        raise FileNotFoundError(f"no airframe {folder}: {path} does not exist; {_instead(folder)}") from None
    except TextError as error:
        raise AirframeFileError(path, str(error), line=error.line) from None
    for field in ("folder", "gains_file", "variant", "equations_sha256"):
        if field in tables:
            raise AirframeFileError(path, f"{field}: unknown field", field, line_of(text, [field]))
    try:
        return Airframe(**tables, folder=folder.resolve())
    except ValidationError as error:
        keys, message = first_error(error)
        lines = (line_of(text, keys[:n]) for n in range(len(keys), 0, -1))
        line = next((found for found in lines if found is not None), 1)
        key = ".".join(map(str, keys))
        raise AirframeFileError(path, f"{key}: {message}" if key else message, key, line) from None


def _instead(folder: Path) -> str:
    """What to give in place of a folder that is no airframe's."""
    if any(folder.glob("*.xml")):
        return f"make an airframe of this model: testbed aircraft adopt {folder}"
    return f"there are {', '.join(names())}, or give a folder"
