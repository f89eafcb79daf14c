"""Fields without effect are refused, with what would take them; schema 1 is read; files of any encoding."""

from __future__ import annotations

import codecs
import json
import warnings
from pathlib import Path

import pytest

import testbed
from testbed.errors import NoteWarning, UserError
from testbed.scenario.scenario import builtin, load, parse
from testbed.scenario.variants import changed, load_base, load_each
from testbed.simulation.refly import refly
from testbed.verification.check import verify

GAMMA = "barrier.manoeuvres=[{v_mps=16, omega_degps=11.7}]"
PLACES = "start.places=[" + ",".join(
    f"{{x_m={x}, y_m=0, course_deg=0, goal_x_m=1, goal_y_m=0}}" for x in (0, 99)
) + "]"  # fmt: skip
# What is said in vain -> what the message begins with, and what it names as the remedy.
IDLE: dict[tuple[str, ...], tuple[str, str]] = {
    ("barrier.kind=straight", "barrier.sigma=1.2"): ("barrier.sigma: has no effect on a straight", "'turn'"),
    ("barrier.zeta_mps=1",): ("barrier.zeta_mps: has no effect on a turn", "kind = 'straight' takes it"),
    ("barrier.speed_step=0.1",): ("barrier.speed_step: has no effect on a turn", "'straight'"),
    (GAMMA,): ("barrier.manoeuvres: has no effect on a turn", "'rollout'"),
    ("barrier.kind=rollout", GAMMA, "barrier.v_mps=18"): ("barrier.v_mps: has no effect on a roll", "'turn'"),
    ("barrier.kind=euclidean", "barrier.smoothing_m2=30"): ("barrier.smoothing_m2", "'turn' takes it"),
    ("barrier.pairs=[{i=1, j=2, v_mps=16, omega_degps=9}]",): ("barrier.pairs", "shared = false takes it"),
    ("barrier.gradient_step=1e-3",): ("barrier.gradient_step", "barrier.gradient = 'forward' takes it"),
    ("filter.kind=none", "barrier.gradient=forward"): ("barrier.gradient", "'centralised' or 'limited'"),
    ("filter.kind=none", "filter.monitor=true"): ("filter.monitor", "kind = 'centralised' or 'limited'"),
    ("filter.kind=navigation", "filter.solver=osqp"): ("filter.solver", "'centralised' or 'limited'"),
    ("navigation.swirl=0.2",): ("navigation.swirl", "filter.kind = 'navigation' takes it"),
    ("alpha.kind=odd-polynomial", "alpha.coefficients=[1]", "alpha.coefficient=2"): (
        "alpha.coefficient: has no effect on an odd polynomial",
        "kind = 'cubic' or 'linear' takes it",
    ),
    ("alpha.coefficients=[1]",): ("alpha.coefficients: has no effect on a cubic", "'odd-polynomial'"),
    ("guidance.kind=manoeuvre", "lookahead_m=10"): ("guidance.lookahead_m", "kind = 'near-identity'"),
    ("controller=manoeuvre", "nominal.lookahead_m=10"): ("guidance.lookahead_m", "kind = 'near-identity'"),
    ('airframes=["nobody"]',): ("airframes: has no effect", "plant = 'jsbsim' takes it"),
    ("plant=lagged", "lags.source=table", 'airframes=["rascal"]'): ("airframes: has no", "lags.source"),
    ("lags.source=table",): ("lags.source: has no effect: plant 'unicycle'", "plant = 'lagged' takes it"),
    ("plant=lagged", "lags.v_delay_s=1"): ("lags.v_delay_s: has no effect", "source = 'table' takes it"),
    ("plant=jsbsim", "lags.limits=false"): ("lags.limits: has no effect", "plant = 'lagged'"),
    ("start.pattern=list", PLACES, "start.radius_m=50"): ("start.radius_m", "pattern = 'circle' takes it"),
    (PLACES,): ("start.places: has no effect on a start on a circle", "pattern = 'list' takes it"),
    ("wind.towards_deg=90",): ("wind.towards_deg", "set wind.speed_mps"),
    ("wind.shear_exponent=0.2",): ("wind.shear_exponent", "set wind.speed_mps"),
    ("remedy.air_mass=true",): ("remedy.air_mass", "set wind.speed_mps"),
    ("gusts.sigma_mps=1", "gusts.intensity=light"): ("gusts.intensity", "gusts.sigma_mps replaces it"),
    ("gusts.length_scale_m=100",): ("gusts.length_scale_m", "set gusts.intensity"),
    ("gusts.independent=true",): ("gusts.independent", "set gusts.intensity"),
    ("gusts.jsbsim_turbulence=light",): ("gusts.jsbsim_turbulence", "gusts.intensity suits every plant"),
    ("sensing.drift_time_s=5", "sensing.position_noise_m=1"): ("sensing.drift_time_s", "position_drift_m"),
    ("sensing.source=sensors",): ("sensing.source", "position_noise_m"),
    ("network.stale=extrapolate-lost", "network.latency_s=1"): ("network.stale", "set network.loss"),
    ("remedy.issf_v_mps=2",): ("remedy: issf_v_mps: has no effect", "issf_epsilon"),
}  # fmt: skip


