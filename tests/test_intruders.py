"""Intruders: vehicles that the filter does not command; its rows beside them, and what is judged of them."""

from __future__ import annotations

import json
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from filters.barriers.class_k import cubic, linear
from filters.barriers.closed_form import TurnBarrier
from filters.cbf.collision import CollisionFilter, Passthrough
from filters.cbf.constraints import pair_rows
from filters.cbf.intruders import Intruders
from filters.model import Command, Limits, State, View, step
from filters.qp.single import Status
from testbed import Parts, UserError, run
from testbed.claims import registry
from testbed.claims.nearest import nearest_approach
from testbed.scenario.scenario import parse
from testbed.verification.check import verify

TURN = TurnBarrier(16.0, np.radians(11.7), 5.0, smoothing=30.0)
N, WHO = 4, (1, 3)
LIMITS = Limits(
    np.array([15.0, 12.0, 15.0, 18.0]), np.array([25.0, 22.0, 25.0, 30.0]), np.full(N, 0.22), np.full(N, 3.9)
)
MODES = ["centralised", "limited"]


def scene(seed):
    rng = np.random.default_rng(seed)
    state = State(*rng.uniform(-90, 90, (2, N)), rng.uniform(-3, 3, N), rng.uniform(-6, 6, N))
    rates = Command(rng.uniform(15, 25, N), rng.uniform(-0.2, 0.2, N), rng.uniform(-3, 3, N))
    wanted = Command(rng.uniform(10, 30, N), rng.uniform(-0.3, 0.3, N), rng.uniform(-5, 5, N))
    return View(state, rates), wanted


def one_row_each(view, assume):
    """The filter's rows of pairs under it, and beside intruders."""
    rows = pair_rows(TURN.values(view.state), view.state, cubic(0.1))
    return Intruders(WHO, LIMITS, assume).rows(rows, view.rates.array())


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6))
def test_keeping_course_is_the_rate_of_h_under_a_straight_flight(seed):
    view, wanted = scene(seed)
    ours, beside = one_row_each(view, "keep-course")
    assert {*zip(*(v.tolist() for v in ours.vehicles), strict=True)} == {(0, 2)}
    assert sorted(beside.vehicles[0].tolist()) == [0, 0, 2, 2]
    kept = Command(
        np.where(np.isin(range(N), WHO), view.rates.v, wanted.v),
        np.where(np.isin(range(N), WHO), 0.0, wanted.omega),
        np.where(np.isin(range(N), WHO), view.rates.zeta, wanted.zeta),
    )
    dt = 1e-4
    h = [TURN.values(step(view.state, kept, t)) for t in (-dt, dt)]
    slope = (h[1].h - h[0].h) / (2 * dt)
    pairs = [(int(i), int(j)) for i, j in zip(h[0].i, h[0].j, strict=True) if (i in WHO) != (j in WHO)]
    due = {
        p: slope[k] for k, p in enumerate(zip(h[0].i.tolist(), h[0].j.tolist(), strict=True)) if p in pairs
    }
    found = beside.left(kept.array()) + beside.drift
    order = [p for p in pairs if p[0] not in WHO] + [p for p in pairs if p[1] not in WHO]
    np.testing.assert_allclose(found, [due[p] for p in order], rtol=1e-5, atol=1e-3)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6))
