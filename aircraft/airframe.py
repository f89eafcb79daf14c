"""Loads an airframe by name, folder or gains file; a folder that is not ours is vetted first."""

from __future__ import annotations

import re
import shutil
from collections.abc import Mapping
from pathlib import Path

from aircraft.airframes.editing import replace_tables
from aircraft.airframes.naming import split
from aircraft.airframes.reading import read_airframe
from aircraft.airframes.safety import vet
from aircraft.airframes.schema import (
    AIRFRAMES,
    NAME,
    OTHERS,
    Airframe,
    folder_of,
    names,
)
from aircraft.autopilots import gains
from aircraft.autopilots.fitting import fitted_with
from aircraft.equations.catalogue import equations_of, xml_of


def load(name_or_folder: str | Path) -> Airframe:
    """An airframe by name (`x8`), by the path of its folder, or of a gains file, which names its base.

    `x8@arduplane` is that airframe under another autopilot than its own: one of the package's, or an
    equations file in its folder, `my-wing@pid.eq`.
    A folder that does not come with the package is vetted as a stranger's: see `aircraft.airframes.safety`.
    Raises  FileNotFoundError naming what is missing, ValueError naming the file and what is wrong with it.
    """
    base, asked = split(name_or_folder)
    folder = folder_of(base)
    if folder.suffix == ".toml":
        changed = load_gains(folder)
        return fitted_with(changed.model_copy(update={"name": f"{changed.name}+{folder.stem}"}), asked)
    found = read_airframe(folder)
    if found.folder.parent != AIRFRAMES.resolve():
        vet(found)
    return fitted_with(found, asked)


def load_gains(path: Path, airframe: Airframe | None = None) -> Airframe:
    """The airframe that a gains file stands for: its base, found beside the file, with the gains of the file.

    airframe  the base, in place of the one the file names; the names must agree
    Raises    FileNotFoundError, or ValueError naming the file and what is wrong with it
    """
    file = gains.read(path)
    beside = path.parent / file.base
    base = load(beside if file.base not in names() and beside.exists() else file.base)
    if airframe is not None and airframe.name != base.name:
        raise ValueError(f"{path}: gains of {file.base}, not of {airframe.name}")
    return gains.on_top_of(airframe or base, file)


def copy(name_or_folder: str, folder: Path, parameters: Mapping[str, float] | None = None) -> Path:
    """Copy an airframe to a new `folder`, whose last part becomes the copy's name; returns the copy.

    The autopilot that is asked for, x8@arduplane, becomes the copy's own: airframe.toml names it, with the
    parameters that differ from its defaults, and systems/autopilot.xml is compiled of it.
    parameters  of the autopilot, on top of those
    Raises      FileExistsError if the folder exists, ValueError for a name that TOML or JSBSim could not take
    """
    if folder.exists():
        raise FileExistsError(f"{folder} exists; give another folder")
    if not re.fullmatch(NAME, folder.name) or folder.suffix == ".toml":
        raise ValueError(f"{folder.name!r} cannot name an airframe; use letters, digits, - and _")
    source = load(name_or_folder)  # vetted: no link in it leads to somebody else's files
    shutil.copytree(source.folder, folder)
    path = folder / "airframe.toml"
    text = path.read_text(encoding="utf-8-sig")
    text = re.sub(r"^name = .*$", f'name = "{folder.name}"', text, count=1, flags=re.M)
    # Commands that remake derived numbers name their airframe.
    command = r'^command = "testbed aircraft (identify|trim) .*"$'
    text = re.sub(command, rf'command = "testbed aircraft \1 {folder.as_posix()}"', text, flags=re.M)
    if source.variant or parameters:
        text = _under(source.with_gains(dict(parameters or {})), text, folder)
    path.write_text(text, encoding="utf-8")
    if source.variant or parameters:
        (folder / "systems").mkdir(exist_ok=True)
        (folder / "systems" / "autopilot.xml").write_text(xml_of(load(folder)), encoding="utf-8")
    return folder


def _under(source: Airframe, text: str, folder: Path) -> str:
    """airframe.toml with the autopilot of `source` as its own; lags of another autopilot leave it."""
    text = re.sub(r"^autopilot = .*\n", "", text, flags=re.M)
    named = f'autopilot = "{source.autopilot}"'
    text = re.sub(r"^(name = .*)$", rf"\1\n{named}", text, count=1, flags=re.M)
    usual = {name: p.default for name, p in equations_of(source).parameters.items()}
    own = [f"{name} = {value!r}" for name, value in source.parameters.items() if value != usual[name]]
    text = replace_tables(text, "parameters", "\n".join(["[parameters]", *own]))
    beside = folder / OTHERS / f"{source.autopilot.removesuffix('.eq')}.toml"
    lags = ""
    if beside.is_file() and source.identified is not None:
        lags = replace_tables(beside.read_text(encoding="utf-8"), "parameters", "")
        lags = lags[lags.index("[identified]") :]
    beside.unlink(missing_ok=True)
    return replace_tables(text, "identified", lags) if source.variant else text
