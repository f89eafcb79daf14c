"""Writes a run as a Tacview recording (ACMI 2.2): attitudes, Ds, the critical pair, bookmarks.

Source  https://www.tacview.net/documentation/acmi/
"""

from __future__ import annotations

import zipfile
from collections.abc import Collection, Iterable, Iterator
from heapq import merge
from math import degrees
from pathlib import Path
from typing import Any

import pandas as pd

from aircraft.jsbsim.geodesy import Origin
from testbed.export import acmi_fences
from testbed.export.acmi_text import escaped
from testbed.export.events import Event, events
from testbed.records.run import Run
from testbed.records.verdict import Kind
from testbed.report import own_parts
from testbed.report.fences import bands
from testbed.report.tables import number

HEADER = "FileType=text/acmi/tacview\nFileVersion=2.2\n"
FIRST_ID = 0x100
# Tacview's words for them: flying, an intruder, in the pair of least h, in a pair closer than Ds.
CALM, INTRUDER, CRITICAL, LOST = "Blue", "Violet", "Orange", "Red"
# Recorded column -> property and factor.
PROPERTIES = {
    "airspeed_mps": ("TAS", 1.0),
    "alpha_rad": ("AOA", degrees(1.0)),
    "beta_rad": ("AOS", degrees(1.0)),
    "throttle": ("Throttle", 1.0),
    "load_factor": ("VerticalGForce", 1.0),
}


def write(run: Run, path: Path) -> list[Event]:
    """Write `run` to `path`, zipped if that ends in .zip.acmi; returns the events in it.

    Positions are the recorded ones about `aircraft.jsbsim.geodesy.Origin`, to 1e-5 m; times to 1e-6 s.
    """
    found = events(run)
    text = HEADER + "\n".join([*_globals(run), *_frames(run, found)]) + "\n"
    if path.name.endswith(".zip.acmi"):
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            # No date: equal runs give equal files.
            entry = zipfile.ZipInfo(path.name.removesuffix(".zip.acmi") + ".txt.acmi")
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, text.encode())
    else:
        path.write_text(text, encoding="utf-8", newline="\n")
    return found


def _globals(run: Run) -> Iterator[str]:
    s, origin = run.manifest["scenario"], Origin()
    title = f"{s['name']} on {own_parts.named(run, 'plant', s['plant'])}"
    own = own_parts.sentence(run.manifest)
    verdicts = [
        f"{v.id}: {v.status}" + ("" if v.value is None else f", {number(v.value)} {v.unit}".rstrip())
        for v in run.guarantees
        if v.kind in (Kind.GUARANTEE, Kind.OWN)
    ]
    said = {
        "ReferenceTime": "2026-01-01T00:00:00Z",
        "ReferenceLongitude": f"{origin.longitude_deg:.10g}",
        "ReferenceLatitude": f"{origin.latitude_deg:.10g}",
        "DataSource": f"cbf-jsbsim-testbed {run.manifest['versions']['cbf-jsbsim-testbed']}",
        "DataRecorder": "testbed export",
        "Title": title,
        "Comments": "\n".join([*(line for line in (s["description"], own) if line), *bands(s), *verdicts]),
    }
    yield from (f"0,{name}={escaped(value)}" for name, value in said.items())


def _frames(run: Run, found: list[Event]) -> Iterator[str]:
    """Lines of all frames in order of time: vehicles at recorded times, events at their own."""
    recorded = ((t, 0, lines) for t, lines in _recorded(run))
    marks = ((e.t_s, 1, [_bookmark(e)]) for e in found)
    last: float | None = None
    for t, _, lines in merge(recorded, marks, key=lambda frame: frame[:2]):
        if t != last:
            yield "#" + (f"{t:.6f}".rstrip("0").rstrip(".") or "0")
            last = t
        yield from lines


def _bookmark(e: Event) -> str:
    who = "-".join(str(v) for v in e.vehicles)
    text = (f"{who}: " if who else "") + e.text
    fields = [*(_id(v) for v in e.vehicles), escaped(text.replace("|", "/"))]
    return "0,Event=Bookmark|" + "|".join(fields)


def _id(vehicle: int) -> str:
    return f"{FIRST_ID + vehicle:x}"


