"""Near pairs only: what is left out cannot matter, and results are those of all pairs to the last bit."""

import json
import shutil

import numpy as np
import pyarrow.parquet as parquet
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import testbed
from filters.barriers.class_k import cubic, linear
from filters.barriers.closed_form import TurnBarrier
from filters.barriers.reach import Neighbours, inverse, within
from filters.cbf.collision import CollisionFilter
from filters.model import Command, Limits, State, View
from testbed.components import catalogue
from testbed.scenario import near_pairs
from testbed.scenario.near_pairs import ABOVE, near_only, why_all
from testbed.verification.check import check
from tests.neighbour_runs import assert_equal_to_the_last_bit, city, flown

LIMITS = Limits(15.0, 25.0, np.radians(13.0), 3.9)


def limits(n: int) -> Limits:
    return Limits.of(np.repeat(LIMITS.array().reshape(1, 4), n, axis=0))


def scattered(n: int, side: float, seed: int) -> State:
    draw = np.random.default_rng(seed)
    return State(*draw.uniform(0, side, (2, n)), draw.uniform(-9, 9, n), draw.uniform(0, 60, n))


BARRIERS = {
    "plain": TurnBarrier(16.0, 0.2, 5.0),
    "rounded, to the right": TurnBarrier(16.0, -0.2, 5.0, delta=0.01),
    "smoothed, speeds apart": TurnBarrier(16.0, 0.2, 5.0, smoothing=30.0, sigma=np.linspace(0.8, 1.2, 12)),
}


@pytest.mark.parametrize("name", BARRIERS)
@settings(max_examples=30)
@given(seed=st.integers(0, 10**6), side=st.floats(50.0, 3000.0))
def test_h_and_its_rate_are_within_what_the_circles_allow(name, seed, side):
    barrier, state, n = BARRIERS[name], scattered(12, side, seed), 12
    reach, pairs = barrier.reach(n), barrier.values(state)
    centres = reach.centres(state)
    apart = np.linalg.norm(centres[pairs.i] - centres[pairs.j], axis=-1)
    assert all(h >= reach.least_h(d) - 1e-9 for h, d in zip(pairs.h, apart, strict=True))
    assert reach.least_h(reach.apart(7.0)) >= 7.0
    far = pairs.h > 5.0
    low, high = limits(n).corners
    most = sum(
        np.maximum(np.abs(lie * low[who]), np.abs(lie * high[who])).sum(axis=-1)
        for lie, who in zip(pairs.lie(state), (pairs.i, pairs.j), strict=True)
    )
    assert (most[far] <= 2 * reach.rate(high[:, 0], high[:, 1], high[:, 2])).all()


@pytest.mark.parametrize("alpha", [cubic(0.1), linear(20.0), cubic(1e-3)])
def test_the_inverse_of_alpha_is_where_alpha_has_that_value(alpha):
    h = inverse(alpha, 50.0)
    assert alpha(h) >= 50.0 and alpha(h * (1 - 1e-9)) < 50.0
    assert inverse(linear(1e-9), 50.0) == np.inf


def test_all_pairs_within_a_distance_are_found_in_the_order_of_all_pairs():
    places = np.random.default_rng(1).uniform(0, 100, (60, 2))
    i, j = within(places, 20.0)
    a, b = np.triu_indices(60, 1)
    due = np.linalg.norm(places[a] - places[b], axis=-1) <= 20.0
    np.testing.assert_array_equal(i, a[due])
    np.testing.assert_array_equal(j, b[due])


@pytest.mark.parametrize("mode", ["centralised", "limited"])
@pytest.mark.parametrize("n, side", [(20, 500.0), (100, 1200.0), (300, 3000.0)])
def test_a_filter_of_near_pairs_gives_the_commands_of_all_to_the_last_bit(mode, n, side):
    barrier, alpha, box = TurnBarrier(16.0, 0.2, 5.0, delta=0.01), cubic(0.1), limits(n)
    near = Neighbours(barrier.reach(n), barrier.reach(n).binding(alpha, box, barrier.manoeuvre(n)))
    state, draw = scattered(n, side, n), np.random.default_rng(n)
    wanted = Command(draw.uniform(15, 25, n), draw.uniform(-0.2, 0.2, n), draw.uniform(-3, 3, n))
    whole = CollisionFilter(barrier, alpha, mode)(View(state, wanted), wanted, box)
    some = CollisionFilter(barrier, alpha, mode, near=near)(View(state, wanted), wanted, box)
    for name in ("status", "residual", "override", "deviation"):
        np.testing.assert_array_equal(getattr(some, name), getattr(whole, name))
    np.testing.assert_array_equal(some.command.array(), whole.command.array())
    assert some.override.any() and some.pairs.h.size < whole.pairs.h.size / 2
    i, j = some.pairs.i, some.pairs.j
    at = (i * (2 * n - i - 1)) // 2 + j - i - 1
    np.testing.assert_array_equal(some.pairs.h, whole.pairs.h[at])
    np.testing.assert_array_equal(some.pairs.grad, whole.pairs.grad[at])
    np.testing.assert_array_equal(some.hdot_predicted, whole.hdot_predicted[at])


