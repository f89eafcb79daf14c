"""Block diagrams and tables of gains, made from an autopilot's equations."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from aircraft.airframe import copy, load
from aircraft.autopilots.parameters import markdown, table
from aircraft.equations.catalogue import equations_of, sha256_of, text_of
from aircraft.equations.compiler import system_xml
from aircraft.equations.dataflow import COMMANDS, MOST_BLOCKS, Block, blocks, outputs
from aircraft.equations.language import Equations, parse
from aircraft.equations.units import unit_of

ROOT = Path(__file__).parent.parent
EXAMPLE = ROOT / "docs/guide/examples/pid.eq"
HEAD = "use q = velocities/q-rad_sec\ninput on = 0\ninput zeta_cmd_mps = 0\ninput elevator_probe = 0\n"


def of(name: str) -> Equations:
    airframe = load(name)
    return equations_of(airframe).of(airframe.gain_values())


EVERY = [
    (name, output)
    for name in ("x8", "rascal", "rascal@arduplane", "rascal@px4")
    for output in outputs(of(name))
]


def test_the_examples_elevator_loop_is_the_cascade_it_is_written_as() -> None:
    found = {b.name: b for b in blocks(parse(EXAMPLE.read_text()), "elevator_norm")}
    assert list(found) == [
        "zeta_error_mps", "pitch_held_rad", "pitch_error_rad", "elevator_held", "elevator_norm"
    ]  # fmt: skip
    assert found["zeta_error_mps"].reads == ["zeta_cmd_mps"]
    assert found["zeta_error_mps"].measured == ["zeta_mps"]
    assert found["pitch_error_rad"].reads == ["pitch_held_rad", "zeta_error_mps"]
    assert found["elevator_norm"].gains == ["PITCH_P", "PITCH_D"]
    assert [name for name, b in found.items() if b.state] == ["pitch_held_rad", "elevator_held"]


@pytest.mark.parametrize(("name", "output"), EVERY)
def test_joining_blocks_loses_no_gain_no_command_and_no_equation(name: str, output: str) -> None:
    whole, few = blocks(of(name), output, 999), blocks(of(name), output)
    assert len(few) <= MOST_BLOCKS and few[-1].name == output

    def sums(found: list[Block]) -> tuple[set[str], set[str], set[str]]:
        asked = {n for b in found for n in b.reads if n in COMMANDS}
        return {g for b in found for g in b.gains}, {m for b in found for m in b.measured}, asked

    assert sums(few) == sums(whole)
    gains, _, asked = sums(few)
    loose = {n for b in few for n in (*b.reads, *b.late)} - {b.name for b in few} - set(COMMANDS)
    assert gains and asked and not loose
    # what is read this period comes from an earlier box, so the drawing has no circle
    seen = set(COMMANDS)
    for b in few:
        assert set(b.reads) <= seen | {b.name}
        seen.add(b.name)


def test_an_output_depends_on_the_commands_that_it_answers() -> None:
    def asked(name: str, output: str) -> set[str]:
        return {n for b in blocks(of(name), output) for n in b.reads if n in COMMANDS}

    assert asked("x8@px4", "aileron_norm") == {"omega_cmd_radps"}
    assert asked("x8@px4", "throttle_norm") >= {"v_cmd_mps", "zeta_cmd_mps"}
    with pytest.raises(ValueError, match="no output flap_norm; there are"):
        blocks(of("x8"), "flap_norm")


@pytest.mark.parametrize(("name", "output"), [case for case in EVERY if case[0] != "x8"])
def test_the_guides_diagrams_show_the_blocks_of_today(name: str, output: str) -> None:
    autopilot = load(name).autopilot
    svg = ROOT / f"docs/guide/figures/blocks/{autopilot}-{output.removesuffix('_norm')}.svg"
    text = svg.read_text("utf-8")
    for block in blocks(of(name), output):
        assert f">{block.name}<" in text, f"{block.name}: make guide"


# -- gains


def test_every_gain_of_the_inverting_autopilot_is_described_in_the_unit_of_its_name() -> None:
    equations = equations_of(load("x8"))
    assert {name for name in equations.needed() if equations.about(name) is None} == set()
    for gain in equations.gains:
        assert gain.unit == unit_of(gain.name) or not unit_of(gain.name), gain.name
        assert gain.low is not None and gain.high is not None and gain.low < gain.high and gain.meaning


@pytest.mark.parametrize("name", ["x8", "rascal", "x8@arduplane"])
def test_the_table_says_what_each_gain_does(name: str) -> None:
    rows = table(load(name))
    assert all(row["what it does"] for row in rows)
    text = markdown(rows).splitlines()
    assert len(text) == len(rows) + 2 and len({line.count("|") for line in text}) == 1
    assert ("default" in text[0]) == (name == "x8@arduplane")


def test_descriptions_and_line_breaks_change_neither_the_compiled_autopilot_nor_fingerprints(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    own = load("x8@typical")
    text = text_of(own)
    assert max(len(line) for line in text.splitlines() if not line.startswith("#")) <= 110
    bare = re.sub(r"(?<=[-+*/,])\n +", " ", re.sub(r"^gain .*\n(?:[ ]+.*\n)*", "", text, flags=re.M))
    assert "\ngain " not in bare and max(map(len, bare.splitlines())) > 300
    values = own.gain_values()
    assert system_xml(parse(text).of(values), values) == system_xml(parse(bare).of(values), values)
    monkeypatch.setattr("aircraft.equations.catalogue.text_of", lambda _: bare)
    assert sha256_of(own) == own.equations_sha256


def test_another_equation_is_another_fingerprint(monkeypatch: pytest.MonkeyPatch) -> None:
    own = load("x8@typical")
    known, text = sha256_of(own), text_of(own)
    changes = {
        ("damping of the turn reference", "what damps a turn"): True,
        ("thrust_full - thrust_idle) *", "thrust_full - 0.1) *"): True,  # of adopted aircraft
        ("clip(throttle_wanted, 0, 1)", "throttle_wanted"): False,
        ("input v_cmd_mps = 18", "input v_cmd_mps = 19"): False,
        ("== envelope if on every 8 ==", "== envelope if on every 4 =="): False,
    }
    for (old, new), same in changes.items():
        assert old in text
        monkeypatch.setattr(
            "aircraft.equations.catalogue.text_of", lambda _, a=old, b=new: text.replace(a, b)
        )
        assert (sha256_of(own) == known) == same, old


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("gain pitch_p: elevator", None),
        ("gain pitch_p [1/rad] 1 to 2: elevator", None),
        ("gain pitch_*: elevator", "gain pitch_*: no equation reads it"),
        ("gain pitch_p [1/rad] 1 to 2", "line 5: not a use"),
        ("gain pitch_p: a\ngain pitch_p: b", "line 6: gain pitch_p is described twice"),
        ("gain pitch_q: elevator", "gain pitch_q: no equation reads it"),
    ],
)
def test_a_gain_is_described_once_and_is_read(line: str, said: str | None) -> None:
    text = f"{HEAD}{line}\n== fly if on ==\nelevator_norm = pitch_p * q -> fcs/elevator-cmd-norm\n"
    if said is None:
        about = parse(text).about("pitch_p")
        assert about is not None and about.meaning == "elevator"
        return
    with pytest.raises(ValueError, match=re.escape(said)):
        parse(text)


# -- the command


def test_a_users_own_autopilot_is_drawn_and_listed(
    tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    wing = copy("x8", tmp_path / "wing")
    (wing / "pid.eq").write_text(EXAMPLE.read_text())
    drawn = tmp_path / "drawn"
    arguments = ["--parameters", "--markdown", "--diagram", drawn]
    assert call("aircraft", "autopilot", f"{wing}@pid.eq", *arguments) == 0
    out = capsys.readouterr().out
    assert "| PITCH_P | 1.2 |" in out and "elevator, trailing edge up, per error in pitch" in out
    names = {f"pid-{name}.{kind}" for name in ("elevator", "aileron", "throttle") for kind in ("svg", "png")}
    assert {p.name for p in drawn.iterdir()} == names
    first = (drawn / "pid-elevator.svg").read_bytes()
    assert call("aircraft", "autopilot", f"{wing}@pid.eq", "--diagram", drawn) == 0
    assert (drawn / "pid-elevator.svg").read_bytes() == first
    (tmp_path / "file").write_text("")
    assert call("aircraft", "autopilot", "x8", "--diagram", tmp_path / "file") == 2
    assert "cannot write" in capsys.readouterr().err
    assert call("aircraft", "autopilot", "x8", "--markdown") == 2
    assert "belongs to --parameters" in capsys.readouterr().err
