"""The contract of filters, over every kind of the catalogue; and what a catalogue filter may not be given."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from filters.filter import Decision
from filters.model import Command, Limits, State, View
from filters.qp.single import Status
from testbed.components import catalogue
from testbed.errors import UserError
from testbed.scenario.scenario import Scenario, load

KINDS = tuple(catalogue.FILTERS)
# The navigation function flies at one speed whatever is wanted, and towards its own goals.
STEERS = ("navigation",)
# One QP over all vehicles, or rows of the ordered pair i < j: equal under permutation to its solver.
TOLERANCE = 1e-6
FAR_M = 5000.0


def scenario(kind: str, n: int, *more: str) -> Scenario:
    settings = [f'filter.kind="{kind}"', f"vehicles={n}", "rates.filter_dt_s=0.05", "rates.record_dt_s=0.05"]
    # The paper's rounding of the kink tells a pair's first vehicle from its second; the smoothing does not.
    return load("paper-2-turn", [*settings, "barrier.delta_m2=0", "barrier.smoothing_m2=30", *more])


def made(kind: str, n: int, *more: str) -> tuple[Any, Limits]:
    """The filter of that kind for n vehicles, new, and their limits."""
    s = scenario(kind, n, *more)
    goal = np.zeros((n, 3))
    goal[:, 0] = 100.0 * np.cos(np.arange(n))
    return catalogue.filter_(s, catalogue.barrier(s), goal), catalogue.limits(s)


def crowd(n: int, seed: int, radius: float = 150.0) -> tuple[View, Command]:
    """n vehicles at random places and courses, at random rates, with random wishes beyond the limits."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-radius, radius, (2, n))
    state = State(x, y, rng.uniform(-np.pi, np.pi, n), rng.uniform(-8.0, 8.0, n))
    rates = Command(rng.uniform(15, 25, n), rng.uniform(-0.2, 0.2, n), rng.uniform(-3, 3, n))
    wanted = Command(rng.uniform(12, 28, n), rng.uniform(-0.4, 0.4, n), rng.uniform(-5, 5, n))
    return View(state, rates), wanted


def numbers(decision: Decision) -> np.ndarray:
    return decision.command.array()


# Fifty of those that fly a model ahead take seconds.
AHEAD = ("flow", "backup", "gatekeeper", "receding-horizon")
COUNTS = [
    pytest.param(kind, n, marks=pytest.mark.soak if n == 50 and kind in AHEAD else ())
    for kind in KINDS
    for n in (1, 2, 7, 50)
]


