"""Encounters of other programs' files: geometry comes back, units are checked, wrong files are refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from math import cos, degrees, hypot, pi, radians, sin, sqrt
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import testbed
from aircraft.jsbsim.geodesy import Origin
from testbed.encounters.airspeed import true_of_calibrated, true_of_mach
from testbed.encounters.encounter import Encounter
from testbed.encounters.importing import read
from testbed.encounters.scenarios import Choices, extremes, made
from testbed.errors import UserError
from testbed.scenario.scenario import load

EXAMPLES = Path(__file__).parent.parent / "docs/guide/examples/encounters"
FORMATS = {"daa": "crossing.daa", "scn": "converging.scn", "table": "trajectories.txt", "csv": "head-on.csv"}
KNOT, FT = 1852 / 3600, 0.3048
DAA = "NAME lat lon alt trk gs vs time\n[none] [deg] [deg] [ft] [deg] [knot] [fpm] [s]\n"
CSV = "vehicle,t_s,x_m,y_m,z_m\n"
TWO = "1,0,0,0,0\n1,1,20,0,0\n2,0,400,0,0\n2,1,380,0,0\n"


def read_text(tmp_path: Path, text: str, format_: str) -> list[Encounter]:
    file = tmp_path / f"e.{format_}"
    file.write_text(text)
    return read([file], format_)


@pytest.mark.parametrize("format_", FORMATS)
def test_the_example_of_each_format_becomes_a_scenario(format_: str) -> None:
    found = read([EXAMPLES / FORMATS[format_]], format_)
    assert len(found) == (2 if format_ == "table" else 1)
    for e in found:
        s = made(e, Choices()).scenario()
        assert s.vehicles == len(e.aircraft) == 2
        assert [v.filter for v in s.vehicle] == [True, False]
        assert s.vehicle[0].speed_mps == pytest.approx(20.0, abs=1e-6)


places = st.tuples(*[st.floats(-8000, 8000)] * 2, st.floats(-300, 2000))


@settings(max_examples=40, deadline=None)
@given(
    latitude=st.floats(-70, 70),
    starts=st.lists(places, min_size=2, max_size=3),
    tracks=st.lists(st.floats(0, 359.9), min_size=3, max_size=3),
    speeds=st.lists(st.floats(20, 250), min_size=3, max_size=3),
    begin=st.floats(-10, 1e5),
)
def test_a_daa_file_gives_back_its_geometry(
    tmp_path_factory: pytest.TempPathFactory,
    latitude: float,
    starts: list[tuple[float, float, float]],
    tracks: list[float],
    speeds: list[float],
    begin: float,
) -> None:
    """Written with places from an own origin, read, made a scenario and scaled back: 1 mm and 1 ms."""
    origin = Origin(latitude, 11.0, 1000.0)
    times = np.arange(0.0, 12.0, 1.5)
    lines, true = [], []
    for k, (x, y, z) in enumerate(starts):
        course = pi / 2 - radians(tracks[k])
        rows = [[x + speeds[k] * cos(course) * t, y + speeds[k] * sin(course) * t, z] for t in times]
        true.append(np.array(rows))
        for t, row in zip(times, rows, strict=True):
            a, b, height = origin.geodetic(*row)
            said = f"{degrees(a):.12f}, {degrees(b):.12f}, {height / FT:.6f}, {tracks[k]:.6f}"
            lines.append(f"AC{k}, {said}, {speeds[k] / KNOT:.6f}, 0.0, {begin + t:.6f}")
    file = tmp_path_factory.mktemp("daa") / "e.daa"
    file.write_text(DAA + "\n".join(lines) + "\n")
    (e,) = read([file], "daa")
    one = made(e, Choices(others="filter"))
    s = one.scenario()
    k = 20.0 / speeds[0]
    # The file's origin is the own aircraft's place: its axes are turned against ours by less than 1e-3 rad
    # over 8 km, and distances are what both planes agree on to a millimetre over this range.
    for number, own in enumerate(true):
        rows = np.array(one.tracks[f"tracks/e-{number + 1}.csv"])
        back = rows / [k, k * k, k * k, k * k]
        assert back[:, 0] == pytest.approx(times, abs=1e-3)
        assert np.diff(back[:, 3]) == pytest.approx(np.diff(own[:, 2]), abs=1e-3)
        assert back[0, 1:] == pytest.approx(
            np.array([getattr(s.vehicle[number], c) for c in ("x_m", "y_m", "z_m")]) / (k * k), abs=1e-3
        )
    # About the own origin exactly: the same places through the other direction of the projection.
    first = e.aircraft[0]
    there = Origin(*_at(origin, true[0][0]))
    for a, own in zip(e.aircraft, true, strict=True):
        for row, place in zip(a.rows, own, strict=True):
            latitude_, longitude_, height = there.geodetic(*(row[1:] - first.rows[0, 1:]))
            a_, b_, c_ = origin.geodetic(*place)
            metres = hypot((latitude_ - a_) * 6.4e6, (longitude_ - b_) * 6.4e6 * cos(a_))
            assert metres < 1e-3 and abs(height - c_) < 1e-3


def _at(origin: Origin, place: np.ndarray) -> tuple[float, float, float]:
    latitude, longitude, height = origin.geodetic(*place)
    return degrees(latitude), degrees(longitude), height


@pytest.mark.parametrize(
    ("format_", "unit"), [("csv", "m"), ("csv", "km"), ("table", "ft"), ("table", "nmi")]
)
def test_a_table_gives_back_its_geometry_in_any_unit(tmp_path: Path, format_: str, unit: str) -> None:
    metres = {"m": 1.0, "km": 1000.0, "ft": FT, "nmi": 1852.0}[unit]
    names = ("x", "y", "z") if format_ == "csv" else ("east", "north", "alt")
    t = np.cumsum(np.random.default_rng(1).uniform(0.3, 2.0, 30))
    true = [
        np.stack([40 * t, 300 * np.sin(t / 9), 3 * t], axis=-1),
        np.stack([2000 - 30 * t, 50 + 2 * t, 40 - t], axis=-1),
    ]
    lines = [",".join(["vehicle", "t_min", *(f"{name}_{unit}" for name in names)])]
    for k, rows in enumerate(true):
        lines += [",".join(map(str, (k, at / 60, *(row / metres)))) for at, row in zip(t, rows, strict=True)]
    (e,) = read_text(tmp_path, "\n".join(lines), format_)
    one = made(e, Choices(others="filter"))
    k_ = 20 / e.aircraft[0].speed
    for number, rows in enumerate(true, 1):
        back = one.tracks[f"tracks/e-{number}.csv"] / [k_, k_**2, k_**2, k_**2]
        assert back[:, 0] == pytest.approx(t - t[0], abs=1e-3)
        assert back[:, 1:] == pytest.approx(rows - true[0][0], abs=1e-3)


def test_an_intruder_that_keeps_its_course_keeps_its_climb_rate() -> None:
    (e,) = read([EXAMPLES / "crossing.daa"], "daa")
    s = made(e, Choices(others="keep-course")).scenario()
    guidance = s.vehicle[1].guidance
    assert guidance is not None and guidance.kind == "track"
    (_, *first), (last, *end) = guidance.rows  # type: ignore[union-attr]
    k = 20 / (100 * KNOT)
    climb = 300 * FT / 60 * k
    assert np.array(end) - first == pytest.approx(np.array([0, 90 * KNOT * k, climb]) * last, abs=1e-3)


def test_the_importer_measures_as_a_sphere_does_over_a_short_way(tmp_path: Path) -> None:
    """One minute of latitude is 1,852 m and 0.2 % at 45 degrees, a minute of longitude cos(45 deg) of it."""
    text = DAA + "".join(
        f"{n}, {45 + north / 60:.9f}, {east / 60:.9f}, 1000, {trk}, 100, 0, {t}\n"
        for n, east, north, trk in (("A", 0.0, 0.0, 0), ("B", 1.0, 1.0, 0))
        for t in (0,)
    )
    (e,) = read_text(tmp_path, text, "daa")
    east, north, up = e.aircraft[1].start
    assert north == pytest.approx(1852.0, rel=3e-3) and east == pytest.approx(1852 / sqrt(2), rel=4e-3)
    assert up == pytest.approx(0.0, abs=1e-6)
    assert e.aircraft[0].course == pytest.approx(pi / 2)  # track 0 is north
    assert e.aircraft[0].speed == pytest.approx(100 * KNOT)


def test_cartesian_daa_columns_have_nautical_miles_where_no_unit_is_said(tmp_path: Path) -> None:
    text = "NAME sx sy sz vx vy vz time\nA 0 0 1000 100 0 0 0\nB 1 -1 1100 0 100 60 0\n"
    (e,) = read_text(tmp_path, text, "daa")
    assert e.aircraft[1].start == pytest.approx([1852.0, -1852.0, 100 * FT])
    assert e.aircraft[1].velocity == pytest.approx([0.0, 100 * KNOT, FT], abs=1e-12)


def test_daa_comments_parameters_repeated_names_and_clock_times_are_read(tmp_path: Path) -> None:
    text = (
        "# Wind To: none\nfiletype = history\n\nName, lat, lon, alt, trk, gs, vs, clock\n"
        'A, 45, 8, 1000, 90, 0, 0, 00:01:00.5\n", 45, 8, 1000, 90, 0, 0, 0:01:01.5\n'
        "B, 45, 9, 1000, 90, 10, 0, 00:01:00.5\n"
    )
    (e,) = read_text(tmp_path, text, "daa")
    assert [a.name for a in e.aircraft] == ["A", "B"]
    assert e.aircraft[0].rows[:, 0] == pytest.approx([0.0, 1.0])


def test_an_encounter_begins_when_all_aircraft_are_there(tmp_path: Path) -> None:
    text = CSV + "1,0,0,0,0\n1,2,40,0,0\n1,4,80,0,0\n2,3,400,0,0\n2,4,380,0,0\n"
    (e,) = read_text(tmp_path, text, "csv")
    assert e.aircraft[0].rows == pytest.approx(np.array([[0, 0, 0, 0], [1, 20, 0, 0]]))
    assert e.aircraft[1].start == pytest.approx([340, 0, 0])
    assert e.notes == ("rows before 3 s are left out: until then some aircraft are not there",)


def test_a_trajectory_table_may_have_one_aircraft_a_file(tmp_path: Path) -> None:
    for name, east in (("own", 0), ("other", 3000)):
        rows = "\n".join(f"{t},{east},{100 * t},2000" for t in range(3))
        (tmp_path / f"{name}.csv").write_text(f"time_s,yEast_ft,xNorth_ft,alt_ft_msl\n{rows}\n")
    (e,) = read([tmp_path / "own.csv", tmp_path / "other.csv"], "table")
    assert e.aircraft[1].start == pytest.approx([3000 * FT, 0, 0])
    assert e.aircraft[1].velocity == pytest.approx([0, 100 * FT, 0], abs=1e-9)


def test_one_file_may_have_many_encounters(tmp_path: Path) -> None:
    rows = "".join(
        f"{k},{a},{t},{400 * (a == 2) + 20 * t * (1 - 2 * (a == 2)) + 0.001 * k},0\n"
        for k in range(3) for a in (1, 2) for t in (0, 1, 2)
    )  # fmt: skip
    found = read_text(tmp_path, "encounter,vehicle,t_s,x_m,y_m\n" + rows, "csv")
    assert [e.name for e in found] == ["e-0", "e-1", "e-2"]
    assert found[2].aircraft[1].start == pytest.approx([400, 0, 0])


def test_bluesky_aircraft_start_where_they_are_created_and_fly_their_legs(tmp_path: Path) -> None:
    (e,) = read([EXAMPLES / "converging.scn"], "scn")
    own, other = e.aircraft
    assert own.speed == pytest.approx(true_of_calibrated(95 * KNOT, 3000 * FT))
    assert own.legs is not None and other.legs is not None
    assert other.course == pytest.approx(pi / 4) and len(other.legs) == 2
    assert other.start[1] == pytest.approx(-0.0197 * 111_170, rel=2e-3)  # a degree of latitude at 47 deg
    assert other.legs[0, 2] == pytest.approx(0.0) and other.legs[1, 2] == pytest.approx(200 * FT, abs=1e-6)
    assert other.legs[1, 3] == pytest.approx(true_of_calibrated(90 * KNOT, 3200 * FT))
    assert e.end == 150.0 and e.duration == 150.0
    s = made(e, Choices()).scenario()
    assert s.vehicle[1].guidance is not None and s.vehicle[1].guidance.kind == "waypoints"
    kept = made(e, Choices(others="keep-course")).scenario()
    assert kept.vehicle[1].guidance is not None and kept.vehicle[1].guidance.kind == "hold"


def test_an_aircraft_created_later_is_put_back_along_its_heading(tmp_path: Path) -> None:
    text = "0:00:00>CRE A,C1,0,0,90,1000,M0.2\n0:00:10>CRE B,C1,0,0.1,270,1000,M0.2\n"
    (e,) = read_text(tmp_path, text, "scn")
    flown = 10 * true_of_mach(0.2, 1000 * FT)
    assert e.aircraft[1].start[0] == pytest.approx(0.1 * pi / 180 * 6378137 + flown, rel=1e-4)
    assert "put back along their headings to the begin: B" in e.notes[0]


def test_unknown_commands_are_named_and_may_be_left_out(tmp_path: Path) -> None:
    file = tmp_path / "e.scn"
    file.write_text(
        "# two\n0:00:00>CRE A,C1,0,0,90,1000,100;PAN 0,0\n"
        "0:00:00>CRE B,C1,0,1,270,FL10,100\n0:00:05>B HDG 180\n"
    )
    with pytest.raises(UserError, match=r"e.scn: command HDG is not read.*give --skip-unknown \(line 4\)"):
        read([file], "scn")
    (e,) = read([file], "scn", skip_unknown=True)
    assert e.notes == ("command HDG left out, line 4",)


def test_calibrated_airspeeds_and_mach_numbers_are_those_of_the_tables() -> None:
    assert true_of_calibrated(120.0, 0.0) == pytest.approx(120.0, rel=1e-9)
    # FL350: the speed of sound is 576.4 kt. FL100: 250 kt calibrated are Mach 0.452, 288.6 kt.
    assert true_of_mach(0.78, 35_000 * FT) / KNOT == pytest.approx(0.78 * 576.4, rel=1e-3)
    assert true_of_calibrated(250 * KNOT, 10_000 * FT) / KNOT == pytest.approx(288.6, rel=2e-3)
    # Above the tropopause the temperature stays.
    assert true_of_mach(0.8, 12_000.0) == pytest.approx(0.8 * 295.07, rel=1e-4)


def test_scaling_keeps_the_bank_and_says_so() -> None:
    (e,) = read([EXAMPLES / "crossing.daa"], "daa")
    one = made(e, Choices(speed=25.0))
    k = 25.0 / (100 * KNOT)
    assert f"scaled by v/v0 = {1 / k:.6g} to 25 m/s" in one.data["description"]
    other = one.data["vehicle"][1]
    assert other["speed_mps"] == pytest.approx(90 * KNOT * k, abs=1e-5)
    assert other["x_m"] == pytest.approx(e.aircraft[1].start[0] * k * k, abs=1e-5)
    kept = made(e, Choices(speed=None)).scenario()
    grown = 100 * KNOT / 20
    assert kept.vehicle[1].x_m == pytest.approx(e.aircraft[1].start[0], abs=1e-5)
    assert kept.d_safe_m == pytest.approx(5 * grown**2) and kept.limits.v_max_mps == pytest.approx(25 * grown)
    assert kept.barrier.omega_degps == pytest.approx(11.7 / grown)  # type: ignore[union-attr]
    # v omega, the acceleration across, is the paper's.
    assert kept.barrier.v_mps * kept.barrier.omega_degps == pytest.approx(16 * 11.7, rel=1e-6)  # type: ignore[union-attr]


def test_limits_are_widened_for_what_a_track_flies() -> None:
    t = np.arange(0.0, 20.5, 0.5)
    angle = 0.5 * t
    rows = np.stack([t, 60 * np.sin(angle), 60 - 60 * np.cos(angle), 5 * t], axis=-1)
    slow, fast, turn, climb = extremes(rows)
    assert (slow, fast) == pytest.approx((30, 30), rel=0.03)  # rows half a second apart
    assert turn == pytest.approx(0.5, rel=0.05) and climb == pytest.approx(5.0)
    from testbed.encounters.encounter import Aircraft

    own = Aircraft("own", np.array([[0, -900, 0, 0], [20, -500, 0, 0.0]]), 0.0, 20.0)
    one = made(Encounter("e", (own, Aircraft("other", rows, 0.0, 30.0)), "e"), Choices())
    wider = one.data["vehicle"][1]["limits"]
    assert wider["v_max_mps"] > 30 and wider["omega_max_degps"] > degrees(0.5) and wider["zeta_max_mps"] > 5
    assert "limits" not in one.data["vehicle"][0]
    assert "limits widened for what vehicle 2 flies" in one.data["description"]


def test_an_imported_encounter_is_flown_as_recorded(tmp_path: Path, call: Callable[..., int]) -> None:
    """Without a filter both aircraft fly their tracks: the least distance is the one that the file has."""
    out = tmp_path / "out"
    assert call("encounters", "import", EXAMPLES / "crossing.daa", "--format", "daa", "--out", out) == 0
    s = load(out / "crossing.toml", ["filter.kind=none"])
    run = testbed.run(s)
    assert all(error["largest_m"] < 0.01 for error in run.manifest["track_error"])
    # Own east at 100 kt, other north at 90 kt and 300 ft/min: 60 m ahead and below at 30 s.
    k = 20 / (100 * KNOT)
    t = np.arange(0, 60, 0.01)
    apart = np.array([100 * KNOT * (30 - t) - 60, 90 * KNOT * (t - 30), -60 + 300 * FT / 60 * t])
    least = np.linalg.norm(apart, axis=0).min() * k * k
    assert run.guarantee("separation-intruders")["value"] == pytest.approx(least, abs=0.02)
    listed = json.loads((out / "encounters.json").read_text())
    assert listed["encounters"][0] | {"source": ""} == {
        "file": "crossing.toml", "source": "", "aircraft": ["OWN", "OTHER"], "notes": []
    }  # fmt: skip


CRE = "0:00:00>CRE A,C1,0,0,90,1000,100\n0:00:00>CRE B,C1,0,1,270,1000,100\n"
WRONG = [
    ("daa", "", r"is empty"),
    ("daa", "NAME lat lon trk gs vs time\n", r"has no column alt;.*\(line 1\)"),
    (
        "daa",
        DAA.replace("[ft]", "[knot]"),
        r"column alt is a length, and \[knot\] is a unit of speed.*\(line 2\)",
    ),
    ("daa", DAA.replace("[ft]", "[furlong]"), r"the unit 'furlong', which is not known.*\(line 2\)"),
    ("daa", DAA.replace("[ft] ", ""), r"7 units for 8 columns.*\(line 2\)"),
    ("daa", DAA + "A 0 0 1000 90 100 0\n", r"7 values for 8 columns; complete the line \(line 3\)"),
    ("daa", DAA + "A 0 0 high 90 100 0 0\n", r"column alt has 'high', not a number.*\(line 3\)"),
    ("daa", DAA + "A 0 0 nan 90 100 0 0\n", r"column alt has nan, not a finite number.*\(line 3\)"),
    ("daa", DAA + "A 95 0 0 90 100 0 0\nB 0 0 0 90 100 0 0\n", r"A: latitude 95 deg.*\(line 3\)"),
    ("daa", DAA + "A 0 0 0 90 100 0 0\n", r"has one aircraft, A; an encounter needs two or more \(line 3\)"),
    ("daa", DAA, r"has no rows"),
    ("daa", DAA + "A 0 0 0 90 -5 0 0\nB 0 1 0 90 5 0 0\n", r"A: ground speed -2.57222 m/s.*\(line 3\)"),
    (
        "csv",
        CSV + TWO.replace("2,1,380", "2,0,380"),
        r"2: the time goes from 0 s to 0 s; times must grow \(line 5\)",
    ),
    ("csv", CSV + TWO.replace("2,1,", "2,1.x,"), r"column t has '1.x', not a number.*\(line 5\)"),
    ("csv", CSV + "1,0,0,0,0\n1,1,20,0,0\n2,5,1,0,0\n2,6,2,0,0\n", r"1: its last row is at 1 s.*\(line 3\)"),
    ("csv", "vehicle,t_s,x_m\n", r"has no column y;.*\(line 1\)"),
    (
        "csv",
        "vehicle,t_s,x,y_m\n1,0,0,0\n",
        r"column x has no unit; write x_ft, or a line of units.*\(line 1\)",
    ),
    ("csv", "vehicle,t_s,x_m,y_m,east_m\n", r"columns x and east are both the x; leave one of them out"),
    ("csv", CSV + "1,0,0,0,0\n2,0,400,0,0\n", r"1: one row, and no speed.*\(line 2\)"),
    (
        "csv",
        "vehicle,t_s,x_m,y_m,v_mps,course_deg\n1,0,0,0,40,0\n1,1,20,0,40,0\n2,0,400,0,20,180\n",
        r"1: its positions move 0.5 times as fast as its ground speed says; check the units.*\(line 2\)",
    ),
    (
        "csv",
        "vehicle,t_s,x_m,y_m,v_mps,course_deg\n1,0,0,0,20,90\n1,1,20,0,20,90\n2,0,400,0,20,180\n",
        r"1: its positions move 90 deg off the direction that it states.*\(line 2\)",
    ),
    (
        "table",
        "time_s,x_ft,y_ft,z_ft\n0,0,0,0\n",
        r"no column east or lat; say which column is east.*\(line 1\)",
    ),
    ("table", "encounter,time_s,east_m,north_m,alt_m\n1,0,0,0,0\n", r"has no column aircraft"),
    (
        "scn",
        "CRE A,C1,0,0,90,1000,100\n",
        r"is no command with its time; a line is HH:MM:SS.hh>COMMAND.*\(line 1\)",
    ),
    ("scn", "0:00:00>CRE A,C1,0,0,90,1000\n", r"CRE has 6 values; write CRE acid,type,lat.*\(line 1\)"),
    ("scn", "0:00:00>CRE A,C1,N52'10,0,90,1000,100\n", r"latitude \"N52'10\" is not a number; write decimal"),
    (
        "scn",
        "0:00:00>CRE A,C1,0,0,90,high,100\n",
        r"altitude 'HIGH' is not a number; write feet, or a flight level",
    ),
    ("scn", "0:00:00>CRE A,C1,0,0,90,1000,900\n", r"speed 900; write 1 to 600 calibrated knots"),
    ("scn", "0:00:00>CRE A,C1,91,0,90,1000,100\n", r"not on the globe"),
    ("scn", CRE.split("\n")[0] + "\n", r"creates 1 aircraft; an encounter needs two or more"),
    ("scn", CRE + "0:00:00>CRE A,C1,0,0,90,1000,100\n", r"aircraft A was created in line 1.*\(line 3\)"),
    ("scn", CRE + "0:00:00>ADDWPT C,0,1\n", r"there is no aircraft C;.*\(line 3\)"),
    ("scn", CRE + "0:00:00>ADDWPT A,SPY,FL50\n", r"waypoint SPY is not in this file.*\(line 3\)"),
    ("scn", CRE + "0:00:00>A VNAV OFF\n", r"command VNAV OFF is not read.*\(line 3\)"),
]


@pytest.mark.parametrize(("format_", "text", "said"), WRONG, ids=range(len(WRONG)))
def test_a_wrong_file_is_refused_in_one_line_with_its_line(
    tmp_path: Path, format_: str, text: str, said: str
) -> None:
    with pytest.raises(UserError, match=said) as error:
        read_text(tmp_path, text, format_)
    assert "\n" not in str(error.value) and f"e.{format_}" in str(error.value)


def test_options_that_no_encounter_has_are_refused(refusal: Callable[..., str]) -> None:
    file = EXAMPLES / "head-on.csv"
    where = ("--out", "out")
    assert "--format xml: give one of daa" in refusal("encounters", "import", file, "--format", "xml", *where)
    said = refusal("encounters", "import", file, "--format", "csv", "--others", "evade", *where)
    assert "--others evade: give one of track, keep-course, filter" in said
    said = refusal("encounters", "import", file, "--format", "csv", "--speed", "0", *where)
    assert "--speed 0: give 0.1 to 900 m/s" in said
    assert "does not exist" in refusal("encounters", "import", "no.csv", "--format", "csv", *where)
    assert "has no file that ends in .daa" in refusal("encounters", "import", ".", "--format", "daa", *where)


@settings(max_examples=150, deadline=None)
@given(data=st.data(), format_=st.sampled_from(sorted(FORMATS)))
def test_a_damaged_file_is_read_or_refused_and_never_a_crash(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject, format_: str
) -> None:
    """Letters of the example files replaced, lines lost, doubled or cut."""
    lines = (EXAMPLES / FORMATS[format_]).read_text().split("\n")[:24]
    for _ in range(data.draw(st.integers(1, 3))):
        k = data.draw(st.integers(0, len(lines) - 1))
        line = lines[k]
        at = data.draw(st.integers(0, max(0, len(line))))
        how = data.draw(st.sampled_from(["letter", "cut", "lost", "twice"]))
        if how == "letter":
            new = data.draw(
                st.sampled_from(["", "-", "x", "9e9", " ", ",", ":", ";", "[", "nan", '"', "\t", "#", "é"])
            )
            lines[k] = line[:at] + new + line[at + 1 :]
        elif how == "cut":
            lines[k] = line[:at]
        elif how == "twice":
            lines.insert(k, line)
        elif len(lines) > 1:
            del lines[k]
    file = tmp_path_factory.mktemp("damaged") / f"e.{format_}"
    file.write_text("\n".join(lines), encoding="utf-8")
    try:
        for e in read([file], format_):
            made(e, Choices()).scenario()
    except UserError as error:
        assert "\n" not in str(error)


def test_a_campaign_flies_an_imported_encounter(tmp_path: Path, call: Callable[..., int]) -> None:
    out = tmp_path / "out"
    assert call("encounters", "import", EXAMPLES / "head-on.csv", "--format", "csv", "--out", out) == 0
    file = tmp_path / "c.toml"
    said = 'guarantee = "separation-intruders"\nfilters = ["centralised", "none"]\n'
    file.write_text(f'name = "c"\nscenario = "out/head-on.toml"\nseeds = 1\n{said}')
    assert call("campaign", "check", file) == 0
