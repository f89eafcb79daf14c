"""Flight logs of every format give back the lags of what flew; what cannot be read ends in one line."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from aircraft.autopilots.identification import model
from aircraft.kinematic import KinematicFleet, Lag
from aircraft.logs.events import events
from aircraft.logs.fitting import fit
from aircraft.logs.reading import read
from aircraft.logs.record import FlightLog, LogError, speed_over_ground
from filters.model import Command, State
from tests.log_writers import G, dataflash, quaternion, ulog

LAGS = (Lag(0.32, 0.16, -1.8, 3.5), Lag(0.217, 0.085, -0.6, 0.6), Lag(0.3, 0.1, -6.0, 10.0))
# Channel and value; each is held for 5.13 s, so that steps fall between the log's rows.
STEPS = ((0, 21.0), (1, 0.2), (0, 17.0), (2, 2.0), (1, -0.15), (2, -1.5), (1, 0.0), (2, 0.0), (0, 18.0)) * 2
WIND = np.array([3.0, -2.0])


@pytest.fixture(scope="module")
def flown() -> dict[str, np.ndarray]:
    """A lagged unicycle flying steps, every 5 ms: t, command (n, 3), v, course, omega, zeta."""
    fleet = KinematicFleet(1, 0.005, [LAGS])
    still = np.zeros((1, 3))
    fleet.reset(State.of([[0.0, 0.0, 1.0, 0.0]]), np.random.default_rng(1), still, np.array([18.0]))
    asked, rows = [18.0, 0.0, 0.0], []
    for k in range(round((5 + 5.13 * len(STEPS)) / 0.005)):
        t = 0.005 * k
        n = round((t - 5) / 5.13 - 0.5)
        if 0 <= n < len(STEPS) and t >= 5 + 5.13 * n:
            asked[STEPS[n][0]] = STEPS[n][1]
        rates = fleet.achieved()
        rows.append([t, *asked, rates.v[0], fleet.state().theta[0], rates.omega[0], rates.zeta[0]])
        fleet.step(Command.of([asked]), still, 1)
    found = np.array(rows)
    return {
        "t": found[:, 0],
        "command": found[:, 1:4],
        "v": found[:, 4],
        "course": found[:, 5],
        "omega": found[:, 6],
        "zeta": found[:, 7],
    }


def heading(flown: dict[str, np.ndarray], wind: np.ndarray) -> np.ndarray:
    """Of the velocity through the air, counter-clockwise from east."""
    air = np.stack([flown["v"] * np.cos(flown["course"]), flown["v"] * np.sin(flown["course"])], -1) - wind
    return np.arctan2(air[:, 1], air[:, 0])


def asked_of_an_autopilot(
    flown: dict[str, np.ndarray], wind: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bank to the right [rad], airspeed [m/s] and heading [rad] behind the commands of a flight in wind."""
    v, omega, zeta = flown["command"].T
    psi = heading(flown, wind)
    lateral = omega * flown["v"] / np.cos(flown["course"] - psi)
    east, north = v * np.cos(flown["course"]) - wind[0], v * np.sin(flown["course"]) - wind[1]
    return -np.arctan(lateral / G), np.sqrt(east**2 + north**2 + zeta**2), psi


def as_csv(flown: dict[str, np.ndarray], path: Path, degrees: bool = False) -> Path:
    k = slice(None, None, 4)
    v, omega, zeta = flown["command"][k].T
    scale = np.degrees(1.0) if degrees else 1.0
    pd.DataFrame(
        {
            "t_s": flown["t"][k],
            "v_command_mps": v,
            "omega_command_degps" if degrees else "omega_command_radps": omega * scale,
            "zeta_command_mps": zeta,
            "v_mps": flown["v"][k],
            "theta_deg" if degrees else "theta_rad": flown["course"][k] * scale,
            "zeta_mps": flown["zeta"][k],
        }
    ).to_csv(path, index=False)
    return path


def as_bin(flown: dict[str, np.ndarray], path: Path, **without: Any) -> Path:
    roll, airspeed, psi = asked_of_an_autopilot(flown, WIND)
    k = slice(2, None, 4)  # rows between the steps' instants
    us = np.round(flown["t"] * 1e6 + 7e6)[k]
    yaw = np.degrees(np.pi / 2 - psi[k]) % 360
    north, east = flown["v"][k] * np.sin(flown["course"][k]), flown["v"][k] * np.cos(flown["course"][k])
    zero, one = np.zeros(us.size), np.ones(us.size)
    messages = {
        "ATT": ("Qff", "TimeUS,DesRoll,Yaw", np.stack([us, np.degrees(roll[k]), yaw], -1)),
        "TECS": ("Qff", "TimeUS,spdem,dhdem", np.stack([us, airspeed[k], flown["command"][k, 2]], -1)),
        "XKF1": (
            "QBfff",
            "TimeUS,C,VN,VE,VD",
            # Another core's rows, far off, must not count.
            np.concatenate(
                [
                    np.stack([us, zero, north, east, -flown["zeta"][k]], -1),
                    np.stack([us, one, 0 * north, 0 * east, 0 * north], -1),
                ]
            ),
        ),
        "XKF2": ("QBff", "TimeUS,C,VWN,VWE", np.stack([us, zero, WIND[1] * one, WIND[0] * one], -1)[::50]),
    }
    dataflash(path, {name: message for name, message in messages.items() if name not in without})
    return path