def _recorded(run: Run) -> Iterator[tuple[float, list[str]]]:
    """Time and lines of each recorded instant."""
    s = run.manifest["scenario"]
    own = s.get("vehicle") or [{}] * s["vehicles"]
    listed = [v.get("airframe", s["airframes"][k % len(s["airframes"])]) for k, v in enumerate(own)]
    names = listed if s["plant"] == "jsbsim" else [s["plant"]]
    strangers = {k for k, v in enumerate(own, 1) if not v.get("filter", True)}
    if (plant := run.part("plant")) is not None:
        names = [plant]
    shown: dict[int, dict[str, str]] = {}
    worst = _worst_pairs(run.pairs, s["d_safe_m"], strangers)
    origin = Origin()
    still = list(acmi_fences.lines(s, origin))
    for t, group in run.vehicles.groupby("t_s", sort=True):
        lines, critical = still, worst.get(t, {})
        still = []
        for row in group.to_dict("records"):
            vehicle = int(row["vehicle"])
            if row.get("left", False):  # the object is removed, once
                if shown.pop(vehicle, None) is not None:
                    lines.append(f"-{_id(vehicle)}")
                continue
            now = _state(row, critical.get(vehicle), INTRUDER if vehicle in strangers else CALM)
            if vehicle not in shown:
                shown[vehicle] = {}
                now |= {
                    "Type": "Air+FixedWing",
                    "Name": escaped(Path(names[(vehicle - 1) % len(names)]).name),
                    "CallSign": f"{'intruder' if vehicle in strangers else 'vehicle'} {vehicle}",
                    "EngagementMode": "1",
                    "EngagementRange": f"{s['d_safe_m']:g}",
                }
            changed = {k: v for k, v in now.items() if shown[vehicle].get(k) != v}
            shown[vehicle] |= changed
            fields = [f"T={_place(row, origin)}", *(f"{k}={v}" for k, v in changed.items())]
            lines.append(f"{_id(vehicle)}," + ",".join(fields))
        yield float(t), lines


def _place(row: dict[str, Any], origin: Origin) -> str:
    """lon|lat|alt|roll|pitch|yaw|U|V|heading; roll and pitch stay empty for vehicles that have none."""
    latitude, longitude, altitude = origin.geodetic(row["x_m"], row["y_m"], row["z_m"])
    heading = f"{(90.0 - degrees(row.get('heading_rad', row['theta_rad']))) % 360.0:.5f}"
    roll, pitch = (f"{degrees(row[k]):.5f}" if k in row else "" for k in ("roll_rad", "pitch_rad"))
    place = f"{degrees(longitude) - origin.longitude_deg:.10f}|{degrees(latitude) - origin.latitude_deg:.10f}"
    flat = f"{row['x_m']:.5f}|{row['y_m']:.5f}"
    return f"{place}|{altitude:.5f}|{roll}|{pitch}|{heading}|{flat}|{heading}"


def _state(row: dict[str, Any], critical: tuple[int, float, bool] | None, calm: str = CALM) -> dict[str, str]:
    """The properties of a vehicle now; `critical` is its partner, their h, and whether Ds is lost."""
    state = {p: f"{row[c] * k:.4f}" for c, (p, k) in PROPERTIES.items() if c in row and row[c] == row[c]}
    if critical is None:
        return state | {"Color": calm, "LockedTargetMode": "0"}
    partner, h, lost = critical
    colour = LOST if lost else CRITICAL
    return state | {
        "Color": colour,
        "LockedTarget": _id(partner),
        "LockedTargetMode": "1",
        "h_m": f"{h:.4f}",
    }


def _worst_pairs(
    pairs: pd.DataFrame, d_safe: float, strangers: Collection[int] = ()
) -> dict[float, dict[int, tuple[int, float, bool]]]:
    """Time -> vehicle -> (partner, h [m], Ds lost), for the pair of least h at each recorded time.

    strangers  intruders, from 1; pairs of two are left out
    """
    if strangers:
        pairs = pairs[~(pairs.i.isin(strangers) & pairs.j.isin(strangers))].reset_index(drop=True)
    worst: dict[float, dict[int, tuple[int, float, bool]]] = {}
    pairs = pairs[pairs.h_m.notna()]  # of two that have not left
    if not len(pairs):
        return worst
    rows: Iterable[Any] = pairs.loc[pairs.groupby("t_s").h_m.idxmin()].itertuples(index=False)
    for r in rows:
        lost = bool(r.distance_m < d_safe)
        worst[r.t_s] = {int(r.i): (int(r.j), r.h_m, lost), int(r.j): (int(r.i), r.h_m, lost)}
    return worst
