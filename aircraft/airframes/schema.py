"""The contents of `airframe.toml` as typed data: speeds, surfaces, gains, identified lags.

Nothing here checks whether a folder is safe: `aircraft.airframe.load` does.
"""

from __future__ import annotations

import difflib
import hashlib
import math
import os
import re
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, Field, ValidationError, model_validator

from aircraft.airframes.best_model import Best
from aircraft.airframes.sensors import label, sensors_of
from aircraft.airframes.setup import Engines, Finite, Positive, Setup, Strict, is_property

AIRFRAMES = Path(__file__).parent
OTHERS = "autopilots"  # folder of an airframe with what belongs to autopilots that it can fly besides its own
INVERTING = "inverting"  # the autopilot that airframes fly unless they name another

# Angles that are recorded of every airframe: no surface may take their names.
RECORDED_ANGLES = frozenset({"roll_rad", "pitch_rad", "heading_rad", "alpha_rad", "beta_rad", "theta_rad"})
NAME = r"[A-Za-z0-9][\w.+-]*"


def _plain(name: str) -> str:
    """A name becomes a file's and a folder's, in the folder it is meant for and no other."""
    if not re.fullmatch(NAME, name):
        raise ValueError("use letters, digits, - and _")
    return name


Plain = Annotated[str, Field(max_length=100), AfterValidator(_plain)]


class Speeds(Strict):
    """Ground speeds in still air that the airframe is flown at."""

    v_min_mps: Positive
    v_max_mps: Positive
    start_mps: Positive
    trim_mps: list[Positive] = Field(
        min_length=1, description="where margins, steps and datasheet are evaluated"
    )

    turn_radps: Positive | None = Field(
        default=None, description="turn rate of the steps that score an autopilot; absent: 11.7 deg/s"
    )
    climb_mps: Positive | None = Field(
        default=None, description="climb rate of those steps, which must be sustainable; absent: 3.9 m/s"
    )
    step_mps: Positive | None = Field(
        default=None, description="largest change of speed in those steps; absent: half the range of speeds"
    )

    @model_validator(mode="after")
    def ordered(self) -> Speeds:
        if not self.v_min_mps <= self.start_mps <= self.v_max_mps:
            raise ValueError("v_min_mps, start_mps and v_max_mps must be in this order")
        return self

    def within(self, share: float) -> float:
        """The speed [m/s] at a share of the way from v_min_mps to v_max_mps, to 0.001 m/s."""
        return round(self.v_min_mps + share * (self.v_max_mps - self.v_min_mps), 3)

    def step(self, most: float) -> float:
        """The change of speed [m/s] that a step asks for: what the airframe sustains, at most `most`."""
        return min(self.step_mps or most, most)


class Channel(Strict):
    """One command channel as the lagged kinematic plant sees it."""

    time_constant_s: Annotated[float, Field(ge=0, le=1e3)] = 0.0
    delay_s: Annotated[float, Field(ge=0, le=60)] = 0.0
    rate_max: Positive | None = Field(
        None, description="largest rate of change, the channel's unit per second"
    )
    rate_min: Annotated[float, Field(ge=-1e6, lt=0)] | None = Field(
        None, description="most negative rate of change; -rate_max if absent"
    )
    validation_rms: Finite | None = Field(
        None, description="rms error on steps that were not fitted, as a share of the step"
    )
    second_order_rms: Finite | None = Field(
        None, description="the same of a second-order lag, for comparison"
    )
    best: Best | None = Field(None, description="the best of a family of models, with its uncertainty")


class Fitted(Strict):
    """Where the fitted feed-forward of [gains.airframe] comes from; see `aircraft.airframes.provenance`."""

    command: str = Field("", description="remakes the numbers")
    fingerprint: str | None = Field(None, description="of what they were made from")


