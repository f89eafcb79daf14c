"""`testbed aircraft describe a b --overlay`: loops, margins and steps of several airframes."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from aircraft.airframe import load
from aircraft.airframes.schema import Airframe
from aircraft.autopilots import gains
from aircraft.autopilots.linear_model import linear_model
from aircraft.autopilots.margins import margins, model_margins, model_response, response
from aircraft.datasheets.overlay import Compared, compare, rows
from testbed.report import overlay_figures
from testbed.report.page import page, part
from testbed.report.style import drawing
from testbed.studies.pages import KINDS


@pytest.fixture(scope="module")
def x8() -> Airframe:
    return load("x8")


@pytest.fixture(scope="module")
def found(x8: Airframe, tmp_path_factory: pytest.TempPathFactory) -> list[Compared]:
    """The X8, the X8 with roll feedback that destabilises it, and a slower one."""
    folder = tmp_path_factory.mktemp("gains")
    gains.write(folder / "wild.toml", "x8", {"turn.bank_feedback_per_s": 80.0}, {})
    gains.write(folder / "slow.toml", "x8", {"turn.bandwidth_radps": 5.0}, {})
    return compare([x8, load(folder / "wild.toml"), load(folder / "slow.toml")], 18.0)


def test_margins_are_the_linear_models_and_unstable_gains_have_none(
    x8: Airframe, found: list[Compared]
) -> None:
    own, wild, _ = found
    model = linear_model(x8, 18.0)
    for name, loop in own.loops.items():
        assert loop.margins == model_margins(model, name) and not loop.flown
    assert not own.unstable and wild.unstable
    assert all(loop.margins is None for loop in wild.loops.values())
    table = pd.DataFrame(rows(found)).set_index(["loop", "airframe"])
    assert np.isnan(table.loc[("aileron", "x8+wild"), "phase_deg"])
    # The reference is outside the loops: as much margin, a slower turn.
    disks = table.loc["aileron", "disk"]
    assert disks["x8+slow"] == pytest.approx(disks["x8"], rel=1e-9)
    assert table.loc[("aileron", "x8+slow"), "t63"] > 1.3 * table.loc[("aileron", "x8"), "t63"]


def test_every_curve_has_a_look_of_its_own_and_a_legend_with_margins(found: list[Compared]) -> None:
    with drawing():
        drawn = overlay_figures.figures(found)
        assert list(drawn) == ["elevator", "aileron", "throttle"]
        for name, figure in drawn.items():
            (legend,) = figure.legends
            said = [text.get_text() for text in legend.get_texts()]
            assert len(said) == len(found)
            gain = found[0].loops[name].margins
            assert gain is not None and f"{gain.phase_deg:.0f} deg" in said[0]
            assert "unstable, the" in said[1]
            looks = {(line.get_color(), str(line.get_linestyle())) for line in legend.get_lines()}
            assert len(looks) == len(found)
            # Bode gain and phase, Nyquist and step: each has all of them
            for axes in figure.axes:
                colours = {line.get_color() for line in axes.lines}
                assert {colour for colour, _ in looks} <= colours, axes.get_title()


def test_servos_that_hear_every_fourth_period_are_measured_as_late(x8: Airframe) -> None:
    """An impulse of one period would go by unheard. One of four is heard up to three periods late."""
    held = x8.model_copy(update={"sensors": {"servo_rate_hz": 50.0}})
    own, late = (response(a, 18.0, "aileron", duration=10.0) for a in (x8, held))
    at = np.argmin(np.abs(own.frequency - 6.3))
    assert own.frequency[at] == late.frequency[at]
    turned = np.degrees(np.angle(own.loop[at] / late.loop[at]))
    late_by = np.radians(turned) / own.frequency[at]
    assert 0.005 < late_by < 0.0155  # 10.4 ms
    assert np.abs(late.loop[at] / own.loop[at]) == pytest.approx(1.0, abs=0.05)
    assert margins(late).phase_deg < margins(own).phase_deg
    # and with no servo rate nothing changed: the model still agrees
    theirs = model_response(linear_model(x8, 18.0), "aileron", own.frequency[at : at + 1])
    assert np.abs(own.loop[at] / theirs.loop[0]) == pytest.approx(1.0, abs=0.01)


def test_the_command_writes_figures_a_table_and_a_page(
    found: list[Compared],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    call: Callable[..., int],
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "over"
    gains.write(tmp_path / "slow.toml", "x8", {"turn.bandwidth_radps": 5.0}, {})
    names = ["x8", str(tmp_path / "slow.toml")]
    few = [replace(c, loops={"aileron": c.loops["aileron"]}) for c in found]
    monkeypatch.setattr("aircraft.datasheets.overlay.compare", lambda *_: [few[0], few[2]])
    assert call("aircraft", "describe", *names, "--overlay", "--out", out, "--json") == 0
    listed = json.loads(capsys.readouterr().out)
    assert {row["airframe"] for row in listed} == {"x8", "x8+slow"}
    monkeypatch.setattr("aircraft.datasheets.overlay.compare", lambda *_: few)
    monkeypatch.setenv("COLUMNS", "80")
    assert call("aircraft", "describe", *names, "--overlay") == 0
    shown = capsys.readouterr().out
    assert "unstable" in shown and "x8+wild" in shown and max(map(len, shown.splitlines())) <= 80
    kept = {p.name for p in out.iterdir()}
    assert kept >= {f"overlay-aileron.{kind}" for kind in ("png", "pdf", "svg")}
    assert len(pd.read_csv(out / "overlay.csv")) == len(listed) == 2
    text = page([part(out, "over", KINDS)])
    assert "x8+slow" in text and text.count("<svg") >= 1 and "x8" in (out / "report.html").read_text("utf-8")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["x8", "--overlay"], "name two airframes"),
        (["x8", "x8", "--overlay"], "x8 is named twice"),
        (["x8", "rascal"], "to compare them add --overlay"),
        (["x8", "--speed", "18"], "--speed: a datasheet is of all speeds"),
        (["x8", "albatross", "--overlay"], "no airframe albatross"),
        (["x8", "rascal", "--overlay", "--speed", "40"], "x8 is flown at 15 to 25 m/s, not at 40 m/s"),
        (["x8", "rascal", "--overlay", "--speed", "nan"], "not at nan m/s"),
        (["x8", "rascal", "--overlay", "--gains", "g.toml"], "name gains files among the airframes"),
        (["x8", "rascal", "--overlay", "--markdown"], "--markdown: of a datasheet"),
        (["x8"] * 8 + ["--overlay"], "at most 7"),
    ],
)
def test_a_mistake_is_one_line(arguments: list[str], said: str, refusal: Callable[..., str]) -> None:
    line = refusal("aircraft", "describe", *arguments).strip()
    assert re.search(re.escape(said), line) and len(line.splitlines()) == 1, line