def as_ulg(flown: dict[str, np.ndarray], path: Path, lateral: bool, **without: Any) -> Path:
    roll, airspeed, psi = asked_of_an_autopilot(flown, WIND)
    k = slice(2, None, 4)
    us = np.round(flown["t"] * 1e6 + 3e6)[k]
    q, asked = quaternion(0 * psi[k], np.pi / 2 - psi[k]), quaternion(roll[k], np.pi / 2 - psi[k])
    each = {f"q[{i}]": q[:, i] for i in range(4)}
    north, east = flown["v"][k] * np.sin(flown["course"][k]), flown["v"][k] * np.cos(flown["course"][k])
    topics: dict[str, Any] = {
        "vehicle_local_position": (
            {"vx": 1, "vy": 1, "vz": 1},
            {"timestamp": us, "vx": north, "vy": east, "vz": -flown["zeta"][k]},
        ),
        "vehicle_attitude": ({"q": 4}, {"timestamp": us} | each),
        "tecs_status": (
            {"true_airspeed_sp": 1, "height_rate_setpoint": 1},
            {
                "timestamp": us,
                "true_airspeed_sp": airspeed[k],
                "height_rate_setpoint": flown["command"][k, 2],
            },
        ),
        "wind": (
            {"windspeed_north": 1, "windspeed_east": 1},
            {
                "timestamp": us[::40],
                "windspeed_north": WIND[1] + 0 * us[::40],
                "windspeed_east": WIND[0] + 0 * us[::40],
            },
        ),
    }
    if lateral:
        topics["fixed_wing_lateral_status"] = (
            {"lateral_acceleration_setpoint": 1},
            {"timestamp": us, "lateral_acceleration_setpoint": G * np.tan(roll[k])},
        )
    else:
        topics["vehicle_attitude_setpoint"] = (
            {"q_d": 4},
            {"timestamp": us} | {f"q_d[{i}]": asked[:, i] for i in range(4)},
        )
    ulog(path, {name: topic for name, topic in topics.items() if name not in without})
    return path


WRITERS = {
    "csv": lambda flown, folder: as_csv(flown, folder / "a.csv"),
    "degrees": lambda flown, folder: as_csv(flown, folder / "a.csv", degrees=True),
    "ardupilot": lambda flown, folder: as_bin(flown, folder / "a.BIN"),
    "px4": lambda flown, folder: as_ulg(flown, folder / "a.ulg", lateral=True),
    "px4-roll": lambda flown, folder: as_ulg(flown, folder / "a.ulg", lateral=False),
}


@pytest.mark.parametrize("kind", WRITERS)
def test_a_log_of_each_format_gives_the_lags_of_what_flew(
    kind: str, flown: dict[str, np.ndarray], tmp_path: Path
) -> None:
    log = read(WRITERS[kind](flown, tmp_path))
    found = events(log)
    assert [e.channel for e in found] == [channel for channel, _ in STEPS]
    for channel, true in enumerate(LAGS):
        got = fit(log, found, channel)
        assert got is not None
        # 5 %, and the time between two rows of a log: 20 ms, on average half of it too late where held.
        assert got.time_constant_s + got.delay_s == pytest.approx(
            true.time_constant_s + true.delay_s, rel=0.05
        )
        assert got.time_constant_s == pytest.approx(true.time_constant_s, rel=0.05)
        assert got.delay_s == pytest.approx(true.delay_s, rel=0.05, abs=0.01)
        if channel == 1:
            assert got.reached == (True, True)
            # Steps of 0.15 and 0.2 rad/s hardly reach the limit.
            assert (got.rate_min, got.rate_max) == pytest.approx((-0.6, 0.6), rel=0.12)
        assert got.held_out is not None and got.held_out < 0.05


