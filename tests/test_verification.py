"""The second opinion agrees with sound runs, shares no formula with them, and says what it cannot decide."""

from __future__ import annotations

import ast
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import testbed
from testbed.components import catalogue
from testbed.errors import UserError
from testbed.scenario.scenario import builtin, load
from testbed.simulation.simulate import run
from testbed.verification.check import verify
from tests.forgery import Change, copied, differing, edit_entry, edit_manifest, edit_table, entry, open_, seal

ROOT = Path(__file__).parent.parent
SHORT = ["duration_s=0.1", "record_dt_s=0.005", "manoeuvre_instants=3"]
NEAR = ["radius_m=60", "lookahead_m=10", "duration_s=4", "filter_dt_s=0.05", "record_dt_s=0.05"]
# What a record cannot say of an aircraft, recorded at every filter step but not at every step in between.
AIRCRAFT = {"manoeuvre-flyable", "manoeuvre-keeps-Ds", "path-and-time"}
UNSEEN = {"h_filter_m", "rows-satisfied", "minimal"}


def imported(file: Path) -> set[str]:
    """The full name of everything that a module imports from this project."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
    return {n for n in names if n.split(".")[0] in ("testbed", "filters", "aircraft")}


def test_it_imports_nothing_of_what_it_checks() -> None:
    """Errors, a verdict's form, the claims' texts and the scenario's schema are common; all else is anew.

    The schema can only add a difference, or name a field as not covered: no claim agrees because of it.
    """
    common = (
        "testbed.errors.",
        "testbed.records.verdict.",
        "testbed.claims.registry",
        "testbed.claims.promises",
    )
    registered = {
        f"testbed.claims.monitored.{name}"
        for name in ("MONITORED", "OF_KINDS", "OF_RIVALS", "OF_THE_FLOW", "RECORDED")
    }
    schema = {f"testbed.scenario.{name}" for name in ("scenario.parse", "relevance.idle", "installed.PLANTS")}
    for file in (ROOT / "testbed/verification").glob("*.py"):
        for name in imported(file):
            own = name.startswith("testbed.verification.")
            texts = name.startswith(common) or name in registered | schema
            assert own or texts, (file.name, name)


@pytest.mark.parametrize("name", builtin())
def test_it_agrees_with_every_built_in_scenario(name: str, tmp_path: Path) -> None:
    made = run(load(name, [*SHORT, "filter_dt_s=0.005"]), tmp_path / "run", force=True)
    findings = verify(tmp_path / "run")
    # The navigation function is a filter that is not computed again.
    left = {"minimal"} if "navigation" in name else set()
    assert {f.what for f in findings if f.agrees is not True} == left
    assert {f.what.split()[-1] for f in findings} >= {e["id"] for e in made.guarantees}


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["paper-2-turn", "paper-2-straight-altitude", "paper-20-turn", "published-2-turn"]
)
def test_it_agrees_with_whole_runs_as_they_are_built_in(name: str, tmp_path: Path) -> None:
    s = load(name)
    run(s, tmp_path / "run", force=True)
    assert differing(tmp_path / "run") == set()
    # Where every step was recorded, nothing is open.
    assert bool(open_(tmp_path / "run")) == (s.rates.record_dt_s > s.rates.filter_dt_s)


@pytest.mark.slow
@pytest.mark.parametrize("airframe", ["x8", "rascal"])
@pytest.mark.parametrize(
    ("overrides", "more"),
    [
        pytest.param([], set(), id="plain"),
        pytest.param(["filter.kind=limited", "vehicles=4"], set(), id="limited"),
        pytest.param(
            ["filter.kind=limited", "network.latency_s=0.13"], {"solutions", "minimal"}, id="limited, late"
        ),
        pytest.param(["network.latency_s=0.13"], set(), id="late"),
        pytest.param(["wind.speed_mps=5", "wind.towards_deg=90"], set(), id="wind"),
        pytest.param(["gusts.intensity=moderate"], {"wind"}, id="gusts"),
        pytest.param(["remedy.predict_lags=true", "remedy.ds_buffer_m=0.5"], set(), id="lags"),
        pytest.param(["remedy.prediction_s=0.4", "remedy.derate=0.9"], set(), id="ahead"),
        pytest.param(["remedy.robust_v_mps=1", "remedy.robust_omega_degps=2"], set(), id="robust"),
        pytest.param(["wind.speed_mps=4", "remedy.air_mass=true"], UNSEEN, id="air"),
        pytest.param(["sensing.position_noise_m=1"], UNSEEN, id="noise"),
        pytest.param(["network.loss=0.3"], UNSEEN, id="loss"),
    ],
)
def test_it_agrees_with_aircraft(airframe: str, overrides: list[str], more: set[str], tmp_path: Path) -> None:
    run(
        load("paper-2-turn", [*NEAR, "plant=jsbsim", f'airframes=["{airframe}"]', *overrides]),
        tmp_path / "run",
    )
    assert differing(tmp_path / "run") == set()
    assert open_(tmp_path / "run") == AIRCRAFT | more


@pytest.mark.parametrize(
    ("overrides", "more"),
    [
        pytest.param([], set(), id="plain"),
        pytest.param(["plant=lagged"], AIRCRAFT - {"manoeuvre-flyable"}, id="lagged"),
        pytest.param(["remedy.smoothing_m2=30", "height_perturbation_m=2"], set(), id="smooth"),
        pytest.param(["filter.kind=limited", "remedy.issf_epsilon=10"], set(), id="issf"),
        pytest.param(["sensing.delay_s=0.12", "filter.kind=limited"], set(), id="delay"),
        pytest.param(["barrier.kind=straight", "zeta_mps=[0.5, -0.5]"], set(), id="climb"),
        pytest.param(["barrier.form=squared", "alpha.kind=linear"], set(), id="squared"),
        pytest.param(["alpha.kind=odd-polynomial", "alpha.coefficients=[0.3, 0.02]"], set(), id="alpha"),
        pytest.param(["filter.kind=none"], set(), id="no filter"),
        pytest.param(['guidance={kind="manoeuvre"}'], set(), id="gamma"),
        pytest.param(["guidance.delay_steps=2"], set(), id="old u_hat"),
        pytest.param(["vehicles=1"], set(), id="one"),
        pytest.param(["duration_s=0"], set(), id="at once"),
        pytest.param(["radius_m=7"], set(), id="unsafe"),
        pytest.param(
            ["barrier.kind=rollout", "barrier.manoeuvres=[{v_mps=16, omega_degps=11.7}]"], set(), id="rollout"
        ),
    ],
)
def test_it_agrees_with_kinematic_vehicles(overrides: list[str], more: set[str], tmp_path: Path) -> None:
    made = run(load("paper-2-turn", [*NEAR, *overrides]), tmp_path / "run", force=True)
    assert differing(tmp_path / "run") == set()
    assert open_(tmp_path / "run") == more
    assert {f.what.split()[-1] for f in verify(tmp_path / "run")} >= {e["id"] for e in made.guarantees}


def test_manoeuvres_that_differ_are_searched_a_second_time(tmp_path: Path) -> None:
    """One flies straight and one turns: there h is a search, and the verification makes its own."""
    kinds = "barrier.manoeuvres=[{v_mps=16}, {v_mps=16, omega_degps=9}]"
    run(load("paper-2-turn", [*SHORT, "barrier.kind=rollout", kinds]), tmp_path / "run")
    assert differing(tmp_path / "run") == set()
    searched = {"h_m", "safe-set", "barrier-condition", "start-safe", "rows-satisfied", "minimal"}
    assert not searched & open_(tmp_path / "run")


@pytest.mark.parametrize("plant", ["unicycle", "lagged", pytest.param("jsbsim", marks=pytest.mark.slow)])
def test_a_thin_record_decides_what_it_can_and_says_what_it_cannot(plant: str, tmp_path: Path) -> None:
    run(load("paper-2-turn", [*NEAR, f"plant={plant}", "record_dt_s=0.2"]), tmp_path / "run")
    assert differing(tmp_path / "run") == set()
    left = [f for f in verify(tmp_path / "run") if f.agrees is None]
    names = {f.what.split()[-1] for f in left}
    assert names >= {"qp-feasibility", "command-limits", "rows-satisfied", "off-the-kink"}
    assert all("0.2 s" in f.why for f in left if f.what.split()[-1] in ("command-limits", "qp-feasibility"))
    # Distances are bounded from both sides all the same.
    value = entry(tmp_path / "run", "separation")["value"]
    for wrong in (value + 0.5, value - 2.0):
        forged = copied(tmp_path / "run", tmp_path / f"{wrong}")
        edit_entry(forged, "separation", value=wrong, margin=wrong - 5.0)
        seal(forged)
        assert "separation" in differing(forged)


@pytest.mark.parametrize("plant", ["unicycle", "lagged", pytest.param("jsbsim", marks=pytest.mark.slow)])
@pytest.mark.parametrize("record_s", [0.1, 0.4, 1.0])
def test_a_thin_record_raises_no_alarm(plant: str, record_s: float, tmp_path: Path) -> None:
    overrides = [
        *NEAR[1:4],
        "duration_s=8",
        "radius_m=110",
        f"record_dt_s={record_s}",
        "manoeuvre_instants=3",
    ]
    run(load("paper-2-turn", [*overrides, f"plant={plant}"]), tmp_path / "run")
    assert differing(tmp_path / "run") == set()


@pytest.mark.slow
def test_a_margin_far_from_its_bound_is_decided_by_a_thin_record(tmp_path: Path) -> None:
    run(load("paper-2-turn", [*NEAR, "plant=jsbsim", "duration_s=1", "record_dt_s=0.1"]), tmp_path / "run")
    found = {f.what.split()[-1]: f for f in verify(tmp_path / "run")}
    for name in ("separation", "safe-set", "goal"):
        assert found[name].agrees is True


def test_values_agree_far_more_closely_than_they_are_judged(tmp_path: Path) -> None:
    """What the guide says of how closely: h to 1e-8 m, rates to 1e-5 m/s."""
    run(load("paper-2-turn", [*NEAR, "filter.monitor=true"]), tmp_path / "run")
    found = {f.what.split()[-1]: f for f in verify(tmp_path / "run")}
    for name, most in (("safe-set", 1e-8), ("barrier-condition", 1e-5), ("rows-satisfied", 1e-6)):
        assert (found[name].within or 0.0) < most


def test_a_part_of_ones_own_leaves_open_what_it_decides(tmp_path: Path) -> None:
    from testbed.components import catalogue

    parts = testbed.Parts(filter=lambda s, b, goal: catalogue.filter_(s, b, goal))
    run(load("paper-2-turn", SHORT), tmp_path / "run", parts=parts)
    assert differing(tmp_path / "run") == set()
    assert "rows-satisfied" in open_(tmp_path / "run")


def test_a_run_that_ended_early_agrees_and_when_it_ended_is_checked(tmp_path: Path) -> None:
    class Falling:
        """A unicycle that is lost at 0.5 s."""

        def __init__(self, s: testbed.Scenario, wind: np.ndarray) -> None:
            from testbed.components import catalogue

            self._of, self._t = catalogue.plant(s, wind), 0.0
            self.dt = self._of.dt

        def __getattr__(self, name: str) -> object:
            return getattr(self._of, name)

        def step(self, command: object, wind: np.ndarray, n: int) -> object:
            self._t += n * self.dt
            return self._of.step(command, wind, n)  # type: ignore[arg-type]

        def faults(self) -> list[str]:
            return ["ground", ""] if self._t > 0.5 else ["", ""]

    parts = testbed.Parts(plant=Falling)  # type: ignore[arg-type]
    run(load("paper-2-turn", [*NEAR, "manoeuvre_instants=0"]), tmp_path / "run", parts=parts)
    assert differing(tmp_path / "run") == set()
    forged = copied(tmp_path / "run", tmp_path / "forged")
    edit_manifest(forged, ended_early="vehicle 1: ground at 0.300 s; run stopped")
    seal(forged)
    assert "end" in differing(forged)


class FailsLater:
    """The scenario's filter, which raises at its call number `calls`, from 0."""

    calls = 0

    def __init__(self, s: Any, barrier: Any, goal: Any) -> None:
        self.made, self.called = catalogue.filter_(s, barrier, goal), 0

    def __call__(self, *given: Any) -> Any:
        self.called += 1
        if self.called > self.calls:
            raise RuntimeError("no map loaded")
        return self.made(*given)


