"""Makes the rival filters that a scenario names."""

from __future__ import annotations

from collections.abc import Sequence

from filters.barriers.class_k import OddPolynomial
from filters.barriers.pairs import Barrier
from filters.cbf.intruders import Intruders
from filters.filter import Filter
from filters.flow.channels import Lag
from testbed.errors import UserError
from testbed.scenario import fleet
from testbed.scenario import rivals as kinds
from testbed.scenario.scenario import Scenario


def plans_filter(s: Scenario, b: Barrier, lags: Sequence[Sequence[Lag]]) -> Filter:
    """The filter of a scenario whose [filter] is one of them.

    lags  of the vehicles' channels
    Raises  UserError for a scenario that it cannot filter
    """
    from filters.rivals.backup import BackupFilter
    from filters.rivals.gatekeeper import GatekeeperFilter
    from filters.rivals.plans import Model
    from filters.rivals.receding_horizon import RecedingHorizonFilter

    said = s.filter
    assert isinstance(said, kinds.Backup | kinds.Gatekeeper | kinds.RecedingHorizon)
    for what, there in (("fences", bool(s.fence)), ("intruders", bool(fleet.intruders(s)))):
        if there:
            raise UserError(f"filter.kind: {said.kind!r} knows no {what}; 'centralised' and 'limited' do")
    for name in ("latency_s", "loss"):
        if getattr(s.network, name):
            raise UserError(f"network.{name}: the filter {said.kind!r} needs poses and plans at once; set 0")
    gamma = b.manoeuvre(s.vehicles)
    if gamma is None:
        raise UserError(
            f"filter.kind: {said.kind!r} needs one evading manoeuvre, and this barrier has none for all"
        )
    try:
        model = Model(lags, gamma, s.d_safe_m, s.rates.filter_dt_s, said.margin_m, said.trust)
        match said:
            case kinds.Backup():
                return BackupFilter(model, said.blending, said.beta_per_m, said.alpha_per_s)
            case kinds.Gatekeeper():
                return GatekeeperFilter(model, said.horizon_s)
            case kinds.RecedingHorizon():
                return RecedingHorizonFilter(model, said.blocks, said.block_s, said.later_weight, said.kappa)
    except ValueError as error:
        raise UserError(f"filter: {error}") from None


def rival(s: Scenario, b: Barrier, alpha: OddPolynomial, intruders: Intruders | None) -> Filter:
    """The rival filter of the scenario.

    b          the barrier that the filter keeps, with the remedies' Ds
    intruders  who is not under the filter; None without
    Raises  UserError where the scenario has what the filter does not know.
    """
    if s.fence:
        raise UserError(f"filter.kind: {s.filter.kind!r} knows no fences; 'centralised' and 'limited' do")
    match s.filter:
        case kinds.CollisionCone() as said:
            from filters.rivals.collision_cone import CollisionConeFilter

            response = said.speed_response_s, said.climb_response_s
            return CollisionConeFilter(b.d_safe, said.decay_per_s, *response, said.range_m, said.cost)
        case kinds.OptimalDecay() as said:
            from filters.rivals.optimal_decay import OptimalDecayFilter

            return OptimalDecayFilter(b, alpha, said.decay_weight, said.cost, intruders)
        case kinds.VelocityObstacles() as said:
            from filters.rivals.velocity_obstacles import VelocityObstacleFilter

            passive = () if intruders is None else tuple(intruders.vehicles)
            return VelocityObstacleFilter(
                b.d_safe,
                said.horizon_s,
                said.response_s,
                said.responsibility,
                said.range_m,
                said.space,
                passive,
            )
    raise ValueError(f"filter {s.filter.kind!r} is no rival")
