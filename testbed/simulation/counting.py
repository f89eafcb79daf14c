"""Makes the statistics that a run needs, begun at its start."""

from __future__ import annotations

from collections.abc import Container

from testbed.components.border.others import OwnFilter
from testbed.measures.between_samples import ArcApproach
from testbed.measures.declared_barrier import DeclaredBarrier
from testbed.measures.declared_rows import DeclaredRows
from testbed.measures.fence_statistics import FenceStatistics
from testbed.measures.near_misses import NearMisses
from testbed.measures.progress import progress_of
from testbed.measures.run_statistics import RunStatistics
from testbed.measures.saturation import Saturation
from testbed.measures.track_error import TrackErrors
from testbed.scenario.guidance_rules import follow_tracks
from testbed.simulation.assembly import Assembled, Setting
from testbed.simulation.near_pairs import NearPairs


def counted(
    setting: Setting, made: Assembled | None, own: Container[str], near: NearPairs | None
) -> RunStatistics:
    """The statistics of a run, with the positions at its start taken in.

    made  None where a part could not be made
    own   the parts that are not the scenario's
    near  chooses the pairs that are looked at; None: all are
    """
    s = setting.scenario
    near_misses = NearMisses(setting.i.size, s.d_safe_m) if made and made.replay else None
    arcs = ArcApproach(setting.i, setting.j, s.d_safe_m) if made and made.arcs else None
    fenced = None
    if setting.fences is not None:
        steps = s.rates.fdm_steps, s.rates.fdm_dt_s
        fenced = FenceStatistics(setting.fences, setting.start, bool(made and made.arcs), *steps)
    surfaces = Saturation(made.aircraft if made else ())
    found = RunStatistics(s.vehicles, surfaces, near_misses, arcs=arcs, fences=fenced, roles=setting.roles)
    found.progress = progress_of(s, setting.start.position, setting.goal)
    if follow_tracks(s) and "nominal" not in own:
        found.tracks = TrackErrors(s)
    if made and isinstance(made.filter, OwnFilter):
        found.foreign = True
        found.declared = DeclaredRows(setting.limits) if made.filter.declares else None
        if (said := made.filter.declared) and setting.i.size:
            found.own = DeclaredBarrier(setting.i.size, "alpha" in said)
    if near is not None:
        found.take(*near.at_start(setting.start))
    found.start(setting.start.position, setting.goal, s.goal_radius_m)
    return found
