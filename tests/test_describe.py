"""`aircraft describe`: the linear model against injection, modes, envelope, corners, and the page."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from aircraft.airframe import load
from aircraft.airframes.schema import Airframe, names
from aircraft.autopilots.linear_autopilot import evaluate as autopilot
from aircraft.autopilots.linear_autopilot import loops
from aircraft.autopilots.linear_model import linear_model
from aircraft.autopilots.margins import margins, model_margins, model_response, modes
from aircraft.autopilots.specification import evaluate, turbulence_rows
from aircraft.datasheets.datasheet import compare, geometry
from aircraft.datasheets.envelope import Box, corners, limits
from aircraft.equations.catalogue import of_airframe


@pytest.fixture(scope="module")
def x8() -> Airframe:
    return load("x8")


# -- the linear model


@pytest.mark.parametrize("name", names())
def test_the_equations_in_python_stand_still_where_jsbsim_trims(name: str) -> None:
    """One period of the autopilot's equations, evaluated here, moves no state at JSBSim's own trim."""
    airframe = load(name)
    memory = linear_model(airframe, 20.0).point.memory
    after = autopilot(airframe, {**memory, "dt": 0.005})
    for key in of_airframe(airframe).assigned():
        assert after[key] == pytest.approx(memory[key], abs=1e-7), key


@pytest.mark.slow
@pytest.mark.parametrize("name", names())
@pytest.mark.parametrize("v", [15.0, 25.0])
def test_the_linear_model_agrees_with_injection(name: str, v: float) -> None:
    airframe = load(name)
    for loop in loops(airframe):
        found = compare(airframe, v, loop)
        # 0.08 dB and 0.8 deg in fact; 3 dB and 17 deg with one period of delay more or less
        assert found.off_db < 1.0 and found.off_deg < 5.0, (loop, found.off_db, found.off_deg)
        assert found.model.phase_deg == pytest.approx(found.measured.phase_deg, abs=5.0)
        # beyond 30 dB of gain in hand, the equations that run every eighth period show: 41.4 and 40.2 dB
        least = 30.0
        assert min(found.model.gain_db, least) == pytest.approx(min(found.measured.gain_db, least), abs=1.0)
        assert found.model.disk == pytest.approx(found.measured.disk, abs=0.02)


def test_margins_by_python_control_are_those_of_the_formulas(x8: Airframe) -> None:
    model = linear_model(x8, 18.0)
    for loop in model.loops:
        theirs = model_margins(model, loop)
        ours = margins(model_response(model, loop, np.geomspace(0.01, 600, 1500)))
        assert ours.disk == pytest.approx(theirs.disk, rel=1e-3)
        assert ours.phase_deg == pytest.approx(theirs.phase_deg, abs=0.3)
        assert ours.gain_db == pytest.approx(theirs.gain_db, abs=0.2)


def test_the_modes_of_the_x8_are_those_of_an_independent_model(x8: Airframe) -> None:
    """Against values computed from the same coefficients by a separate implementation, 18 m/s."""
    found = {m.name: m for m in modes(linear_model(x8, 18.0).point)}
    assert found["roll"].eigenvalue.real == pytest.approx(-21.5, abs=0.1)
    assert found["short period"].frequency == pytest.approx(14.2, abs=0.1)
    assert found["short period"].damping == pytest.approx(0.51, abs=0.01)
    assert found["Dutch roll"].frequency == pytest.approx(4.9, abs=0.1)
    assert found["Dutch roll"].damping == pytest.approx(0.39, abs=0.01)
    assert found["phugoid"].frequency == pytest.approx(0.71, abs=0.01)
    assert found["spiral"].eigenvalue.real == pytest.approx(-0.18, abs=0.01)


def test_a_loop_with_more_gain_has_less_margin(x8: Airframe) -> None:
    eager = x8.with_gains({"turn.bank_feedback_per_s": 15.0})
    before, after = (model_margins(linear_model(a, 15.0), "aileron") for a in (x8, eager))
    assert after.disk < before.disk and after.gain_db < before.gain_db - 4


# -- the envelope


def test_the_envelope_obeys_energy_and_lift(x8: Airframe) -> None:
    at = limits(x8, 20.0, math.radians(13))
    assert math.degrees(at.bank) == pytest.approx(26.2, abs=0.1)
    # climbing takes the thrust that accelerates, v a / g; 3 % for the thrust's tilt and the changed lift
    assert at.climb == pytest.approx(20 * at.acceleration / 9.80665, rel=0.05)
    assert at.sink == pytest.approx(20 * at.deceleration / 9.80665, rel=0.06)
    # the wing's largest lift at the angle where the stall blend bends it, by the published coefficients
    assert at.stall_speed == pytest.approx(9.6, abs=0.3) and at.stall_margin == pytest.approx(2.08, abs=0.05)


def test_the_dive_is_the_corner_that_the_x8_cannot_hold(x8: Airframe) -> None:
    found = corners(x8, Box())
    bad = {(c.v, round(c.zeta, 1)) for c in found if not c.sustainable}
    assert bad == {(15.0, -3.9)} and len(found) == 8
    dive = next(c for c in found if not c.sustainable)
    # idle sink is 1.96 m/s: g (3.9 - 1.96) / 15 = 1.27 m/s^2, and half a metre a second in 0.39 s
    assert dive.lasts == pytest.approx(0.39, abs=0.01)
    assert dive.gives == "zeta" and dive.balances == pytest.approx(20.0, abs=0.5)


def test_the_geometry_is_that_of_the_sources(x8: Airframe) -> None:
    found = geometry(x8)
    for name, value in x8.stated.items():
        assert found[name] == pytest.approx(value, rel=2e-4), name
    assert found["principal_3_kgm2"] < found["principal_1_kgm2"] + found["principal_2_kgm2"]


# -- the specification


@pytest.mark.slow
def test_the_x8_meets_its_specification(x8: Airframe) -> None:
    missed = [(r.case, r.quantity, r.value, r.target) for r in evaluate(x8) if not r.met]
    assert missed == []


def test_in_turbulence_rates_are_tracked_and_no_surface_saturates(x8: Airframe) -> None:
    rows = {r.quantity: r.value for r in turbulence_rows(x8)}
    assert rows["surface_share"] < 1.0
    # 0.21 m/s in fact; the gusts themselves are 1.5 m/s rms
    assert 0.05 < rows["v_rms_mps"] < 0.5 and 0.02 < rows["zeta_rms_mps"] < 0.5


# -- the command


@pytest.mark.slow
def test_describe_prints_tables_and_writes_a_page_that_stands_alone(
    x8: Airframe,
    monkeypatch: pytest.MonkeyPatch,
    call: Callable[..., int],
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert call("aircraft", "describe", "x8", "--out", tmp_path / "s") == 0
    out = capsys.readouterr().out
    assert max(map(len, out.splitlines()[:-1])) <= 80
    for word in ("Corners", "Dutch roll", "15  13", "elevator", "moderate turbulence", "14.9 (14.8)"):
        assert word in out, word
    page = (tmp_path / "s" / "index.html").read_text()
    assert not re.findall(r'(?:src|href)="(?!data:)', page) and "http://" not in page.split("</style>")[1]
    assert page.count("data:image/svg+xml") == 6
    assert "every bound met" in page and "2 of 8 corners" in page
    data = json.loads((tmp_path / "s" / "datasheet.json").read_text())
    assert len(data["margins"]) == 15 and len(data["corners"]) == 8
    assert all(row["off_db"] < 1 and row["off_deg"] < 5 for row in data["margins"])
    assert data["geometry"]["jxz_kgm2"] == pytest.approx(-0.029, rel=1e-3)
    # the folder is taken: said before anything is flown
    assert call("aircraft", "describe", "x8", "--out", tmp_path / "s") == 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("damping = 1.145", "damping = -1.145"), "gains.turn.damping: must be zero or more"),
        (("damping = 1.145", "damping = nan"), "gains.turn.damping"),
        (("damping = 1.145\n", "\n"), "gains.turn.damping: the autopilot needs"),
    ],
)
def test_bad_gains_are_one_line(
    x8: Airframe,
    change: tuple[str, str],
    message: str,
    tmp_path: Path,
    call: Callable[..., int],
    capsys: pytest.CaptureFixture[str],
) -> None:
    text = (x8.folder / "airframe.toml").read_text()
    assert change[0] in text
    (tmp_path / "airframe.toml").write_text(text.replace(*change, 1))
    assert call("aircraft", "describe", tmp_path) == 2
    said = capsys.readouterr().err
    assert message in said and len(said.strip().splitlines()) == 1


def test_bad_folders_are_one_line(call: Callable[..., int], capsys: pytest.CaptureFixture[str]) -> None:
    for command in (("describe", "albatross"), ("check", "albatross")):
        assert call("aircraft", *command) == 2
        said = capsys.readouterr().err
        assert "albatross" in said and len(said.strip().splitlines()) == 1


def test_check_says_clean_or_names_the_finding(
    x8: Airframe, call: Callable[..., int], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert call("aircraft", "check", x8.folder) == 0
    assert "is clean" in capsys.readouterr().out
    assert call("aircraft", "check", tmp_path, "--json") == 1
    assert json.loads(capsys.readouterr().out)[0]["file"] == "airframe.toml"
