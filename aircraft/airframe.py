"""An airframe: a folder with a JSBSim model and `airframe.toml`, its speeds, gains and sources."""

from __future__ import annotations

import difflib
import hashlib
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


def load(name_or_folder: str | Path) -> Airframe:
    """An airframe by name (`x8`), by the path of its folder, or of a gains file, which names its base.

    Raises  FileNotFoundError naming what is missing, ValueError naming the file and the field that is wrong.
    """
    folder = Path(name_or_folder)
    if folder.suffix == ".toml":
        from aircraft.gains import read

        changed = read(folder)
        return changed.model_copy(update={"name": f"{changed.name}+{folder.stem}"})
    if isinstance(name_or_folder, str) and name_or_folder in names():
        folder = AIRFRAMES / name_or_folder
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
