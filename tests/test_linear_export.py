"""`testbed aircraft linear`: the linear model read back by scipy and python-control, and against flights."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest
from scipy.io import loadmat

from aircraft.airframe import load
from aircraft.airframes.schema import names
from aircraft.autopilots.linear_export import exported, write
from aircraft.autopilots.linear_model import linear_model
from aircraft.autopilots.margins import model_response, modes
from aircraft.autopilots.tuning import fly
from aircraft.equations.units import unit_of


@pytest.fixture(scope="module")
def content() -> dict[str, Any]:
    return exported(load("rascal"), 18.0)


def state_space(system: dict[str, Any]) -> control.StateSpace:
    """As a reader of the file makes it: names say the shapes that loadmat has squeezed."""
    labels = {kind: list(map(str, np.atleast_1d(system[kind]))) for kind in ("states", "inputs", "outputs")}
    n, m, p = (len(labels[kind]) for kind in ("states", "inputs", "outputs"))
    shapes = {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}
    matrices = (np.reshape(np.array(system[k], dtype=float), shape) for k, shape in shapes.items())
    return control.ss(*matrices, float(system["dt"]), **labels)


def read(path: Path) -> dict[str, Any]:
    if path.suffix == ".json":
        return dict(json.loads(path.read_text()))
    return {k: v for k, v in loadmat(path, simplify_cells=True).items() if not k.startswith("__")}


@pytest.mark.parametrize("ending", ["json", "mat"])
def test_what_is_written_is_read_back_with_margins_and_modes(
    content: dict[str, Any], ending: str, tmp_path: Path
) -> None:
    write(tmp_path / f"m.{ending}", content)
    again = read(tmp_path / f"m.{ending}")
    assert again.keys() == content.keys()
    assert again["fingerprint"] == load("rascal").fingerprint() and again["speed_mps"] == 18.0
    model = linear_model(load("rascal"), 18.0)
    for name, system in content.items():
        if not isinstance(system, dict) or "A" not in system:
            continue
        theirs = state_space(again[name])
        for k in "ABCD":
            assert np.array_equal(getattr(theirs, k), np.atleast_2d(system[k])), (name, k)
        for kind in ("states", "inputs", "outputs"):
            units = np.atleast_1d(again[name][kind.removesuffix("s") + "_units"])
            assert list(np.atleast_1d(again[name][kind])) == system[kind] and len(units) == len(system[kind])
            assert all(units)
    for loop in model.loops:
        w = np.geomspace(0.05, 300.0, 40)
        theirs_at = control.frequency_response(state_space(again[f"loop_{loop}"]), w).complex
        assert np.allclose(np.squeeze(theirs_at), model_response(model, loop, w).loop, rtol=1e-6)
    poles = state_space(again["bare_airframe"]).poles()
    for mode in modes(model.point):
        assert np.abs(poles - mode.eigenvalue).min() < 1e-6, mode.name
    write(tmp_path / f"n.{ending}", content)
    assert (tmp_path / f"m.{ending}").read_bytes() == (tmp_path / f"n.{ending}").read_bytes()


@pytest.mark.parametrize("name", [*names(), "x8@px4"])
def test_small_steps_of_the_closed_loop_are_those_of_a_flight(name: str) -> None:
    """Commands so small that nothing is limited, one way and the other: exported system and JSBSim agree."""
    airframe, v = load(name), 18.0
    closed = state_space(exported(airframe, v)["closed_loop"])
    sizes = {"v": 0.01, "omega": 1e-3, "zeta": 0.01}
    for k, (channel, size) in enumerate(sizes.items()):
        both = []
        for sign in (1.0, -1.0):
            command = [v, 0.0, 0.0]
            command[k] += sign * size
            both.append(fly(airframe, v, command, 4.0))
        flown = (getattr(both[0], channel) - getattr(both[1], channel)) / (2 * size)
        modelled = control.step_response(closed, both[0].t[-1], input=k, output=k, squeeze=True)
        # The flight's first sample is one period after the command.
        here = np.interp(both[0].t, modelled.time, modelled.outputs)
        # 0.028 in fact, in the first periods: equations that run every eighth one have not yet been engaged
        assert np.abs(here - flown).max() < 0.04, (channel, np.abs(here - flown).max())


def test_units_are_those_of_the_names_or_not_stated() -> None:
    closed = exported(load("x8@arduplane"), 18.0)["closed_loop"]
    units = dict(zip(closed["states"], closed["state_units"], strict=True))
    said = {"height": "m", "p": "rad/s", "p_rate": "rad/s2", "north_rate": "m/s2"}
    said |= {"ap_energy_rate_error": "not stated", "elevator_moved": "share of full deflection"}
    assert {name: units[name] for name in said} == said


def test_a_name_says_its_unit() -> None:
    said = {"turn_bandwidth_radps": "rad/s", "climb_integral_per_s2": "1/s2", "v_cmd_mps": "m/s"}
    said |= {"sent_v_mps_2": "m/s", "share_1": ""}
    said |= {"zeta_jerk_ref_mps3": "m/s3", "turn_damping": "", "elevator_norm": "share of full deflection"}
    assert {name: unit_of(name) for name in said} == said


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["x8", "--out", "x8.txt"], "name it FILE.mat or FILE.json"),
        (["x8", "--speed", "40"], "x8 is flown at 15 to 25 m/s, not at 40 m/s"),
        (["x8", "--speed", "nan"], "not at nan m/s"),
        (["albatross"], "no airframe albatross"),
        (["x8", "--out", "nowhere/x8.mat"], "cannot write nowhere/x8.mat"),
    ],
)
def test_a_mistake_is_one_line(arguments: list[str], said: str, refusal: Callable[..., str]) -> None:
    line = refusal("aircraft", "linear", *arguments).strip()
    assert re.search(re.escape(said), line) and len(line.splitlines()) == 1, line


def test_the_command_writes_a_file_once(
    tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "x8.mat"
    assert call("aircraft", "linear", "x8", "--out", out) == 0
    assert "closed_loop" in capsys.readouterr().out and read(out)["aircraft"] == "x8"
    assert call("aircraft", "linear", "x8", "--out", out) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert call("aircraft", "linear", "x8", "--out", out, "--overwrite") == 0
