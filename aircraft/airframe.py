"""Loads an airframe by name, folder or gains file; a folder that is not ours is vetted first."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

from aircraft.airframes.safety import vet
from aircraft.airframes.schema import AIRFRAMES, NAME, Airframe, folder_of, names, read_airframe
from aircraft.autopilots import gains


def load(name_or_folder: str | Path) -> Airframe:
    """An airframe by name (`x8`), by the path of its folder, or of a gains file, which names its base.

    A folder that does not come with the package is vetted as a stranger's: see `aircraft.airframes.safety`.
    Raises  FileNotFoundError naming what is missing, ValueError naming the file and what is wrong with it.
    """
    folder = folder_of(name_or_folder)
    if folder.suffix == ".toml":
        changed = load_gains(folder)
        return changed.model_copy(update={"name": f"{changed.name}+{folder.stem}"})
    found = read_airframe(folder)
    if found.folder.parent != AIRFRAMES.resolve():
        vet(found)
    return found


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


def copy(name_or_folder: str, folder: Path) -> Path:
    """Copy an airframe to a new `folder`, whose last part becomes the copy's name; returns the copy.

    Raises  FileExistsError if the folder exists, ValueError for a name that TOML or JSBSim could not take
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
    path.write_text(text, encoding="utf-8")
    return folder