FAILS_AT = FailsLater.__call__.__code__.co_firstlineno + 3


@pytest.mark.parametrize("calls", [1, 2, 7, 10])
@pytest.mark.parametrize(
    "overrides",
    [
        ["record_dt_s=0.05"],
        ["record_dt_s=0.1"],
        ["record_dt_s=0.05", "fdm_dt_s=0.05"],
        ["record_dt_s=0.05", "fdm_dt_s=0.05", 'plant="lagged"'],
        ["record_dt_s=0.05", 'plant="lagged"'],
    ],
)
def test_the_motion_before_a_decision_that_failed_is_judged(
    calls: int, overrides: list[str], tmp_path: Path
) -> None:
    brief = ["duration_s=0.5", "filter_dt_s=0.05", "manoeuvre_instants=0", *overrides]
    parts = testbed.Parts(filter=type("Fails", (FailsLater,), {"calls": calls}))
    run = testbed.run(testbed.load_scenario("paper-2-turn", brief), tmp_path / "r", parts=parts)
    assert f"no map loaded (test_verification.py:{FAILS_AT}), in step {calls} at" in str(
        run.manifest["ended_early"]
    )
    differ = [f"{f.what}: {f.why}" for f in verify(tmp_path / "r") if f.agrees is False]
    assert not differ


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("verify") / "run"
    run(load("paper-2-turn", [*NEAR, "duration_s=1", "manoeuvre_instants=0"]), folder)
    return folder


