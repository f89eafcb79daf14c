"""Reads scenario files of the air traffic simulator BlueSky: where aircraft start, and their legs.

Read are CRE, ADDWPT, DEST and DEFWPT, and HOLD, QUIT and END for the end. Heights are feet or flight levels,
speeds calibrated knots or Mach numbers; without wind the ground speed is the true airspeed.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from math import cos, pi, radians, sin
from pathlib import Path

import numpy as np

from aircraft.jsbsim.geodesy import Origin, ecef
from testbed.encounters.airspeed import true_of_calibrated, true_of_mach
from testbed.encounters.encounter import Aircraft, Encounter
from testbed.encounters.state_table import read_lines
from testbed.encounters.units import FT, KNOT
from testbed.errors import Mistake, UserError, nearest, short

_LINE = re.compile(r"(\d+):(\d+):(\d+(?:\.\d*)?)\s*>(.*)")
_FLOWN = {"CRE": 8, "ADDWPT": 3, "DEST": 3, "DEFWPT": 4}
_ENDS = ("HOLD", "QUIT", "END", "STOP", "EXIT", "PAUSE", "CLOSE")
# What changes pictures, logs or BlueSky's own conflict resolution: it moves nothing before that resolves.
_IDLE = """
    AREA ASAS BOX CDMETHOD CDRADIUS CIRCLE COLOR COLOUR CRELOG DATAFEED DT DTLOOK DTMULT ECHO
    FASTFORWARD FF FILTERALT FIXDT GROUP HELP LABEL LEGEND LINE LISTRTE MAKEDOC METRIC NAVDISP NORESO OP ORIG
    PAN PLOT POLY POLYALT POS RESO RESOOFF RFACH RFACV RMETHH RMETHV RTF SAVEIC SCEN SCREENSHOT SEED SHOWTRAF
    SHOWWPT SSD SWRAD SYMBOL TRAIL TRAILS TRAFRECDT ZONEDH ZONER ZOOM LNAV VNAV ASASV
