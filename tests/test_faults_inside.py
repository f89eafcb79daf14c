"""Faults inside a run: it ends for all at once, the record says what, who and when, and nothing holds.

Where an aircraft is lost, the others' motion until then is bit for bit what it was without the fault.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.fleet import JsbsimFleet
from aircraft.kinematic import KinematicFleet
from filters.model import Array, Command
from filters.qp.single import Status
from testbed.components import catalogue
from testbed.components.components import Parts
from testbed.records.checksums import plain
from testbed.records.run import Run
from testbed.records.verdict import Kind
from testbed.scenario.scenario import load
from testbed.simulation.simulate import run

BRIEF = ["duration_s=2", "checks.manoeuvre_instants=0", "filter_dt_s=0.02", "record_dt_s=0.02"]
AT_S = 0.5


def broken(result: Run, who: str, what: str) -> None:
    """The run ended early, the record says why, and nothing holds but premises."""
    end = result.manifest["ended_early"]
    assert end is not None and end.startswith(who) and what in end and end.endswith("; run stopped")
    verdicts = {g["id"]: g.status for g in result.guarantees if g.kind is not Kind.PREMISE}
    assert verdicts and "holds" not in verdicts.values(), verdicts
    assert end in {g["why"] for g in result.guarantees}
    json.dumps(plain(result.guarantees), allow_nan=False)
    for name in ("x_m", "y_m", "z_m", "v_command_mps"):
        assert np.isfinite(result.vehicles[name]).all()


class Broken(KinematicFleet):
    """Unicycles to which something happens at AT_S."""

    flown = 0

    def step(self, command: Command, wind: Array, n: int) -> Array:
        track = super().step(command, wind, n)
        self.flown += n
        return self.after(track) if self.flown * self.dt >= AT_S else track

    def after(self, track: Array) -> Array:
        return track


class Lost(Broken):
    def after(self, track: Array) -> Array:
        track[:, 1] = np.nan
        return track


class Raising(Broken):
    def after(self, track: Array) -> Array:
        raise RuntimeError("the engine\nfell off")


class Reporting(Broken):
    def faults(self) -> list[str]:
        return ["", "bird strike" if self.flown * self.dt >= AT_S else ""]


UNICYCLES = {
    "no position": (
        Lost,
        "plant",
        "the track of step() is not finite: nan, vehicle 2, in step 24 at 0.500 s",
    ),
    "the plant raises": (
        Raising,
        "plant",
        "step() raised RuntimeError: the engine fell off (test_faults_inside.py:",
    ),
    "the plant reports": (Reporting, "vehicle 2: bird strike at 0.500 s", ""),
}


@pytest.mark.parametrize("fault", UNICYCLES)
@pytest.mark.parametrize("monitor", ["false", "true"])
def test_a_plant_that_fails_ends_the_run(tmp_path: Path, fault: str, monitor: str) -> None:
    plant, who, what = UNICYCLES[fault]
    whole = run(load("paper-2-turn", BRIEF))
    parts = Parts(plant=lambda s, wind: plant(s.vehicles, s.rates.fdm_dt_s))
    result = run(load("paper-2-turn", [*BRIEF, f"filter.monitor={monitor}"]), tmp_path / "r", parts=parts)
    broken(result, who, what)
    same_until_then(result, whole, [1, 2])


def same_until_then(result: Run, whole: Run, vehicles: list[int]) -> None:
    """What `vehicles` did until the end is what they did in the run without the fault, bit for bit."""
    end = result.vehicles.t_s.max()
    assert 0.4 < end < whole.vehicles.t_s.max()
    names = ["t_s", "x_m", "y_m", "z_m", "theta_rad", "v_mps", "omega_radps", "zeta_mps", "v_command_mps"]
    for vehicle in vehicles:
        until = whole.vehicles[(whole.vehicles.vehicle == vehicle) & (whole.vehicles.t_s <= end)]
        flown = result.vehicles[result.vehicles.vehicle == vehicle]
        np.testing.assert_array_equal(flown[names].to_numpy(), until[names].to_numpy())


def failing(made: Callable[..., Any], what: object) -> Callable[..., Any]:
    """A part that answers with `what`, or raises it, from AT_S on."""
    calls = 0

    def answer(*arguments: Any) -> Any:
        nonlocal calls
        calls += 1
        good = made(*arguments)
        if calls * 0.02 <= AT_S:
            return good
        if isinstance(what, Exception):
            raise what
        return what

    return answer


def viewing(guidance: Callable[..., Command]) -> Callable[..., Command]:
    return lambda t, view: guidance(t, view)


def test_a_controller_that_wants_no_number_ends_the_run() -> None:
    bad = Command([20.0, math.nan], [0.0, 0.0], [0.0, 0.0])
    parts = Parts(nominal=lambda *made_from: viewing(failing(catalogue.guidance(*made_from), bad)))
    result = run(load("paper-2-turn", BRIEF), parts=parts)
    broken(result, "guidance", "its command.v is not finite: nan, vehicle 2, in step 25 at 0.500 s")


def test_a_filter_that_raises_ends_the_run() -> None:
    error = np.linalg.LinAlgError("singular")
    parts = Parts(filter=lambda *made_from: failing(catalogue.filter_(*made_from), error))
    broken(
        run(load("paper-2-turn", BRIEF), parts=parts),
        "filter",
        "the call raised LinAlgError: singular (test_faults_inside.py:",
    )


def test_a_barrier_that_is_no_number_ends_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a QP would get is refused before it is one: NaN is never a dropped row."""
    from filters.barriers.closed_form import TurnBarrier

    good, calls = TurnBarrier.values, 0

    def values(self: Any, *arguments: Any, **named: Any) -> Any:
        nonlocal calls
        calls += 1
        found = good(self, *arguments, **named)
        if calls > 20:
            found.h[...] = np.nan
        return found

    monkeypatch.setattr(TurnBarrier, "values", values)
    result = run(load("paper-2-turn", BRIEF))
    broken(result, "deciding failed: FloatingPointError", "finite")