@pytest.mark.parametrize(
    "drop",
    [
        pytest.param(lambda t: t.iloc[:-2], id="the last instant"),
        pytest.param(lambda t: t.drop(index=[20, 21]), id="an instant in the middle"),
        pytest.param(lambda t: t.drop(index=[21]), id="one vehicle's row"),
        pytest.param(lambda t: pd.concat([t, t.iloc[-2:]]), id="an instant twice"),
    ],
)
def test_dropped_rows_are_refused(sound: Path, tmp_path: Path, drop: Change) -> None:
    folder = copied(sound, tmp_path / "x")
    edit_table(folder, "vehicles", drop)
    seal(folder)
    with pytest.raises(UserError, match=r"rows|instants"):
        verify(folder)


def test_nonsense_is_refused_in_one_line(sound: Path, tmp_path: Path) -> None:
    folder = copied(sound, tmp_path / "x")
    edit_entry(folder, "goal", detail=3, value="far", vehicles=None)
    seal(folder)
    with pytest.raises(UserError, match="malformed"):
        verify(folder)


def test_the_command_answers_by_its_exit_code_within_80_columns(
    sound: Path, tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("verify", sound) == 0
    text = capsys.readouterr().out
    assert "agree" in text and max(map(len, text.splitlines())) <= 80
    folder = copied(sound, tmp_path / "x")
    edit_entry(folder, "separation", value=99.0)
    assert call("verify", folder, "--json") == 1
    told = json.loads(capsys.readouterr().out)
    assert not told["agrees"] and told["open"] == []
    assert {f["what"] for f in told["findings"] if f["agrees"] is False} == {"files", "G1 separation"}
    assert call("verify", folder) == 1
    text = capsys.readouterr().out
    assert "G1 separation differs: value is 99" in text and max(map(len, text.splitlines())) <= 80
    assert call("verify", tmp_path) == 2


def test_attitude_agrees_far_from_the_origin_where_the_ground_is_tilted(tmp_path: Path) -> None:
    """20 km away the vertical differs by 3e-3 rad from the origin's, and north by 2.6e-3 rad."""
    far = ["plant=jsbsim", "start.radius_m=20000", "duration_s=0.1", "manoeuvre_instants=3"]
    run(load("paper-2-turn", far), tmp_path / "run", force=True)
    flow = [f for f in verify(tmp_path / "run") if f.what in ("airspeed_mps", "alpha_rad", "beta_rad")]
    assert len(flow) == 3 and all(f.agrees for f in flow), flow