@pytest.mark.parametrize(("kind", "n"), COUNTS)
def test_a_decision_has_its_shapes_and_its_commands_are_finite_and_inside_the_limits(
    kind: str, n: int
) -> None:
    chosen, limits = made(kind, n)
    view, wanted = crowd(n, seed=n)
    d = chosen(view, wanted, limits)
    assert (
        d.command.shape == d.status.shape == d.residual.shape == d.override.shape == d.deviation.shape == (n,)
    )
    assert np.isfinite(numbers(d)).all() and limits.contains(d.command).all()
    assert np.isfinite(d.residual).all() and (d.residual >= 0).all()
    assert np.isin(d.status, [int(s) for s in Status]).all()
    beyond = np.abs(numbers(d) - limits.clip(wanted).array()).max(-1)
    assert np.allclose(d.deviation, beyond, atol=1e-12)
    assert (d.override == (d.deviation > 1e-6)).all()
    if d.pairs is not None:
        assert d.pairs.h.shape == d.hdot_predicted.shape == (n * (n - 1) // 2,)


@pytest.mark.parametrize("kind", KINDS)
def test_coincident_and_colliding_vehicles_get_commands_without_nan(kind: str) -> None:
    chosen, limits = made(kind, 4)
    state = State(
        np.array([0.0, 0.0, 1.0, 3.0]),
        np.zeros(4),
        np.array([0.0, np.pi, 0.0, 0.0]),
        np.array([0, 0, 0, 5.0]),
    )
    view = View(state, Command(np.full(4, 20.0), np.zeros(4), np.zeros(4)))
    with np.errstate(all="raise", under="ignore"):
        d = chosen(view, Command(np.full(4, 20.0), np.zeros(4), np.zeros(4)), limits)
    assert np.isfinite(numbers(d)).all() and limits.contains(d.command).all()


@pytest.mark.parametrize("kind", [k for k in KINDS if k not in STEERS])
def test_where_nobody_is_near_what_is_wanted_passes_unchanged(kind: str) -> None:
    chosen, limits = made(kind, 5)
    view, wanted = crowd(5, seed=3)
    spread = State(FAR_M * np.arange(5.0), view.state.y, view.state.theta, view.state.z)
    d = chosen(View(spread, view.rates), wanted, limits)
    assert np.array_equal(numbers(d), limits.clip(wanted).array()) and not d.override.any()


@pytest.mark.parametrize("kind", [k for k in KINDS if k not in STEERS])
@pytest.mark.parametrize("seed", [2])
def test_vehicles_in_another_order_get_the_same_commands(kind: str, seed: int) -> None:
    (first, limits), (second, _) = made(kind, 4), made(kind, 4)
    view, wanted = crowd(4, seed, radius=45.0)
    order = np.random.default_rng(seed).permutation(4)
    there = second(View(view.state[order], view.rates[order]), wanted[order], limits)
    assert np.allclose(numbers(first(view, wanted, limits))[order], numbers(there), atol=TOLERANCE)


@pytest.mark.parametrize("kind", [k for k in KINDS if k not in STEERS])
def test_a_rotated_and_shifted_encounter_gets_the_same_commands(kind: str) -> None:
    (first, limits), (second, _) = made(kind, 4), made(kind, 4)
    view, wanted = crowd(4, seed=5, radius=45.0)
    turned = np.exp(1j * 0.7) * (view.state.x + 1j * view.state.y) + (300.0 - 200.0j)
    state = State(turned.real, turned.imag, view.state.theta + 0.7, view.state.z + 20.0)
    there = second(View(state, view.rates), wanted, limits)
    assert np.allclose(numbers(first(view, wanted, limits)), numbers(there), atol=TOLERANCE)


# Kinds whose rule has no hand: the mirror image of an encounter is answered by the mirrored commands. The
# others evade by turning to one side, that of the scenario's manoeuvre.
MIRRORED = ("collision-cone", "velocity-obstacles", "none")


@pytest.mark.parametrize("kind", MIRRORED)
def test_a_mirrored_encounter_gets_mirrored_commands(kind: str) -> None:
    (first, limits), (second, _) = made(kind, 4), made(kind, 4)
    view, wanted = crowd(4, seed=7, radius=45.0)
    s, r = view.state, view.rates
    image = View(State(s.x, -s.y, -s.theta, s.z), Command(r.v, -r.omega, r.zeta))
    there = second(image, Command(wanted.v, -wanted.omega, wanted.zeta), limits)
    mirrored = numbers(there) * np.array([1.0, -1.0, 1.0])
    assert np.allclose(numbers(first(view, wanted, limits)), mirrored, atol=TOLERANCE)


@pytest.mark.parametrize("kind", [k for k in KINDS if k not in ("centralised", "limited")])
@pytest.mark.parametrize("wish", [np.nan, np.inf])
def test_a_wish_that_is_no_number_is_refused(kind: str, wish: float) -> None:
    chosen, limits = made(kind, 2)
    view, _ = crowd(2, seed=1)
    with pytest.raises(ValueError, match="nominal command of vehicle 2"):
        chosen(view, Command(np.array([20.0, wish]), np.zeros(2), np.zeros(2)), limits)


RIVALS = tuple(k for k in KINDS if k not in ("centralised", "limited", "navigation", "none"))


@pytest.mark.parametrize("kind", RIVALS)
def test_a_fence_is_refused(kind: str) -> None:
    s = load("fenced-corridor", [f'filter.kind="{kind}"'])
    with pytest.raises(UserError, match=f"'{kind}' knows no fences"):
        catalogue.filter_(s, catalogue.barrier(s), np.zeros((s.vehicles, 3)))