@pytest.mark.parametrize(
    "vehicles, plant, kind",
    [
        (20, "unicycle", "limited"),
        (20, "lagged", "centralised"),
        (20, "unicycle", "none"),
        (8, "jsbsim", "limited"),
    ],
)
def test_a_run_judged_by_near_pairs_is_that_of_all_pairs_to_the_last_bit(monkeypatch, vehicles, plant, kind):
    s = city(vehicles, plant, kind, 0.25 if plant == "jsbsim" else 1.0, 100e-6)
    assert_equal_to_the_last_bit(flown(monkeypatch, s, 2), flown(monkeypatch, s, 1000))


def test_of_two_vehicles_far_from_all_others_the_nearest_is_still_judged(monkeypatch):
    s = city(8, "unicycle", "none", 0.5, 1e-7)  # kilometres apart
    near, whole = flown(monkeypatch, s, 2), flown(monkeypatch, s, 1000)
    assert [v.to_json() for v in near.guarantees] == [v.to_json() for v in whole.guarantees]
    assert not len(near.pairs)


def test_a_filter_of_ones_own_around_the_catalogues_is_shown_all_pairs(monkeypatch):
    monkeypatch.setattr(near_pairs, "ABOVE", 2)
    parts = testbed.Parts(filter=lambda s, barrier, goal: catalogue.filter_(s, barrier, goal))
    run = testbed.run(city(8, "unicycle", "limited", 0.25, 100e-6), force=True, parts=parts)
    assert run.manifest["ended_early"] is None and "near_pairs" not in run.manifest
    assert len(run.pairs) == 6 * 28


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        out = tmp_path_factory.mktemp("near") / "run"
        flown(patch, city(20, "unicycle", "limited", 1.0, 100e-6), 2, out)
        return out


def test_a_record_of_near_pairs_is_verified(folder):
    found = {f.what: f for f in check(folder).findings}
    assert found["near_pairs"].agrees
    assert [f.what for f in found.values() if f.agrees is False] == []


@pytest.mark.parametrize("forged", ["a row is missing", "h_m is smaller"])
def test_a_forged_record_of_near_pairs_is_found(folder, tmp_path, forged):
    copy = shutil.copytree(folder, tmp_path / "run")
    table = parquet.read_table(copy / "pairs.parquet")
    if forged == "a row is missing":
        kept = [k for k in range(table.num_rows) if k != 7]
        parquet.write_table(table.take(kept), copy / "pairs.parquet")
    else:
        manifest = json.loads((copy / "manifest.json").read_text())
        manifest["near_pairs"]["h_m"] = 9.0
        (copy / "manifest.json").write_text(json.dumps(manifest))
        parquet.write_table(
            table.filter([h <= 9.0 for h in table["h_m"].to_pylist()]), copy / "pairs.parquet"
        )
    found = {f.what: f for f in check(copy).findings}
    assert found["near_pairs"].agrees is False


def test_which_runs_look_at_near_pairs_only():
    assert near_only(city(ABOVE + 1, "unicycle", "limited", 1.0))
    assert not near_only(city(ABOVE, "unicycle", "limited", 1.0))
    many = ABOVE + 1, "unicycle", "limited", 1.0
    assert why_all(city(*many, barrier={"kind": "straight"})) == "barrier"
    assert why_all(city(*many, alpha={"kind": "linear"})) == "alpha"
    assert why_all(city(*many, sensing={"position_noise_m": 1.0})) == "sensing"
    assert why_all(city(*many, checks={"manoeuvre_instants": 2})) == "checks.manoeuvre_instants"
