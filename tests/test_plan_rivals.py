"""Rivals whose plans end in the backup manoeuvre: what their authors prove, on a model with lags."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aircraft.kinematic import KinematicFleet
from filters.filter import Decision
from filters.flow.reach import furthest
from filters.flow.rollout import Paths
from filters.model import Command, Limits, State, View
from filters.qp.single import Status
from filters.rivals.backup import BackupFilter, interpolation, regulation
from filters.rivals.gatekeeper import GatekeeperFilter
from filters.rivals.plan_programs import Programs, rows
from filters.rivals.plans import Model, Tracks, covered, nearest
from filters.rivals.receding_horizon import RecedingHorizonFilter
from tests.flow_states import DT, GAMMA, HIGH, LAGS, LOW, apart, around, drawn, flow_of, one_period_on

DS = 5.0


def model_of(n: int, margin: float = 0.0) -> Model:
    return Model([LAGS], Command.of(np.tile(GAMMA, (n, 1))), DS, DT, margin)


def limits_of(n: int) -> Limits:
    return Limits(*(np.full(n, v) for v in (LOW[0], HIGH[0], HIGH[1], HIGH[2])))


def least(paths: Paths, i: np.ndarray, j: np.ndarray) -> np.ndarray:
    """The least distances of pairs by brute force: all instants, and phases 0.1 degrees apart."""
    early = apart(paths, i, j).min(axis=1)
    return np.minimum(early, around(paths, i, j, np.radians(np.arange(0, 360, 0.1))).min(axis=1))


# Plans


def test_a_plan_is_flown_as_its_commands_one_period_after_another() -> None:
    rng = np.random.default_rng(1)
    n, flow = 4, flow_of(4)
    state, rates, queued = drawn(rng, n, flow.depth)
    begun = flow.begin(state, rates, queued, DT * np.arange(1, 201))
    plan, lasts = rng.uniform(LOW, HIGH, (n, 4, 3)), np.array([DT, 0.0, 0.35, 1.0])
    paths = flow.paths(begun, covered(begun, plan, lasts[None]))
    periods = np.round(lasts / DT).astype(int)
    flown = [plan[:, b] for b in range(4) for _ in range(periods[b])] + [flow.gamma] * 20
    for k, command in enumerate(flown):
        state, rates, queued = one_period_on(flow, state, rates, queued, command)
        assert np.abs(state.x + 1j * state.y - paths.at[:, k]).max() < 1e-9
        assert np.abs(state.z - paths.z[:, k]).max() < 1e-9


def test_each_vehicle_may_have_a_plan_of_its_own_length() -> None:
    rng = np.random.default_rng(2)
    n, flow = 3, flow_of(3)
    state, rates, queued = drawn(rng, n, flow.depth)
    begun = flow.begin(state, rates, queued, DT * np.arange(1, 101))
    plan, lasts = rng.uniform(LOW, HIGH, (n, 1, 3)), np.array([[0.0], [DT], [2.0]])
    together = covered(begun, plan, lasts)
    for v in range(n):
        alone = covered(begun.of(np.array([v])), plan[[v]], lasts[[v]])
        assert np.abs(together[v] - alone[0]).max() < 1e-12
    # Of no length it is gamma from now on, of one period the flow filter's own.
    assert np.abs(together[0] - flow.covered(begun, flow.gamma)[0]).max() < 1e-12
    assert np.abs(together[1] - flow.covered(begun, plan[:, 0])[1]).max() < 1e-12


@given(st.integers(0, 10**6))
@settings(max_examples=15, deadline=None)
def test_the_least_distance_of_paths_is_that_of_brute_force(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, flow = 6, flow_of(6)
    state, rates, queued = drawn(rng, n, flow.depth)
    begun = flow.begin(state, rates, queued, flow.times(rates))
    paths = flow.roll(begun, rng.uniform(LOW, HIGH, (n, 3)))
    i, j = np.triu_indices(n, 1)
    tracks = Tracks.of(paths)
    brute = least(paths, i, j)
    # Phases 0.1 degrees apart miss 0.2 m where two circles of 80 m pass each other fastest.
    assert np.abs(nearest(tracks, i, tracks, j, np.inf) - brute).max() < 0.2
    found = nearest(tracks, i, tracks, j, 30.0)
    assert (found <= brute + 1e-9).all() and np.abs((found - brute)[found < 30.0]).max(initial=0) < 0.2


# Backup


@pytest.mark.parametrize("law", ["regulation", "interpolated"])
def test_a_double_integrator_ends_where_its_authors_say(law: str) -> None:
    """van Wijk et al. 2025: p'' = u, |u| <= 1, p <= 0, nominal u = 1, backup u = -1, beta = 10.

    At rest (1 - mu) - mu = 0: the regulation function swings about mu = 1/2, a clearance of ln 2 / beta. The
    interpolation, whose share is as small as the barrier condition allows, goes to the boundary and stays.
    """
    p, v, dt, places, ahead = -1.5, 0.0, 2e-3, [], np.linspace(0.05, 1.0, 20)
    for _ in range(10_000):
        # Along the backup for 1 s; it ends in the backup set v <= 0. Rates under u = 1 and u = -1.
        h = np.append(-(p + v * ahead - 0.5 * ahead**2), -(v - 1.0))
        if law == "regulation":
            mu = float(regulation(np.array(h.min()), 10.0))
        else:
            nominal, backup = np.append(-(v + ahead), -1.0), np.append(-(v - ahead), 1.0)
            mu = float(interpolation(nominal, backup, -(15 * h + h**3)))
        u = (1 - mu) * 1.0 + mu * -1.0
        p, v = p + v * dt + 0.5 * u * dt**2, v + u * dt
        assert p <= 2e-3  # instants 0.05 s apart miss 0.05^2 / 8 m at |u| = 1, a step 2 ms
        places.append(-p)
    end = np.array(places[-4000:])
    if law == "regulation":
        assert end.mean() == pytest.approx(np.log(2) / 10, abs=2e-3) and np.ptp(end) > 0.01
    else:
        assert end.max() < 2e-3


def test_the_interpolation_is_the_least_share_that_keeps_every_row() -> None:
    rng = np.random.default_rng(4)
    nominal, backup = rng.normal(0, 2, (200, 5)), rng.uniform(0, 2, (200, 5))
    allowed = -rng.uniform(0, 1, (200, 5))
    mu = interpolation(nominal, backup, allowed)
    grid = np.linspace(0, 1, 2001)[:, None, None]
    helps = backup > nominal
    kept = ((1 - grid) * nominal + grid * backup >= allowed - 1e-12) | ~helps
    first = grid[np.argmax(kept.all(axis=2), axis=0), 0, 0]
    assert np.abs(mu - first).max() < 6e-4
    assert (mu == 0).any() and (mu > 0.3).any()


def decided(chosen, state: State, rates: np.ndarray, nominal: np.ndarray) -> Decision:
    return chosen(View(state, Command.of(rates)), Command.of(nominal), limits_of(len(state)))


@pytest.mark.parametrize("blending", ["regulation", "interpolated"])
def test_vehicles_that_are_far_from_all_others_fly_their_nominal_commands(blending: str) -> None:
    state = State.of([[0, 0, 0, 0], [3000, 0, 0, 0], [0, 3000, 1, 0]])
    rates = np.tile([20.0, 0.0, 0.0], (3, 1))
    nominal = np.array([[22.0, 0.1, 0.5], [18.0, -0.2, 0.0], [30.0, 0.0, 0.0]])
    found = decided(BackupFilter(model_of(3), blending), state, rates, nominal)
    assert found.command.array() == pytest.approx(np.clip(nominal, LOW, HIGH), abs=1e-9)
    assert found.deviation.max() < 1e-9 and (found.status == Status.NONE).all()


@given(st.integers(0, 10**6))
@settings(max_examples=15, deadline=None)
def test_where_the_clearance_is_used_up_the_regulation_flies_the_backup_and_loses_nothing(seed: int) -> None:
    """mu = 1 at h_backup <= 0, and flown on the model h_backup then does not fall: its set is invariant."""
    rng = np.random.default_rng(seed)
    n, flow = 4, flow_of(4)
    state, rates, queued = drawn(rng, n, flow.depth)
    queued = np.broadcast_to(rates, queued.shape)  # what a filter that has just been made believes
    i, j = np.triu_indices(n, 1)

    def clearance(state: State, rates: np.ndarray, queued: np.ndarray) -> np.ndarray:
        # Instants enough that nothing is left of the lags: with those of the filter 1e-4 m are.
        begun = flow.begin(state, rates, queued, DT * np.arange(1, 401))
        tracks = Tracks.of(flow.roll(begun, flow.gamma))
        return nearest(tracks, i, tracks, j, np.inf)

    before = clearance(state, rates, queued)
    # Ds such that the nearest pair is at the border of the set.
    model = Model([LAGS], Command.of(np.tile(GAMMA, (n, 1))), float(before.min()) + 1e-3, DT)
    u = decided(
        BackupFilter(model, "regulation"), state, rates, rng.uniform(LOW, HIGH, (n, 3))
    ).command.array()
    pair = int(np.argmin(before))
    for v in (i[pair], j[pair]):
        assert u[v] == pytest.approx(GAMMA, abs=1e-12)
    after = clearance(*one_period_on(flow, state, rates, queued, u))
    assert after[pair] >= before[pair] - 1e-9


# Flown on the model


def fly(chosen, n: int, seed: int, steps: int, radius: float) -> tuple[float, float]:
    """Everybody across a circle, on the lagged plant: the least distance, and the share that arrived."""
    rng = np.random.default_rng(seed)
    angle = np.arange(n) * 2 * np.pi / n
    course = angle + np.pi + rng.uniform(-0.1, 0.1, n)
    state = State(radius * np.cos(angle), radius * np.sin(angle), course, 0 * angle)
    goal, still, limits = -state.position, np.zeros((n, 3)), limits_of(n)
    fleet = KinematicFleet(n, 0.01, [LAGS])
    fleet.reset(state, rng, still, np.full(n, 20.0))
    i, j = np.triu_indices(n, 1)
    near, there = np.inf, np.zeros(n, dtype=bool)
    for _ in range(steps):
        now = fleet.state()
        off = np.angle(np.exp(1j * (np.arctan2(goal[:, 1] - now.y, goal[:, 0] - now.x) - now.theta)))
        nominal = Command(np.full(n, 20.0), off, -0.1 * now.z)
        found = chosen(View(now, fleet.achieved()), nominal, limits)
        assert limits.contains(found.command, 1e-12).all()
        track = fleet.step(found.command, still, 5)
        near = min(near, float(np.linalg.norm(track[:, i] - track[:, j], axis=-1).min()))
        there |= np.hypot(fleet.state().x - goal[:, 0], fleet.state().y - goal[:, 1]) < 20
    return near, float(there.mean())


@pytest.mark.parametrize(
    "make",
    [
        lambda m: BackupFilter(m, "regulation"),
        BackupFilter,
        GatekeeperFilter,
        RecedingHorizonFilter,
    ],
)
def test_vehicles_that_meet_in_the_middle_keep_clear_and_arrive(make) -> None:
    chosen = make(model_of(2))
    near, arrived = fly(chosen, 2, 5, 130, 60.0)
    # Between samples 0.165 m may be missed (docs/guide/flow.md); without a filter they come nearer than 4 m.
    assert DS - 0.17 <= near < 40 and arrived == 1.0
    (check,) = chosen.record.checks.values()
    assert check.checked == 130 and check.failed == 0


# Gatekeeper


def plans_clear(chosen: GatekeeperFilter, state: State, rates: np.ndarray, queued: np.ndarray) -> float:
    """The least clearance of what vehicles are committed to, by brute force."""
    n, flow = len(state), flow_of(len(state))
    command, left = chosen.committed
    begun = flow.begin(state, rates, queued, DT * np.arange(1, 401))
    paths = flow.paths(begun, covered(begun, command[:, None], left[:, None]))
    return float(least(paths, *np.triu_indices(n, 1)).min()) - DS


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_vehicles_commit_to_is_clear_of_each_other_for_all_time(seed: int) -> None:
    """Driven at each other by nominal commands that change in every period, on the model itself."""
    rng = np.random.default_rng(seed)
    n, flow = 4, flow_of(4)
    chosen = GatekeeperFilter(model_of(n), 1.0)
    angle = np.arange(n) * 2 * np.pi / n
    state = State(60 * np.cos(angle), 60 * np.sin(angle), angle + np.pi, 0 * angle)
    rates = np.tile([20.0, 0.0, 0.0], (n, 1))
    queued = np.broadcast_to(rates, (flow.depth, n, 3))
    limits, lengths = limits_of(n), set()
    for _ in range(40):
        aim = np.arctan2(-state.y, -state.x) - state.theta
        wish = np.stack([rng.uniform(15, 25, n), np.sin(aim) + rng.normal(0, 0.1, n), 0 * aim], axis=-1)
        u = chosen(View(state, Command.of(rates)), Command.of(wish), limits).command.array()
        state, rates, queued = one_period_on(flow, state, rates, queued, u)
        assert plans_clear(chosen, state, rates, queued) >= -1e-3
        lengths |= set(np.round(chosen.committed[1] / DT))
    assert chosen.kept > 10 and len(lengths) > 4  # it had to refuse, and to choose


def head_on(distance: float) -> tuple[State, np.ndarray]:
    return State.of([[0, 0, 0, 0], [distance, 0, np.pi, 0]]), np.tile([20.0, 0.0, 0.0], (2, 1))


def test_a_vehicle_without_a_candidate_flies_on_along_its_plan() -> None:
    # Gamma from now on would be 0.4 m too near; turning harder for half a second first is less so.
    state, rates = head_on(54.0)
    chosen, harder = GatekeeperFilter(model_of(2), 0.5), np.tile([15.0, 0.227, 0.0], (2, 1))
    flown = [decided(chosen, state, rates, harder).command.array()]
    assert chosen.committed[1] == pytest.approx(0.5 - DT) and chosen.kept == 0
    # Then they want to turn into each other, which no candidate allows.
    into = np.tile([25.0, -0.227, 0.0], (2, 1))
    flown += [decided(chosen, state, rates, into).command.array()]
    assert np.stack(flown) == pytest.approx(np.stack([harder] * 2)) and chosen.kept == 2
    assert chosen.committed[1] == pytest.approx(0.5 - 2 * DT)


def test_with_a_horizon_of_one_period_it_is_model_predictive_shielding() -> None:
    """The nominal command passes if and only if the backup is safe after a period of it (Kim et al. 2026)."""
    passed = set()
    for distance in np.arange(50.0, 66.0, 1.0):
        state, rates = head_on(float(distance))
        flow = flow_of(2)
        wish = np.array([[25.0, -0.227, 0.0], GAMMA])
        queued = np.broadcast_to(rates, (flow.depth, 2, 3))
        begun = flow.begin(state, rates, queued, DT * np.arange(1, 401))
        i, j = np.array([0]), np.array([1])
        if least(flow.roll(begun, flow.gamma), i, j)[0] < DS:
            continue
        safe = bool(least(flow.roll(begun, wish), i, j)[0] >= DS)
        u = decided(GatekeeperFilter(model_of(2), DT), state, rates, wish).command.array()[0]
        assert u == pytest.approx(wish[0] if safe else GAMMA)
        passed.add(safe)
    assert passed == {True, False}


# Receding horizon


def test_plans_that_are_clear_are_flown_as_they_are_wanted() -> None:
    state, rates = head_on(900.0)
    wish = np.array([[22.0, 0.02, 0.5], [40.0, 0.0, 0.0]])
    found = decided(RecedingHorizonFilter(model_of(2)), state, rates, wish)
    assert found.command.array() == pytest.approx(np.clip(wish, LOW, HIGH)) and not found.override.any()
    assert (found.status == Status.SOLVED).all() and found.residual.max() == 0


def test_a_horizon_changes_the_first_command_less_than_none_does() -> None:
    """What a plan can still do later need not be done now: near the border of what is safe at all."""
    changes = {}
    for blocks, block_s in ((1, DT), (2, 0.5)):
        off = []
        for distance in (57.0, 58.0, 59.0):
            state, rates = head_on(distance)
            chosen = RecedingHorizonFilter(model_of(2), blocks, block_s)
            u = decided(chosen, state, rates, rates).command.array()
            off.append(np.abs((u - rates) / (HIGH - LOW)).max())
        changes[blocks] = off
    assert np.sum(changes[2]) < 0.5 * np.sum(changes[1]) and np.sum(changes[1]) > 0.05


@pytest.mark.parametrize("distance", [57.0, 60.0])
def test_the_first_command_changes_hardly_more_than_that_of_the_best_of_many_plans(distance: float) -> None:
    """Each vehicle's program, against brute force: plans all over the box, then ever nearer to the best.

    The change is the root of the cost, of the ranges. The programs' optimum is a local one: 0.034 at 57 m.
    """
    state, rates = head_on(distance)
    model, n, lasts, weight = model_of(2), 2, np.array([DT, 0.45, 0.5]), np.array([1.0, 1e-4, 1e-4])
    view, low, high = View(state, Command.of(rates)), np.tile(LOW, (n, 1)), np.tile(HIGH, (n, 1))
    begun = model.begin(view, float(lasts.sum()), low, high)
    before, target, least, most = (
        np.repeat(u[:, None], lasts.size, axis=1) for u in (np.tile(GAMMA, (n, 1)), rates, low, high)
    )
    integrals = covered(begun, np.stack([before, least, most]), lasts[None, None])
    base = model.flow.paths(begun, integrals[0])
    made = rows(base, *model.seen(view), model.level, 0.5, furthest(begun, *integrals))
    posed = Programs(begun, model.flow, made, base, lasts, weight, before, target, low, high)

    def change(plan: np.ndarray) -> np.ndarray:
        square = ((plan - target) / (HIGH - LOW)) ** 2 * weight[:, None]
        return np.asarray(np.sqrt(square.sum(axis=(-2, -1))))

    def kept(plan: np.ndarray) -> np.ndarray:
        broken = made.displacement(posed.paths(plan), base) < made.least - 1e-6
        return np.stack([~broken[:, made.vehicle == v].any(axis=1) for v in range(n)], axis=-1)

    found = posed.plans()
    assert kept(found[None]).all() and not kept(target[None]).any()
    rng, best, spread = np.random.default_rng(6), before.copy(), 0.5
    for _ in range(8):
        tried = np.clip(best + spread * (HIGH - LOW) * rng.normal(size=(250, n, lasts.size, 3)), LOW, HIGH)
        changes = np.where(kept(tried), change(tried), np.inf)
        for v in np.flatnonzero(changes.min(axis=0) < change(best)):
            best[v] = tried[np.argmin(changes[:, v]), v]
        spread *= 0.6
    assert (change(best) < 0.02).all() and (change(before) > 0.5).all()
    assert (change(found) < change(best) + (0.03 if distance < 60 else 0.0)).all()


def test_a_start_from_which_no_plan_is_clear_is_said() -> None:
    state, rates = head_on(40.0)
    chosen = RecedingHorizonFilter(model_of(2))
    found = decided(chosen, state, rates, rates)
    assert (found.status == Status.INFEASIBLE).all() and found.residual.min() > 1
    assert chosen.record.checks["plan_clear"].failed == 1


# What is refused


@pytest.mark.parametrize(
    "make, said",
    [
        (lambda m: BackupFilter(m, beta=0.0), "beta must be positive"),
        (lambda m: BackupFilter(m, alpha=21.0), r"at most 1 / dt = 20, got 21.0 1/s"),
        (lambda m: BackupFilter(m, "mixed"), "blending is one of regulation, interpolated"),
        (lambda m: GatekeeperFilter(m, 0.01), r"a filter period \(0.05 s\) or more, got 0.01 s"),
        (lambda m: RecedingHorizonFilter(m, 0), "a plan needs a block"),
        (lambda m: RecedingHorizonFilter(m, 2, 1.0, 0.0), r"later must be in \(0, 1\]"),
        (lambda m: RecedingHorizonFilter(m, kappa=1.0), r"kappa in \(0, 1\)"),
        (lambda _: model_of(2, -1.0), "margin must be finite and not negative"),
    ],
)
def test_settings_out_of_range_are_refused(make, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        make(model_of(2))


@pytest.mark.parametrize("make", [BackupFilter, GatekeeperFilter, RecedingHorizonFilter])
def test_a_pose_that_is_no_number_is_refused(make) -> None:
    state, rates = head_on(200.0)
    broken = State(np.array([0.0, np.nan]), state.y, state.theta, state.z)
    with pytest.raises(ValueError, match="finite poses"):
        decided(make(model_of(2)), broken, rates, rates)
