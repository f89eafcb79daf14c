"""Makes the barriers that a scenario's [barrier] table names: one maker a kind."""

from __future__ import annotations

from collections.abc import Callable
from math import radians

import numpy as np

from filters.barriers.closed_form import StraightBarrier, TurnBarrier
from filters.barriers.euclidean import EuclideanBarrier
from filters.barriers.pairs import Barrier
from filters.barriers.per_pair import PerPair
from filters.model import Array, Command
from testbed.scenario import barrier as scenario_barrier
from testbed.scenario.scenario import Scenario


def _turn(b: scenario_barrier.Turn, s: Scenario) -> Barrier:
    return TurnBarrier(
        v=b.v_mps,
        omega=radians(b.omega_degps),
        d_safe=s.d_safe_m,
        delta=b.delta_m2,
        sigma=_per_vehicle(b.sigma, s),
        form=b.form,
        smoothing=b.smoothing_m2,
    )


def _pair_turns(b: scenario_barrier.PairTurns, s: Scenario) -> Barrier:
    return PerPair(
        tuple(
            TurnBarrier(p.v_mps, radians(p.omega_degps), s.d_safe_m, b.delta_m2, form=b.form) for p in b.pairs
        )
    )


def _straight(b: scenario_barrier.Straight, s: Scenario) -> Barrier:
    speeds = b.v_mps * (1.0 + b.speed_step * np.arange(1, s.vehicles + 1))
    return StraightBarrier(speeds, _per_vehicle(b.zeta_mps, s), s.d_safe_m, b.form)


def _rollout(b: scenario_barrier.Rollout, s: Scenario) -> Barrier:
    from filters.barriers.rollout import RolloutBarrier

    m = b.manoeuvres * (s.vehicles if len(b.manoeuvres) == 1 else 1)
    v, omega, zeta = np.array([[q.v_mps, q.omega_degps, q.zeta_mps] for q in m]).T
    return RolloutBarrier(Command(v, np.radians(omega), zeta), s.d_safe_m, form=b.form)


def _euclidean(b: scenario_barrier.Euclidean, s: Scenario) -> Barrier:
    # The Euclidean distance needs no manoeuvre; a vehicle whose QP has no solution flies this turn.
    return EuclideanBarrier(s.d_safe_m, b.form, gamma=Command.of([b.v_mps, radians(b.omega_degps), 0.0]))


def _per_vehicle(values: float | list[float], s: Scenario) -> Array:
    return np.resize(np.asarray(values, dtype=float), s.vehicles)


MAKERS: dict[type, Callable[..., Barrier]] = {
    scenario_barrier.Turn: _turn,
    scenario_barrier.PairTurns: _pair_turns,
    scenario_barrier.Straight: _straight,
    scenario_barrier.Rollout: _rollout,
    scenario_barrier.Euclidean: _euclidean,
}