def test_commands_of_an_autopilot_are_recovered_in_wind(flown: dict[str, np.ndarray], tmp_path: Path) -> None:
    log = read(as_bin(flown, tmp_path / "a.bin"))
    at = np.searchsorted(flown["t"], log.t - 7.0)
    steady = np.abs(np.diff(flown["command"], axis=0)).sum(axis=1)
    near = np.convolve(steady > 0, np.ones(9), mode="same")[np.clip(at, 0, steady.size - 1)] > 0
    error = np.abs(log.command - flown["command"][np.clip(at, 0, len(flown["t"]) - 1)])[~near]
    # float32 rows of 20 ms, and interpolated courses: 0.02 m/s and 0.1 deg/s.
    assert np.nanmax(error[:, 0]) < 0.05
    assert np.nanmax(error[:, 1]) < np.radians(0.5)
    assert np.nanmax(error[:, 2]) < 1e-5
    assert np.allclose(log.wind, WIND, atol=1e-6)


def test_a_right_bank_is_a_clockwise_turn(flown: dict[str, np.ndarray], tmp_path: Path) -> None:
    log = read(as_bin(flown, tmp_path / "a.bin"))
    turning = np.abs(log.omega) > 0.1
    assert np.all(np.sign(log.command[turning, 1][100:200]) == np.sign(log.omega[turning][100:200]))


@pytest.mark.parametrize(
    "course, airspeed, climb, wind, ground",
    [
        (0.0, 20.0, 0.0, (0.0, 0.0), 20.0),
        (0.0, 20.0, 0.0, (5.0, 0.0), 25.0),
        (np.pi, 20.0, 0.0, (5.0, 0.0), 15.0),
        (0.0, 5.0, 0.0, (0.0, 3.0), 4.0),
        (0.0, 5.0, 3.0, (0.0, 0.0), 4.0),
    ],
)
def test_the_wind_triangle(
    course: float, airspeed: float, climb: float, wind: tuple[float, float], ground: float
) -> None:
    found = speed_over_ground(np.array([airspeed]), np.array([climb]), np.array([course]), np.array([wind]))
    assert found[0] == pytest.approx(ground)


def test_a_wind_too_strong_for_the_course_has_no_ground_speed() -> None:
    zero = np.zeros(1)
    assert np.isnan(speed_over_ground(zero + 5.0, zero, zero, np.array([[0.0, 6.0]])))[0]


def test_steps_that_another_command_disturbs_do_not_count(
    flown: dict[str, np.ndarray], tmp_path: Path
) -> None:
    log = read(as_csv(flown, tmp_path / "a.csv"))
    command = log.command.copy()
    first = events(log)[0]
    command[first.begin + 50 :, 2] += 1.0  # half a second after the first step
    disturbed = FlightLog(**{**vars_of(log), "command": command})
    assert first.begin not in [e.begin for e in events(disturbed)]


def test_a_gap_in_the_log_is_not_flown_over(flown: dict[str, np.ndarray], tmp_path: Path) -> None:
    path = as_csv(flown, tmp_path / "a.csv")
    table = pd.read_csv(path)
    table[(table.t_s < 6.0) | (table.t_s > 9.0)].to_csv(path, index=False)
    log = read(path)
    inside = (log.t > 7.01) & (log.t < 7.99)
    assert not log.known[inside].any()
    assert all(log.known[e.begin : e.end].all() for e in events(log))


def vars_of(log: FlightLog) -> dict[str, Any]:
    names = ("source", "kind", "sha256", "t", "command", "v", "course", "zeta", "wind", "notes")
    return {name: getattr(log, name) for name in names}


@pytest.mark.parametrize(
    "text, said",
    [
        ("", "is no CSV table"),
        ("t_s,v_mps\n0,1\n1,2\n", "there is no column v_command_mps"),
        ("{head}0,18,0,0,18,0,0\n1,18,0,x,18,0,0\n", "column zeta_command_mps, row 2: 'x' is no number"),
        ("{head}0,18,0,0,18,0,0\n0,18,0,0,18,0,0\n", "t_s does not increase"),
        ("{head}0,18,0,0,18,0,0\n", "has 1 usable row; two are needed"),
        ("{head}0,18,0,0,18,0,0\n0.5,18,0,0,18,0,0\n", "do not overlap in time for a second"),
        (
            "vehicle,{head}1,0,18,0,0,18,0,0\n2,0,18,0,0,18,0,0\n",
            "it holds 2 vehicles; choose one: --vehicle 1",
        ),
    ],
)
def test_a_table_that_is_no_log_is_one_line(text: str, said: str, tmp_path: Path) -> None:
    head = "t_s,v_command_mps,omega_command_radps,zeta_command_mps,v_mps,theta_rad,zeta_mps\n"
    path = tmp_path / "a.csv"
    path.write_text(text.replace("{head}", head))
    with pytest.raises(LogError, match=said) as caught:
        read(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["a.bin", "a.ulg"])
