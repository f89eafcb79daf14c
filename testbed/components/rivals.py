"""Makes the rivals whose plans end in the evading manoeuvre: backup, gatekeeper, receding horizon."""

from __future__ import annotations

from collections.abc import Sequence

from filters.barriers.pairs import Barrier
from filters.filter import Filter
from filters.flow.channels import Lag
from testbed.errors import UserError
from testbed.scenario import control, fleet
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
    assert isinstance(said, control.Backup | control.Gatekeeper | control.RecedingHorizon)
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
            case control.Backup():
                return BackupFilter(model, said.blending, said.beta_per_m, said.alpha_per_s)
            case control.Gatekeeper():
                return GatekeeperFilter(model, said.horizon_s)
            case control.RecedingHorizon():
                return RecedingHorizonFilter(model, said.blocks, said.block_s, said.later_weight, said.kappa)
    except ValueError as error:
        raise UserError(f"filter: {error}") from None