class Identified(Strict):
    """Channels identified on step responses of the model or on a flight log, and where they come from."""

    command: str = Field("", description="remakes the channels")
    fingerprint: str | None = Field(None, description="of the gains and model they were made from")
    flown: list[Finite] = Field([], description="what the model flew then: see aircraft.autopilots.freshness")
    log: str | None = Field(None, description="the flight log they were made from, in place of a model")
    log_sha256: str | None = Field(None, description="of that log", pattern=r"^[0-9a-f]{64}$")
    v: Channel
    omega: Channel
    zeta: Channel

    @model_validator(mode="after")
    def of_one_source(self) -> Identified:
        if (self.log is None) != (self.log_sha256 is None):
            raise ValueError("log and log_sha256 stand together")
        return self


def property_name(name: str) -> str:
    """The JSBSim property of a gain or of an autopilot's equation: `turn_damping` is ap/turn-damping."""
    return "ap/" + name.replace("_", "-")


def check_gains(gains: dict[str, dict[str, float]]) -> None:
    """ValueError naming the gain that cannot be radians, or that is called what no property is."""
    for section, names in gains.items():
        for name, value in names.items():
            if not re.fullmatch(r"[a-z0-9_]+", section + name):
                raise ValueError(f"gains.{section}.{name}: use small letters, digits and _")
            most = math.pi / 2 if name.endswith("_rad") else 100.0 if name.endswith("_radps") else math.inf
            if abs(value) > most:
                raise ValueError(
                    f"gains.{section}.{name}: {value:g} is out of range for radians, at most {most:.4g};"
                    f" {value:g} degrees are {math.radians(value):.4g}"
                )


class Airframe(Strict):
    """`airframe.toml`. Gains are SI, section -> name -> value; section.name is property ap/section-name."""

    name: Plain
    title: str
    model: Plain = Field(description="the JSBSim model, MODEL.xml in the folder")
    licence: str
    speeds: Speeds
    surfaces: dict[str, str] = Field(description="telemetry name -> JSBSim property, rad")
    autopilot: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]*(\.eq)?$", max_length=100)] = Field(
        INVERTING, description="inverting, arduplane, px4, or an equations file of the folder, NAME.eq"
    )
    gains: dict[str, dict[str, Finite]] = Field({}, description="of the airframe and the inverting autopilot")
    parameters: dict[Annotated[str, Field(pattern=r"^[A-Za-z]\w*$")], Finite] = Field(
        {}, description="the autopilot's parameters, by the names and in the units of its equations"
    )
    setup: Setup = Setup()
    engines: Engines = Engines()
    sensors: dict[str, Finite | str] = Field(
        {}, description="what the autopilot senses: preset, and values of it; see aircraft.airframes.sensors"
    )
    fitted: Fitted | None = None
    identified: Identified | None = None
    step_factor: Positive = Field(1.0, description="of the step specification's bounds, for this airframe")
    stated: dict[str, Finite] = Field(
        default={}, description="what the sources say, for `testbed aircraft check`: jxz_kgm2, mass_kg, ..."
    )
    folder: Path = Field(exclude=True)
    gains_file: Path | None = Field(None, exclude=True, description="whose gains these are, if a file's")
    variant: str = Field("", exclude=True, description="what was asked after the folder, @AUTOPILOT")
    equations_sha256: str = Field("", exclude=True, description="of equations that are no file of the folder")

    @model_validator(mode="after")
    def radians(self) -> Airframe:
        """Angles and their rates in the range of radians; telemetry under names of its own."""
        check_gains(self.gains)
        sensors_of(self.sensors)
        for name, path in self.surfaces.items():
            if not is_property(path):
                raise ValueError(f"surfaces.{name}: {path!r} cannot name a property of JSBSim")
            if name in RECORDED_ANGLES or not re.fullmatch(r"[a-z][a-z0-9_]*_rad", name):
                raise ValueError(
                    f"surfaces.{name}: call a surface something_rad, not what is recorded already"
                )
        return self

    @property
    def argument(self) -> str:
        """What names this airframe on a command line: its name if it is ours, or its folder or gains file."""
        if self.gains_file is not None:
            return self.gains_file.as_posix()
        if self.folder.parent == AIRFRAMES.resolve():
            return self.folder.name + self.variant
        here = Path.cwd().resolve()
        inside = self.folder.is_relative_to(here) and self.folder != here
        return (self.folder.relative_to(here) if inside else self.folder).as_posix() + self.variant

    @property
    def fit(self) -> str:
        """The autopilot and its sensors in a word: arduplane, arduplane@typical."""
        return self.autopilot.removesuffix(".eq") + label(self.sensors)

    @property
    def has_rudder(self) -> bool:
        """Whether the autopilot steers a rudder: the gains have a section of that name."""
        return "rudder" in self.gains

    def gain_values(self) -> dict[str, float]:
        """section_name -> value, as the autopilot's equations name them."""
        return {f"{s}_{n}": v for s, names in self.gains.items() for n, v in names.items()}

    def fingerprint(self) -> str:
        """SHA-256 over every file of the folder that counts, and the gains it is flown with.

        Of the files for other autopilots, in FOLDER/autopilots, only those of the autopilot flown count.
        """
        digest = hashlib.sha256()
        for file in sorted(p for p in self.folder.rglob("*") if p.is_file()):
            inside = file.relative_to(self.folder)
            if inside.parts[0] != OTHERS or inside.stem in (self.autopilot, self.fit):
                digest.update(str(inside).encode() + b"\0" + file.read_bytes())
        digest.update(repr(sorted(self.gain_values().items())).encode())
        if self.variant or self.autopilot != INVERTING:
            own = [
                self.fit,
                self.equations_sha256,
                sorted(self.parameters.items()),
                sorted(self.sensors.items()),
            ]
            digest.update(repr(own).encode())
        return digest.hexdigest()

    def with_gains(self, changes: dict[str, float]) -> Airframe:
        """A copy with some gains or parameters changed, {"turn.damping": 0.9}; KeyError on an unknown one."""
        gains = {s: dict(names) for s, names in self.gains.items()}
        parameters = dict(self.parameters)
        for key, value in changes.items():
            section, _, name = key.partition(".")
            if key in parameters:
                parameters[key] = value
            elif name in gains.get(section, {}):
                gains[section][name] = value
            else:
                near = difflib.get_close_matches(key, self.gain_names(), 3)
                raise KeyError(f"{self.name} has no gain {key}; near: {', '.join(near) or 'none'}")
        return self.model_copy(update={"gains": gains, "parameters": parameters})

    def gain(self, key: str) -> float:
        """The value of what `with_gains` calls `key`; KeyError if there is none."""
        section, _, name = key.partition(".")
        return self.parameters[key] if key in self.parameters else self.gains[section][name]

    def gain_names(self) -> list[str]:
        """What `with_gains` can change: section.name of gains, and the parameters of the autopilot."""
        return [f"{s}.{n}" for s, names in self.gains.items() for n in names] + list(self.parameters)