def without_solution(result: Run, status: Status) -> None:
    """Data, not an end: the run goes on, feasibility is violated, and the vehicles evade."""
    assert result.manifest["ended_early"] is None
    entry = result.guarantee("qp-feasibility")
    assert entry["verdict"] == "violated" and entry["t_s"] == 0.0 and entry["vehicles"] == [1]
    assert f"first {status.name.lower()}" in entry["why"]
    bad = result.vehicles[result.vehicles.qp_status == status.name.lower()]
    assert 0 < len(bad) == entry["value"]
    assert np.allclose(bad[["v_command_mps", "omega_command_radps"]], [16.0, math.radians(11.7)])


@pytest.mark.parametrize("kind", ["centralised", "limited"])
def test_a_qp_without_a_solution_is_recorded_and_the_vehicles_evade(kind: str) -> None:
    # 12 m apart and head-on: no input in the box satisfies the row
    s = load("paper-2-turn", [*BRIEF, "duration_s=0.2", "radius_m=6", f"filter.kind={kind}"])
    without_solution(run(s, force=True), Status.INFEASIBLE)


def test_a_solver_that_never_arrives_is_recorded_and_the_vehicles_evade(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("filters.qp.single.violation", lambda u, A, b: 1.0)
    s = load("paper-2-turn", [*BRIEF, "duration_s=0.1", "radius_m=20", "filter.solver=osqp"])
    without_solution(run(s, force=True), Status.ITERATION_LIMIT)


# What befalls the second of two aircraft, and how the record calls it.
def _stall(v: Fdm) -> None:
    for name, value in (("on", 0.0), ("elevator", -1.0), ("throttle", 0.0)):
        v.nodes[name].set_double_value(value)


def _spin(v: Fdm) -> None:
    _stall(v)
    v.nodes["aileron"].set_double_value(1.0)
    v.nodes["rudder"].set_double_value(-1.0)


def _dive(v: Fdm) -> None:
    v.nodes["on"].set_double_value(0.0)
    v.nodes["elevator"].set_double_value(0.3)


def _nan(v: Fdm) -> None:
    v.nodes["elevator"].set_double_value(math.nan)
    v.nodes["on"].set_double_value(0.0)


def _raise(v: Fdm) -> None:
    def step() -> None:
        raise RuntimeError("FGPropertyValue::GetValue() The property aero/x does not exist")

    class Dying:
        run = staticmethod(step)

    v.executive = Dying()


AIRCRAFT: dict[str, tuple[str, Callable[[Fdm], None], str, list[str]]] = {
    "stalls": ("x8", _stall, "vehicle 2: stalled at", []),
    "spins": ("rascal", _spin, "vehicle 2: upset at", ["duration_s=6"]),
    "flies into the ground": (
        "x8",
        _dive,
        "vehicle 2: hit the ground at",
        ["start.heights_m=[0, -297]", "duration_s=6"],
    ),
    "goes nan": ("x8", _nan, "vehicle 2: state not finite at", []),
    "is broken inside JSBSim": ("x8", _raise, "plant", []),
}


@pytest.mark.slow
@pytest.mark.parametrize("fault", AIRCRAFT)
def test_an_aircraft_that_is_lost_ends_the_run(fault: str) -> None:
    airframe, befall, said, more = AIRCRAFT[fault]

    class Sabotaged(JsbsimFleet):
        flown = 0.0

        def step(self, command: Command, wind: Array, n: int) -> Array:
            if self.flown >= AT_S:
                befall(self.vehicles[1])
            self.flown += n * self.dt
            return super().step(command, wind, n)

    # No filter: it would see the fault coming, and steer the other aircraft.
    s = load("paper-2-turn", [*BRIEF, "plant=jsbsim", "filter.kind=none", f"airframes=['{airframe}']", *more])
    whole = run(s)
    assert whole.manifest["ended_early"] is None
    parts = Parts(plant=lambda s, wind: Sabotaged(catalogue.airframes(s), s.rates.fdm_dt_s))
    result = run(s, parts=parts)
    broken(result, said, "")
    same_until_then(result, whole, [1])


def test_an_aircraft_too_slow_to_fly_is_refused_before_it_does() -> None:
    from testbed.errors import UserError

    with pytest.raises(UserError, match="start: x8 cannot fly steadily at ground speed 6 m/s"):
        run(load("paper-2-turn", [*BRIEF, "plant=jsbsim", "start.speed_mps=6"]))