def test_bytes_that_are_no_log_are_one_line(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(b"no log at all" * 20)
    with pytest.raises(LogError):
        read(path)


def test_what_a_log_lacks_is_named(flown: dict[str, np.ndarray], tmp_path: Path) -> None:
    with pytest.raises(LogError, match="no TECS message"):
        read(as_bin(flown, tmp_path / "a.bin", TECS=True))
    with pytest.raises(LogError, match="there is no topic tecs_status"):
        read(as_ulg(flown, tmp_path / "a.ulg", lateral=True, tecs_status=True))
    log = read(as_bin(flown, tmp_path / "b.bin", XKF2=True))
    assert any("no wind in the log" in note for note in log.notes)


def test_an_aircraft_of_the_testbed_gives_its_identified_lags_and_flies_its_own_log(
    tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    from aircraft.airframe import copy, load

    flown = fly_x8()
    path = tmp_path / "x8.csv"
    flown.to_csv(path, index=False)
    copy("x8", tmp_path / "wing")
    wing, out = tmp_path / "wing", tmp_path / "out"
    assert call("aircraft", "log", path, "--airframe", wing, "--write", "--out", out, "--json") == 0
    said = json.loads(capsys.readouterr().out)
    # The same commands through the same aircraft: what is left is the start.
    for row, bound in zip(said["simulated_minus_flown"], (0.02, 0.005, 0.02), strict=True):
        assert row["rms"] < bound, row
    assert (out / "log.png").stat().st_size > 10_000
    known, written = load("x8").identified, load(wing).identified
    assert known is not None and written is not None
    assert written.log == "x8.csv" and written.log_sha256 == said["sha256"]
    for name, size in (("v", 2.0), ("omega", 0.2), ("zeta", 2.0)):
        a, b = getattr(known, name), getattr(written, name)
        # Other steps than those of `identify`; lag, delay and limits can stand in for each other. Rows of the
        # log are 50 ms apart.
        assert t63(b, size) == pytest.approx(t63(a, size), abs=0.05), name


def t63(channel: Any, size: float) -> float:
    """How long [s] a channel takes to 63 % of a step up from zero."""
    falls, rises = -(channel.rate_min or -np.inf), channel.rate_max or np.inf
    response = model(
        np.zeros(1), np.full(1, size), channel.time_constant_s, channel.delay_s, falls, rises, 800
    )
    return float(0.005 * np.argmax(response[0] >= 0.632 * size))


def fly_x8() -> pd.DataFrame:
    """An X8 at 20 Hz through two steps of each channel."""
    from aircraft.airframe import load
    from aircraft.jsbsim.fleet import JsbsimFleet

    fleet = JsbsimFleet([load("x8")])
    fleet.reset(State.of([[0.0, 0.0, 0.5, 0.0]]), np.random.default_rng(1), (0.0, 0.0, 0.0), 18.0)
    asked, rows = [18.0, 0.0, 0.0], []
    steps = ((0, 20.0), (1, 0.2), (1, 0.0), (2, 2.0), (2, 0.0), (0, 18.0), (1, -0.2), (2, -1.5))
    for k in range(round(20 * 4.0 * (len(steps) + 1))):
        n, first = divmod(k, 80)
        if n and not first:
            asked[steps[n - 1][0]] = steps[n - 1][1]
        rates = fleet.achieved()
        rows.append([k / 20, *asked, rates.v[0], fleet.state().theta[0], rates.zeta[0]])
        fleet.step(Command.of([asked]), np.zeros((1, 3)), 10)
    names = [
        "t_s",
        "v_command_mps",
        "omega_command_radps",
        "zeta_command_mps",
        "v_mps",
        "theta_rad",
        "zeta_mps",
    ]
    return pd.DataFrame(rows, columns=names)


def test_lags_of_another_log_are_named(flown: dict[str, np.ndarray], tmp_path: Path) -> None:
    from aircraft.airframe import copy, load
    from aircraft.autopilots.freshness import stale_lags
    from aircraft.logs.fitting import fit
    from aircraft.logs.writing import remade

    wing = copy("x8", tmp_path / "wing")
    path = as_csv(flown, wing / "flight.csv")
    log = read(path)
    found = events(log)
    fits = [f for k in range(3) if (f := fit(log, found, k)) is not None]
    remade(load(wing), log, path, fits).write()
    assert stale_lags(load(wing)) is None
    path.write_text(path.read_text().replace("18.0", "18.1", 1))
    why = stale_lags(load(wing))
    assert why is not None and "was made from another flight.csv; run: testbed aircraft log" in why
    with pytest.raises(LogError, match="no steps of v and zeta"):
        remade(load(wing), log, path, [fits[1]])


def test_mistakes_of_the_command_are_one_line(refusal: Callable[..., str], tmp_path: Path) -> None:
    assert "--write: say whose lags they are" in refusal("aircraft", "log", "a.bin", "--write")
    assert "flight log a.bin does not exist" in refusal("aircraft", "log", "a.bin")
    assert "logs that can be read end in .bin" in refusal("aircraft", "log", "a.tlog")