@pytest.mark.parametrize("overrides", IDLE, ids=lambda o: o[-1].partition("=")[0])
def test_a_field_without_effect_is_refused_with_what_would_take_it(overrides: tuple[str, ...]) -> None:
    begins, remedy = IDLE[overrides]
    for order in (overrides, overrides[::-1]):
        with pytest.raises(UserError) as error:
            load("paper-2-turn", list(order))
        assert str(error.value).startswith(f"paper-2-turn: {begins}") and remedy in str(error.value)


def test_a_field_at_its_default_says_nothing_and_is_taken() -> None:
    s = load("paper-2-turn", ["barrier.kind=straight", "barrier.sigma=1.0", 'airframes=["x8"]'])
    assert s == load("paper-2-turn", ["barrier.kind=straight"])
    assert "sigma" not in s.model_dump()["barrier"]


def test_the_message_names_the_line_of_a_file(tmp_path: Path) -> None:
    file = tmp_path / "own.toml"
    file.write_text('name = "own"\nvehicles = 2\n\n[barrier]\nkind = "straight"\nsigma = 1.2\n')
    with pytest.raises(UserError, match=r"own.toml: barrier.sigma: .* takes it \(line 6\)") as error:
        load(file)
    (mistake,) = error.value.mistakes
    assert (mistake.field, mistake.line, error.value.file) == ("barrier.sigma", 6, str(file))


def test_what_a_file_says_for_another_kind_is_left_out_with_a_note() -> None:
    with pytest.warns(NoteWarning, match=r"barrier\.gradient is left out: has no effect: filter 'none'"):
        s = load("published-2-turn", ["filter.kind=none"])
    assert s.barrier.gradient == "analytic"
    with pytest.raises(UserError, match=r"barrier\.gradient: has no effect"):
        load("published-2-turn", ["filter.kind=none", "barrier.gradient=forward"])


def test_one_file_for_several_plants_keeps_what_one_of_them_takes() -> None:
    each = load_each("paper-2-turn", ['airframes=["rascal"]'], ["unicycle", "jsbsim"])
    assert (each["unicycle"].airframes, each["jsbsim"].airframes) == (["x8"], ["rascal"])
    with pytest.raises(UserError, match="airframes: has no effect"):
        load_each("paper-2-turn", ['airframes=["rascal"]'], ["unicycle"])
    base = load_base("paper-2-turn", ['airframes=["rascal"]'])
    assert changed(base, {"plant": "lagged"}).airframes == ["rascal"]
    assert changed(base, {"plant": "unicycle"}).airframes == ["x8"]