def names() -> list[str]:
    """The airframes that come with the package."""
    return sorted(p.parent.name for p in AIRFRAMES.glob("*/airframe.toml"))


def folder_of(name_or_folder: str | Path) -> Path:
    """Where an airframe is: by name in the package, else the path, which need not exist; `~` is home."""
    if isinstance(name_or_folder, str) and name_or_folder in names():
        return AIRFRAMES / name_or_folder
    return Path(os.path.expanduser(name_or_folder))


def identified(table: Any) -> Identified:
    """The [identified] table of a file. Raises ValueError naming the field, in one line."""
    try:
        return Identified.model_validate(table)
    except ValidationError as error:
        keys, message = first_error(error)
        raise ValueError(f"{'.'.join(map(str, ('identified', *keys)))}: {message}") from None


def first_error(error: ValidationError) -> tuple[tuple[str | int, ...], str]:
    """The first field that does not validate, as keys, and why, in one line."""
    # An unknown field explains another that is missing.
    first = min(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
    if first["type"] == "extra_forbidden":
        return first["loc"], "unknown field"
    message = str(first["msg"]).removeprefix("Value error, ")
    # Our own validators name the field that they look at.
    key = message.partition(":")[0]
    if not first["loc"] and re.fullmatch(r"[a-z]\w*(\.\w+)+", key):
        return tuple(key.split(".")), message.partition(": ")[2]
    return first["loc"], message
