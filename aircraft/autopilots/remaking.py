"""Remakes the derived data in an airframe's files: feed-forward, the autopilot's XML, identified lags.

Each function returns the file as it should be; nothing is written before `Remade.write`.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from aircraft.airframes.editing import replace_tables, set_values
from aircraft.airframes.provenance import fitted_fingerprint, identified_fingerprint
from aircraft.airframes.schema import INVERTING, OTHERS, Airframe
from aircraft.autopilots.channel_family import FittedModel, choose
from aircraft.autopilots.feedforward import feedforward
from aircraft.autopilots.freshness import flown
from aircraft.autopilots.identification import CHANNELS, identify
from aircraft.autopilots.validation import flown_data, validate
from aircraft.equations.catalogue import xml_of
from aircraft.jsbsim.steady import Trim


@dataclass(frozen=True)
class Remade:
    """A file of an airframe, remade."""

    path: Path
    text: str  # of the whole file
    shown: str  # the lines that were remade

    @property
    def changed(self) -> bool:
        """Whether the file on disk differs."""
        return not self.path.is_file() or self.path.read_text(encoding="utf-8") != self.text

    def write(self) -> None:
        """Replace the file on disk."""
        self.path.parent.mkdir(exist_ok=True)
        aside = self.path.with_name(f".{self.path.name}.new")
        aside.write_text(self.text, encoding="utf-8")
        os.replace(aside, self.path)


def remade_feedforward(airframe: Airframe) -> Remade:
    """airframe.toml with the feed-forward fitted to level trims, and [fitted]; raises FdmError."""
    values = {name: f"{value:.6g}" if value else "0.0" for name, value in feedforward(airframe).items()}
    after = airframe.with_gains({f"airframe.{name}": float(value) for name, value in values.items()})
    fitted = "[fitted]\n" + _provenance("trim", airframe, fitted_fingerprint(after))
    path = airframe.folder / "airframe.toml"
    text = set_values(path.read_text(encoding="utf-8"), "gains.airframe", values)
    shown = "\n".join(["[gains.airframe]", *(f"{name} = {value}" for name, value in values.items())])
    return Remade(path, replace_tables(text, "fitted", fitted), f"{shown}\n\n{fitted}")


def remade_autopilot(airframe: Airframe) -> Remade:
    """systems/autopilot.xml compiled from the equations and gains; ValueError for a gain that is missing."""
    text = xml_of(airframe)
    return Remade(airframe.folder / "systems" / "autopilot.xml", text, text)


def remade_lags(
    airframe: Airframe,
    progress: Callable[[str], None] = lambda what: None,
    every: int = 1,
    near: Callable[[float], Trim | None] | None = None,
) -> Remade:
    """airframe.toml, or the gains file, with the lags identified on step responses. Raises FdmError.

    progress  called with the channel that is flown next
    every, near  see `identification.identify`
    """
    found = "[identified]\n" + _provenance("identify", airframe, identified_fingerprint(airframe))
    rows = ", ".join(map(repr, flown(airframe)))
    found += f"flown = [{rows}]\n"
    for channel in CHANNELS:
        progress(f"steps of {channel}")
        time_constant, delay, falls, rises = identify(airframe, channel, every, near)
        found += f"\n[identified.{channel}]\ntime_constant_s = {time_constant:.3f}\ndelay_s = {delay:.3f}\n"
        found += f"rate_min = {-falls:.3g}\nrate_max = {rises:.3g}\n"
        if airframe.fit != INVERTING:
            fits, checks = flown_data(airframe, channel)
            errors = validate(fits, checks, (time_constant, delay, falls, rises))
            found += f"validation_rms = {errors.first_order_rms:.3f}\n"
            found += f"second_order_rms = {errors.second_order_rms:.3f}\n"
            found += _best(channel, choose(channel, fits, checks)[0])
    path = airframe.gains_file or airframe.folder / "airframe.toml"
    if airframe.variant and airframe.gains_file is None:
        path = airframe.folder / OTHERS / f"{airframe.fit}.toml"
    before = path.read_text(encoding="utf-8") if path.is_file() else ""
    return Remade(path, replace_tables(before, "identified", found).lstrip("\n"), found)


def _best(channel: str, chosen: FittedModel) -> str:
    """The table of the best model of a channel, with the intervals of its parameters."""
    made = f'\n[identified.{channel}.best]\nkind = "{chosen.kind}"\n'
    made += f"validation_rms = {chosen.validation:.3f}\n"
    for name, numbers in (("values", chosen.values), ("low", chosen.low), ("high", chosen.high)):
        if numbers:
            made += f"{name} = {{ {', '.join(f'{k} = {v:.4g}' for k, v in numbers.items())} }}\n"
    return made


def _provenance(verb: str, airframe: Airframe, fingerprint: str) -> str:
    command = json.dumps(f"testbed aircraft {verb} {airframe.argument}")
    return f'command = {command}\nfingerprint = "{fingerprint}"\n'