def old(name: str) -> dict[str, object]:
    """A built-in scenario as schema 1 wrote it into manifests: every field, whatever the kind."""
    data = load(name).model_dump(mode="json")
    data["schema_version"] = 1
    data["barrier"] = {"sigma": 1.0, "speed_step": 0.01, "zeta_mps": 0.0, "manoeuvres": [], "pairs": []} | {
        "v_mps": 12.0, "omega_degps": 3.0, "shared": True, "smoothing_m2": 0.0
    } | data["barrier"]  # fmt: skip
    data["alpha"] |= {"coefficients": []}
    data["start"] = {"places": [], "radius_m": 200.0, "course_offset_deg": 0.0} | data["start"]
    data["filter"] = {"solver": "auto", "monitor": False} | data["filter"]
    return data


@pytest.mark.parametrize("name", sorted(builtin()))
def test_a_scenario_of_schema_1_is_the_same_today(name: str) -> None:
    assert parse(old(name)) == load(name)


def test_a_file_of_schema_1_is_read_and_what_it_said_in_vain_is_noted(tmp_path: Path) -> None:
    file = tmp_path / "old.toml"
    file.write_text(
        'schema_version = 1\nname = "o"\nvehicles = 2\nairframes = ["y"]\n'
        '[barrier]\nkind = "straight"\nsigma = 2.0\n'
    )
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        s = load(file)
    assert s.schema_version == 2 and s.airframes == ["x8"]
    assert {str(n.message).split(": ")[1].split()[0] for n in notes} == {"barrier.sigma", "airframes"}


def test_a_run_folder_of_schema_1_is_loaded_and_verified(tmp_path: Path) -> None:
    s = load("paper-2-turn", ["duration_s=0.5", "checks.manoeuvre_instants=0"])
    testbed.run(s, tmp_path / "r")
    from tests.forgery import seal

    manifest = tmp_path / "r" / "manifest.json"
    said = json.loads(manifest.read_text())
    said["scenario"] = old("paper-2-turn") | {
        "duration_s": 0.5, "checks": {"manoeuvre_instants": 0}, "airframes": ["nobody"]
    }  # fmt: skip
    manifest.write_text(json.dumps(said))
    seal(tmp_path / "r")
    assert testbed.load(tmp_path / "r").manifest["scenario"]["schema_version"] == 1
    assert not [f for f in verify(tmp_path / "r") if f.agrees is False]
    assert not [f.what for f in refly(tmp_path / "r") if f.agrees is False]


TEXT = 'name = "e"\r\nvehicles = 2\r\nduration_s = 0.5 # \N{DEGREE SIGN}\r\n'


@pytest.mark.parametrize(
    "content",
    [
        pytest.param(codecs.BOM_UTF8 + TEXT.encode(), id="UTF-8 with mark"),
        pytest.param(codecs.BOM_UTF16_LE + TEXT.encode("utf-16-le"), id="UTF-16 LE"),
        pytest.param(codecs.BOM_UTF16_BE + TEXT.encode("utf-16-be"), id="UTF-16 BE"),
        pytest.param(codecs.BOM_UTF32_LE + TEXT.encode("utf-32-le"), id="UTF-32"),
        pytest.param(TEXT.replace("\r\n", "\r").encode(), id="old Mac"),
        pytest.param(TEXT.replace(" = ", "\t=\t").encode(), id="tabs"),
    ],
)
def test_a_file_is_read_in_any_usual_encoding(content: bytes, tmp_path: Path) -> None:
    file = tmp_path / "e.toml"
    file.write_bytes(content)
    assert load(file).duration_s == 0.5


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (TEXT.encode("utf-16-le"), r"is UTF-16 or UTF-32 without a byte order mark; save it as UTF-8"),
        (TEXT.encode("latin-1"), r"is not UTF-8 text: byte 0xb0 in line 3; save it as UTF-8"),
        (TEXT.encode() + b"\0", r"is no text: a NUL in line 4"),
    ],
)
def test_a_file_that_is_no_text_says_so_with_the_line(content: bytes, said: str, tmp_path: Path) -> None:
    file = tmp_path / "e.toml"
    file.write_bytes(content)
    with pytest.raises(UserError, match=said):
        load(file)
