"""An airframe: a folder with a JSBSim model and `airframe.toml`, its speeds, gains and sources."""

from __future__ import annotations

import difflib
import hashlib
import re
import shutil
import tomllib
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

AIRFRAMES = Path(__file__).parent / "airframes"

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Speeds(_Strict):
    """Ground speeds in still air that the airframe is flown at."""

    v_min_mps: Positive
    v_max_mps: Positive
    start_mps: Positive
    trim_mps: list[Positive] = Field(description="where margins, steps and datasheet are evaluated")


class Channel(_Strict):
    """One command channel as the lagged kinematic plant sees it."""

    time_constant_s: Annotated[float, Field(ge=0)] = 0.0
    delay_s: Annotated[float, Field(ge=0)] = 0.0
    rate_max: Positive | None = Field(
        None, description="largest rate of change, the channel's unit per second"
    )
    rate_min: float | None = Field(None, description="most negative rate of change; -rate_max if absent")


class Identified(_Strict):
    """Channels identified on step responses; `command` is how to remake them."""

    command: str
    v: Channel
    omega: Channel
    zeta: Channel


class Airframe(_Strict):
    """`airframe.toml`. Gains are SI, section -> name -> value; section.name is property ap/section-name."""

    name: str
    title: str
    model: str = Field(description="the JSBSim model, MODEL.xml in the folder")
    licence: str
    speeds: Speeds
    surfaces: dict[str, str] = Field(description="telemetry name -> JSBSim property, rad")
    gains: dict[str, dict[str, Finite]]
    identified: Identified | None = None
    step_factor: Positive = Field(1.0, description="of the step specification's bounds, for this airframe")
    stated: dict[str, Finite] = Field(
        default={}, description="what the sources say, for `testbed aircraft check`: jxz_kgm2, mass_kg, ..."
    )
    folder: Path = Field(exclude=True)

    @property
    def has_rudder(self) -> bool:
        """Whether the autopilot steers a rudder: the gains have a section of that name."""
        return "rudder" in self.gains

    def gain_values(self) -> dict[str, float]:
        """section_name -> value, as the autopilot's equations name them."""
        return {f"{s}_{n}": v for s, names in self.gains.items() for n, v in names.items()}

    def fingerprint(self) -> str:
        """SHA-256 over every file of the folder and the gains it is flown with."""
        digest = hashlib.sha256()
        for file in sorted(p for p in self.folder.rglob("*") if p.is_file()):
            digest.update(str(file.relative_to(self.folder)).encode() + b"\0" + file.read_bytes())
        digest.update(repr(sorted(self.gain_values().items())).encode())
        return digest.hexdigest()

    def with_gains(self, changes: dict[str, float]) -> Airframe:
        """A copy with some gains changed, {"turn.damping": 0.9}. Raises KeyError on an unknown gain."""
        gains = {s: dict(names) for s, names in self.gains.items()}
        for key, value in changes.items():
            section, _, name = key.partition(".")
            if name not in gains.get(section, {}):
                known = [f"{s}.{n}" for s, names in gains.items() for n in names]
                near = difflib.get_close_matches(key, known, 3)
                raise KeyError(f"{self.name} has no gain {key}; near: {', '.join(near) or 'none'}")
            gains[section][name] = value
        return self.model_copy(update={"gains": gains})


def names() -> list[str]:
    """The airframes that come with the package."""
    return sorted(p.parent.name for p in AIRFRAMES.glob("*/airframe.toml"))


def folder_of(name_or_folder: str | Path) -> Path:
    """Where an airframe is: by name in the package, else the path itself, which need not exist."""
    if isinstance(name_or_folder, str) and name_or_folder in names():
        return AIRFRAMES / name_or_folder
    return Path(name_or_folder)


def copy(name_or_folder: str, folder: Path) -> Path:
    """Copy an airframe to a new `folder`, after whose last part the copy is named; returns it.

    Raises  FileExistsError if there is something, ValueError for a name that TOML or JSBSim could not take
    """
    if folder.exists():
        raise FileExistsError(f"{folder} exists; give another folder")
    if not re.fullmatch(r"[A-Za-z0-9][\w.+-]*", folder.name) or folder.suffix == ".toml":
        raise ValueError(f"{folder.name!r} cannot name an airframe; use letters, digits, - and _")
    source = folder_of(name_or_folder)
    shutil.copytree(source, folder)
    path = folder / "airframe.toml"
    text = re.sub(r"^name = .*$", f'name = "{folder.name}"', path.read_text(), count=1, flags=re.M)
    # The command that remakes the identified lags names its airframe.
    path.write_text(text.replace(f'identification {source.name}"', f'identification {folder.as_posix()}"'))
    return folder


def load(name_or_folder: str | Path) -> Airframe:
    """An airframe by name (`x8`), by the path of its folder, or of a gains file, which names its base.

    Raises  FileNotFoundError naming what is missing, ValueError naming the file and the field that is wrong.
    """
    folder = folder_of(name_or_folder)
    if folder.suffix == ".toml":
        from aircraft.gains import read

        changed = read(folder)
        return changed.model_copy(update={"name": f"{changed.name}+{folder.stem}"})
    path = folder / "airframe.toml"
    if not path.is_file():
        raise FileNotFoundError(
            f"no airframe {name_or_folder}: {path} does not exist; "
            f"there are {', '.join(names())}, or give a folder"
        )
    try:
        return Airframe(**tomllib.loads(path.read_text()), folder=folder.resolve())
    except tomllib.TOMLDecodeError as e:
        raise ValueError(f"{path}: {e}") from None
    except ValidationError as e:
        first = e.errors()[0]
        where = ".".join(str(p) for p in first["loc"])
        raise ValueError(f"{path}: {where}: {first['msg']}") from None