""".split()  # noqa: SIM905


@dataclass
class _Created:
    """An aircraft as far as it has been read: degrees, metres, m/s."""

    line: int
    at: float
    latitude: float
    longitude: float
    heading: float
    height: float
    speed: float
    legs: list[tuple[float, float, float, float]] = field(default_factory=list)


def read_bluesky(path: Path, skip_unknown: bool = False) -> Encounter:
    """The encounter of a scenario file, its aircraft in the order in which they are created.

    skip_unknown  leave out commands that are not read, and note them, instead of refusing the file
    An aircraft created later than the first is put back along its heading at its speed, for here all fly
    from the begin.
    Raises  UserError with the file, the line and what to do
    """
    reader = _Reader(str(path), skip_unknown)
    for number, line in enumerate(read_lines(path), 1):
        reader.line(number, line)
    return reader.encounter(path.stem)


@dataclass
class _Reader:
    file: str
    skip_unknown: bool
    created: dict[str, _Created] = field(default_factory=dict)
    waypoints: dict[str, tuple[float, float]] = field(default_factory=dict)
    skipped: dict[str, list[int]] = field(default_factory=dict)
    end: float | None = None

    def line(self, number: int, line: str) -> None:
        line = re.split(r"\s#|^#", line.strip())[0].strip()
        if not line:
            return
        found = _LINE.fullmatch(line)
        if found is None:
            remedy = "a line is HH:MM:SS.hh>COMMAND, or a comment that begins with #"
            raise self._mistake(number, f"{short(line)!r} is no command with its time", remedy)
        t = 3600.0 * int(found[1]) + 60.0 * int(found[2]) + float(found[3])
        for command in found[4].split(";"):
            if words := re.split(r"\s*,\s*|\s+", command.strip()):
                self._command(number, t, words)

    def _command(self, number: int, t: float, words: list[str]) -> None:
        name = words[0].upper()
        if name in self.created and len(words) > 1:  # BlueSky also takes the aircraft first
            name, words = words[1].upper(), [words[1], words[0], *words[2:]]
        if not name or name.strip("+-=") == "":
            return
        if name in _ENDS:
            self.end = t if self.end is None else min(self.end, t)
        elif name in ("LNAV", "VNAV") and words[-1].upper() == "OFF":
            self._unknown(number, f"{name} OFF")
        elif name in _FLOWN:
            if len(words) < _FLOWN[name]:
                usual = {
                    "CRE": "CRE acid,type,lat,lon,hdg,alt,spd",
                    "ADDWPT": "ADDWPT acid,lat,lon,alt,spd",
                    "DEST": "DEST acid,lat,lon",
                    "DEFWPT": "DEFWPT name,lat,lon",
                }[name]
                raise self._mistake(number, f"{name} has {len(words) - 1} values", f"write {usual}")
            getattr(self, f"_{name.lower()}")(number, t, words[1:])
        elif name not in _IDLE:
            self._unknown(number, name)

    def _unknown(self, number: int, name: str) -> None:
        if self.skip_unknown:
            self.skipped.setdefault(name, []).append(number)
            return
        hint = nearest(name, [*_FLOWN, *_ENDS])
        raise self._mistake(
            number,
            f"command {short(name)} is not read, and may change what an aircraft flies; {hint}",
            "take it out, or give --skip-unknown",
        )

    def _cre(self, number: int, t: float, words: list[str]) -> None:
        name = words[0].upper()
        if name in self.created:
            raise self._mistake(
                number,
                f"aircraft {name} was created in line {self.created[name].line}",
                "give it a name of its own",
            )
        latitude, longitude = self._place(number, words[2:4])
        heading = self._number(number, words[4], "heading")
        height = self._height(number, words[5])
        speed = self._speed(number, words[6], height)
        self.created[name] = _Created(number, t, latitude, longitude, heading, height, speed)

    def _defwpt(self, number: int, t: float, words: list[str]) -> None:
        self.waypoints[words[0].upper()] = self._place(number, words[1:3])

    def _dest(self, number: int, t: float, words: list[str]) -> None:
        self._addwpt(number, t, words)

    def _addwpt(self, number: int, t: float, words: list[str]) -> None:
        own = self.created.get(words[0].upper())
        if own is None:
            hint = nearest(words[0].upper(), self.created)
            raise self._mistake(
                number, f"there is no aircraft {short(words[0])}; {hint}", "create it first with CRE"
            )
        if words[1].upper() in self.waypoints:
            place, rest = self.waypoints[words[1].upper()], words[2:]
        elif _is_number(words[1]):
            place, rest = self._place(number, words[1:3]), words[3:]
        else:
            what = (
                f"waypoint {short(words[1])} is not in this file, and BlueSky's navigation data are not here"
            )
            raise self._mistake(
                number, what, "give its latitude and longitude, or DEFWPT name,lat,lon before"
            )
        before = own.legs[-1] if own.legs else (0.0, 0.0, own.height, own.speed)
        height = self._height(number, rest[0]) if rest and rest[0] else before[2]
        speed = self._speed(number, rest[1], height) if len(rest) > 1 and rest[1] else before[3]
        if len(rest) > 2 and any(rest[2:]):
            raise self._mistake(
                number, f"{short(rest[2])} after the speed is not read", "list waypoints in order"
            )
        own.legs.append((*place, height, speed))

    def _place(self, number: int, words: list[str]) -> tuple[float, float]:
        latitude, longitude = (
            self._number(number, word, what, "write decimal degrees, south and west negative")
            for word, what in zip(words, ("latitude", "longitude"), strict=True)
        )
        if not (-90 <= latitude <= 90 and -180 <= longitude <= 360):
            what = f"latitude {latitude:g} and longitude {longitude:g} deg are not on the globe"
            raise self._mistake(number, what, "give -90 to 90 and -180 to 360")
        return latitude, longitude

    def _height(self, number: int, word: str) -> float:
        level = word.upper().removeprefix("FL")
        feet = self._number(number, level, "altitude", "write feet, or a flight level such as FL100")
        return feet * FT * (1.0 if level == word.upper() else 100.0)

    def _speed(self, number: int, word: str, height: float) -> float:
        mach = word.upper().startswith("M")
        told = self._number(
            number,
            word[1:] if mach else word,
            "speed",
            "write calibrated knots, or a Mach number such as M0.78",
        )
        told = told / 100.0 if mach and told >= 20 else told
        if mach or 0.1 < told < 1.0:
            if told < 2.0:
                return true_of_mach(told, height)
        elif 1.0 <= told < 600.0:
            return true_of_calibrated(told * KNOT, height)
        raise self._mistake(
            number, f"speed {word}", "write 1 to 600 calibrated knots, or a Mach number below 2"
        )

    def _number(self, number: int, word: str, what: str, remedy: str = "give a number") -> float:
        if not _is_number(word):
            raise self._mistake(number, f"{what} {short(word)!r} is not a number", remedy)
        return float(word)

    def _mistake(self, number: int, what: str, remedy: str) -> UserError:
        return UserError(Mistake(what, line=number, remedy=remedy), file=self.file)

    def encounter(self, name: str) -> Encounter:
        if len(self.created) < 2:
            said = f"creates {len(self.created)} aircraft; an encounter needs two or more CRE commands"
            raise UserError(said, file=self.file)
        all_ = list(self.created.items())
        begin = min(c.at for _, c in all_)
        own = all_[0][1]
        origin = Origin(own.latitude, own.longitude, own.height)
        made = tuple(_aircraft(n, c, begin, origin) for n, c in all_)
        notes = [
            f"command {what} left out, line {', '.join(map(str, lines))}"
            for what, lines in self.skipped.items()
        ]
        if back := [n for n, c in all_ if c.at > begin]:
            notes.append(f"created later, put back along their headings to the begin: {', '.join(back)}")
        end = None if self.end is None or self.end <= begin else self.end - begin
        shift = np.concatenate([[0.0], made[0].start])
        moved = [
            Aircraft(
                a.name,
                a.rows - shift,
                a.course,
                a.speed,
                0.0,
                None if a.legs is None else a.legs - [*shift[1:], 0.0],
            )
            for a in made
        ]
        return Encounter(name, tuple(moved), self.file, tuple(notes), end)


def _aircraft(name: str, c: _Created, begin: float, origin: Origin) -> Aircraft:
    def metres(latitude: float, longitude: float, height: float) -> np.ndarray:
        there = ecef(radians(latitude), radians(longitude), height)
        return origin.enu(there, np.array(height))

    course = pi / 2 - radians(c.heading)
    start = metres(c.latitude, c.longitude, c.height)
    back = (c.at - begin) * c.speed
    start = start - back * np.array([cos(course), sin(course), 0.0])
    legs = [[*metres(a, o, z), v] for a, o, z, v in c.legs]
    rows = np.array([[0.0, *start]])
    return Aircraft(name, rows, course, c.speed, 0.0, np.array(legs) if legs else None)


def _is_number(word: str) -> bool:
    try:
        return abs(float(word)) < 1e9
    except ValueError:
        return False