def test_nothing_assumed_is_the_worst_corner_of_the_intruders_limits(seed):
    view, _ = scene(seed)
    rows = pair_rows(TURN.values(view.state), view.state, cubic(0.1))
    _, beside = one_row_each(view, "nothing")
    low, high = LIMITS.corners
    due = []
    for side in (0, 1):
        mine, other = rows.vehicles[side], rows.vehicles[1 - side]
        for r in np.flatnonzero(~np.isin(mine, WHO) & np.isin(other, WHO)):
            box = np.stack([low[other[r]], high[other[r]]])
            corners = [rows.lie[1 - side][r] @ box[list(c), range(3)] for c in product((0, 1), repeat=3)]
            due.append(rows.rhs[r] - min(corners))
    np.testing.assert_allclose(beside.rhs, due, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("assume", ["keep-course", "nothing"])
@pytest.mark.parametrize("mode", MODES)
def test_the_solution_is_the_nearest_command_of_the_vehicles_under_the_filter(mode, assume):
    made = CollisionFilter(TURN, linear(1.0), mode=mode, intruders=Intruders(WHO, LIMITS, assume))
    checked = 0
    for seed in range(40):
        view, wanted = scene(seed)
        decision = made(view, wanted, LIMITS)
        u, clipped = decision.command.array(), LIMITS.clip(wanted).array()
        assert np.array_equal(u[list(WHO)], clipped[list(WHO)])
        assert (decision.status[list(WHO)] == Status.NONE).all() and not decision.override[list(WHO)].any()
        if not (decision.status[[0, 2]] == Status.SOLVED).all() or np.allclose(u, clipped):
            continue
        blocks = made.constraints(view)
        shares = made.shares(blocks, N)
        rows = []
        for block, each in zip(blocks, shares, strict=True):
            if mode == "limited":
                rows += [
                    (lie[r], int(v[r]), rhs[r])
                    for v, lie, rhs in zip(block.vehicles, block.lie, each, strict=True)
                    for r in range(len(v))
                ]
        low, high = LIMITS.corners

        def left(x, rows=rows, blocks=blocks, u=u):
            w = u.copy()
            w[[0, 2]] = x.reshape(2, 3)
            if mode == "limited":
                return np.array([lie @ w[v] - rhs for lie, v, rhs in rows])
            return np.concatenate([block.left(w) - block.rhs for block in blocks])

        target = wanted.array()[[0, 2]].ravel()
        best = minimize(
            lambda x, target=target: np.sum((x - target) ** 2),
            u[[0, 2]].ravel(),
            jac=lambda x, target=target: 2 * (x - target),
            bounds=list(zip(low[[0, 2]].ravel(), high[[0, 2]].ravel(), strict=True)),
            constraints={"type": "ineq", "fun": left},
            method="SLSQP",
            options={"ftol": 1e-14, "maxiter": 200},
        )
        assert left(u[[0, 2]].ravel()).min() >= -1e-6
        own = np.sum((u[[0, 2]].ravel() - target) ** 2)
        assert not best.success or left(best.x).min() < -1e-7 or own <= best.fun + 1e-5
        checked += 1
    assert checked >= 3


@pytest.mark.parametrize("assume", ["keep-course", "nothing"])
def test_views_of_ones_own_give_the_same_where_all_see_the_same(assume):
    made = CollisionFilter(TURN, linear(1.0), mode="limited", intruders=Intruders(WHO, LIMITS, assume))
    for seed in range(10):
        view, wanted = scene(seed)
        every = View(
            State.of(np.tile(view.state.array(), (N, 1, 1))),
            Command.of(np.tile(view.rates.array(), (N, 1, 1))),
        )
        one, other = (made(v, wanted, LIMITS).command.array() for v in (view, every))
        np.testing.assert_allclose(one, other, atol=1e-6)


def test_without_a_solution_the_vehicle_flies_the_manoeuvre_and_says_so():
    state = State([0.0, 12.0], [0.0, 0.0], [0.0, np.pi], [0.0, 0.0])
    view = View(state, Command([20.0, 25.0], [0.0, 0.0], [0.0, 0.0]))
    limits = Limits(np.full(2, 15.0), np.full(2, 25.0), np.full(2, 0.22), np.full(2, 3.9))
    made = CollisionFilter(TURN, cubic(0.1), intruders=Intruders((1,), limits, "nothing"))
    decision = made(view, Command([20.0, 20.0], [0.0, 0.0], [0.0, 0.0]), limits)
    assert [Status(int(x)).name for x in decision.status] == ["INFEASIBLE", "NONE"]
    assert decision.command.v.tolist() == [16.0, 20.0] and decision.residual[0] > 0


@pytest.mark.parametrize("mode", MODES)
def test_a_vehicle_has_no_row_beside_an_intruder_that_it_does_not_know(mode):
    made = CollisionFilter(TURN, linear(1.0), mode=mode, intruders=Intruders(WHO, LIMITS))
    for seed in range(10):
        view, wanted = scene(seed)
        known = np.ones((N, N), dtype=bool)
        known[np.ix_((0, 2), WHO)] = False  # they know of the others, nobody of them
        blind = View(view.state, view.rates, known)
        assert {v for block in made.constraints(blind) for v in block.vehicles[0].tolist()} <= {0}
        far = State.of(np.where(np.isin(range(N), WHO)[:, None], 1e5, view.state.array()))
        alone = made(View(far, view.rates), wanted, LIMITS).command.array()
        np.testing.assert_allclose(made(blind, wanted, LIMITS).command.array(), alone, atol=1e-6)


def test_an_unknown_assumption_is_refused():
    with pytest.raises(ValueError, match="assume is 'keep-course' or 'nothing'"):
        Intruders((0,), LIMITS, "hope")  # type: ignore[arg-type]


def place(x, y, course, gx, gy, **more):
    return {"x_m": x, "y_m": y, "course_deg": course, "goal_x_m": gx, "goal_y_m": gy} | more


A, B = place(-60.0, 0.0, 0.0, 200.0, 0.0), place(-60.0, 60.0, 0.0, 200.0, 60.0)
CROSSING = place(0.0, -60.0, 90.0, 0.0, 200.0, filter=False)
# Two intruders that meet head-on, far from the others.
MEET = [
    place(300.0, 0.0, 0.0, 900.0, 0.0, filter=False),
    place(312.0, 0.0, 180.0, -900.0, 0.0, filter=False),
]


def scenario(*tables, **more):
    return parse({"name": "i", "duration_s": 0.5, "vehicle": list(tables)} | more)


def test_what_happens_between_intruders_is_not_judged():
    flown = run(scenario(A, B, *MEET))
    assert flown.pairs.distance_m.min() < 5
    assert flown.guarantee(registry.SEPARATION.id)["verdict"] == "holds"
    assert flown.guarantee(registry.SEPARATION.id)["vehicles"] == [1, 2]
    beside = flown.guarantee(registry.SEPARATION_INTRUDERS.id)
    assert beside["verdict"] == "holds" and beside["number"] == "G1i" and len(beside["vehicles"]) == 2
    assert flown.guarantee(registry.SAFE_SET.id)["verdict"] == "holds"
    shared = flown.guarantee(registry.SHARED_MANOEUVRE.id)
    assert (shared["verdict"], shared["why"]) == ("premise not met", "vehicles 3 and 4 are intruders")
    assert flown.guarantee(registry.SEPARATION.id)["claim"] == "every pair under the filter keeps Ds"


def test_one_vehicle_under_the_filter_has_no_pair_but_its_intruders():
    flown = run(scenario(A, CROSSING))
    own = flown.guarantee(registry.SEPARATION.id)
    assert own["verdict"] == "not applicable"
    for claim in (registry.ZCBF_CONDITION, registry.MANOEUVRE_KEEPS_DS):
        assert flown.guarantee(claim.id)["verdict"] == "not applicable"
    assert nearest_approach(flown)["vehicles"] == [1, 2]
    assert flown.guarantee(registry.SHARED_MANOEUVRE.id)["why"] == "vehicle 2 is an intruder"
    assert (flown.vehicles[flown.vehicles.vehicle == 2].qp_status == "none").all()


def test_intruders_fly_what_they_want_under_a_filter_of_ones_own_and_in_moving_air():
    class Stop:
        def __call__(self, view, nominal, limits):
            still = Command(limits.v_min, 0 * limits.v_min, 0 * limits.v_min)
            return Passthrough()(view, still, limits)

    flown = run(scenario(A, CROSSING), parts=Parts(filter=lambda s, barrier, goal: Stop()))
    told, wanted = (flown.vehicles[f"v_{c}_mps"].to_numpy().reshape(-1, 2) for c in ("command", "nominal"))
    assert (told[:, 0] == 15.0).all() and (told[:, 1] == np.clip(wanted[:, 1], 15, 25)).all()
    windy = scenario(A, CROSSING, wind={"speed_mps": 4.0}, remedy={"air_mass": True})
    rows = run(windy).vehicles
    strange = rows[rows.vehicle == 2]
    assert (strange.v_command_mps == np.clip(strange.v_nominal_mps, 15, 25)).all()


@pytest.mark.parametrize("kind", ["centralised", "limited", "none"])
@pytest.mark.parametrize("assume", ["keep-course", "nothing"])
def test_verification_derives_intruders_by_itself(tmp_path, kind, assume):
    near = [place(-40.0, 0.0, 0.0, 200.0, 0.0), place(40.0, 3.0, 180.0, -200.0, 0.0, filter=False)]
    more = {"intruders": {"assume": assume}} if kind != "none" else {}
    s = scenario(*near, B, duration_s=1.2, filter={"kind": kind}, checks={"manoeuvre_instants": 2}, **more)
    flown = run(s, tmp_path / "run", force=True)
    assert kind == "none" or flown.vehicles.override.any()
    found = verify(tmp_path / "run")
    assert not [f for f in found if f.agrees is False]
    assert {"intruders", "G1i separation-intruders"} <= {f.what for f in found}
    if kind == "none":
        return
    # Forged: what was assumed, and who was an intruder.
    manifest = tmp_path / "run" / "manifest.json"
    said = json.loads(manifest.read_text())
    other = {"keep-course": "nothing", "nothing": "keep-course"}[assume]
    said["scenario"]["intruders"] = {"assume": other}
    manifest.write_text(json.dumps(said))
    wrong = {f.what for f in verify(tmp_path / "run") if f.agrees is False}
    assert wrong & {"minimal", "solutions", "G6 rows-satisfied"}
    said["scenario"]["intruders"] = {"assume": assume}
    said["scenario"]["vehicle"][1]["filter"] = True
    manifest.write_text(json.dumps(said))
    assert "entries" in {f.what for f in verify(tmp_path / "run") if f.agrees is False}


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ({"vehicle": [{"filter": False}, {"filter": False}]}, "vehicle: every vehicle is an intruder"),
        (
            {"vehicle": [{"filter": False}, {}], "filter": {"monitor": True}},
            "filter.monitor: it checks theorems that do not cover intruders",
        ),
        (
            {"vehicle": [{}, {}], "intruders": {"assume": "nothing"}},
            "intruders.assume: has no effect: no QP is solved beside an intruder",
        ),
        (
            {"vehicle": [{"filter": False}, {}], "intruders": {"assume": "hope"}},
            "intruders.assume: input should be 'keep-course' or 'nothing', got 'hope'",
        ),
        (
            {
                "vehicle": [{"filter": False}, {}],
                "intruders": {"assume": "nothing"},
                "wind": {"speed_mps": 3.0},
                "remedy": {"air_mass": True},
            },
            "intruders.assume: 'nothing' bounds an intruder over the ground",
        ),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(data, said):
    with pytest.raises(UserError) as caught:
        parse({"name": "a"} | data)
    assert said in str(caught.value) and "\n" not in str(caught.value)


def test_an_intruder_that_reaches_its_goal_agrees_with_the_verification(tmp_path):
    """Its path and time are reported like those of the others, whether it stays or leaves."""
    near = place(30.0, 90.0, 180.0, 0.0, 90.0, filter=False)
    for k, more in enumerate(({}, {"goal": {"on_arrival": "leave"}})):
        s = scenario(A, B, near, duration_s=1.0, checks={"manoeuvre_instants": 0}, **more)
        flown = run(s, tmp_path / str(k), force=True)
        assert flown.guarantee(registry.INTERVENTION.id)["detail"]["path_added_m"][2] is not None
        assert not [f for f in verify(tmp_path / str(k)) if f.agrees is False]


@pytest.mark.slow
def test_a_crossing_intruder_on_aircraft_flies_what_it_wants_and_is_judged_apart(tmp_path):
    s = scenario(A, CROSSING, plant="jsbsim", duration_s=1.0, checks={"manoeuvre_instants": 0})
    flown = run(s, tmp_path / "run", force=True)
    assert flown.guarantee(registry.SEPARATION_INTRUDERS.id)["vehicles"] == [1, 2]
    assert not [f for f in verify(tmp_path / "run") if f.agrees is False]
