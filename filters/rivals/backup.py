"""Blends the nominal command with a backup manoeuvre in closed form: a backup control barrier function.

The backup is gamma, flown by vehicles that lag. h_backup of a vehicle is the least distance to any other
along the flow of gamma, less Ds. The command is u = (1 - mu) u_nominal + mu gamma, with mu from one of

- "regulation": mu = exp(-beta max(h_backup, 0)). Singletary, Swann, Chen & Ames, "Onboard safety guarantees
  for racing drones", IEEE RA-L 7 (2022), the regulation function;
- "interpolated": the smallest mu with which the barrier condition holds at every point of the backup's flow,
  which is linear in mu. van Wijk, Das, Molnar, Ames & Burdick, "Safety-critical control with bounded inputs:
  a closed-form solution for backup control barrier functions" (2025, arXiv 2510.05436).

Premises: the vehicles follow the model; all start with h_backup >= 0; time is continuous. Here a command is
held for a period, in which h_backup may be used up by what the law allows at its beginning. From h_backup < 0
the regulation function flies gamma for ever; neither law seeks a way back.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from filters.cbf.problem import Problem, input_set
from filters.constraints import Indices
from filters.filter import Check, Decision, Declaration, MonitorRecord
from filters.flow.flow_filter import flow_checks
from filters.flow.phases import Phases
from filters.flow.reach import furthest
from filters.flow.rollout import Begun, Paths
from filters.flow.separation import Kept, rows, samples
from filters.model import Array, Command, Limits, View
from filters.qp.single import Status
from filters.rivals.plans import Model, Tracks, nearest

Blending = Literal["regulation", "interpolated"]
# exp(-beta h) below this is no part of a command [1].
_NOTHING = 1e-12


def regulation(h: Array, beta: float) -> Array:
    """mu of the regulation function: the backup's share where the least clearance is h.

    Source  Singletary et al. 2022: 1 - mu is their lambda.
    """
    return np.asarray(np.exp(-beta * np.maximum(h, 0.0)))


def interpolation(nominal: Array, backup: Array, allowed: Array) -> Array:
    """The smallest mu (...,) in [0, 1] with (1 - mu) nominal + mu backup >= allowed in all rows.

    nominal, backup  (..., R) hdot of each row under the two controllers
    allowed          (..., R) -alpha(h) of each row
    1 where there is none. Rows that the backup makes no better are left out, as by the authors.
    Source  van Wijk et al. 2025: the solution of their QP in mu alone.
    """
    gain = backup - nominal
    helps = gain > 0
    needed = np.where(helps, (allowed - nominal) / np.where(helps, gain, 1.0), 0.0)
    return np.asarray(np.clip(needed.max(axis=-1, initial=0.0), 0.0, 1.0))


def backup_checks() -> dict[str, Check]:
    """What the filter watches at every step: the flow filter's first claim, for the same flow."""
    return {"flow_clear": flow_checks()["flow_clear"]}


class BackupFilter:
    """Blends every vehicle's nominal command with gamma, each for itself.

    model     of the vehicles; its margin is kept by h_backup beyond Ds
    blending  see the module
    beta      1/m, of the regulation function
    alpha     1/s, of the interpolation: alpha(h) = alpha h; alpha dt <= 1
    Raises    ValueError for numbers out of these ranges

    The condition of the interpolation is posed for a sampled system: the flow of one period of the nominal
    command, then gamma, is compared with gamma's at the same instants, and each vehicle of a pair answers for
    half of what the pair may lose, so that none needs to know what the other chooses.
    """

    def __init__(
        self, model: Model, blending: Blending = "interpolated", beta: float = 0.3, alpha: float = 2.0
    ) -> None:
        if blending not in get_args(Blending):
            raise ValueError(f"blending is one of {', '.join(get_args(Blending))}, not {blending!r}")
        if not (np.isfinite(beta) and beta > 0):
            raise ValueError(f"beta must be positive and finite, got {beta} 1/m")
        share = alpha * model.flow.dt
        if not 0 < share <= 1:
            raise ValueError(
                f"alpha must be positive and at most 1 / dt = {1 / model.flow.dt:g}, got {alpha} 1/s"
            )
        self._model, self._blending, self._beta = model, blending, beta
        self._turn = float(model.flow.gamma[0, 1]) * model.flow.dt
        self._phases, self._share = Phases(abs(self._turn)), share
        self.record = MonitorRecord(checks=backup_checks())

    @property
    def declaration(self) -> Declaration:
        """It solves no QP; its h is of the flow, not of poses."""
        return Declaration(record=self.record)

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision:
        """The blended commands (N,), inside the limits.

        Raises  ValueError if a nominal command or what is seen is not finite
        """
        problem = Problem(*input_set(view, nominal, limits))
        model, n = self._model, len(problem.target)
        wish, lower, upper = problem.clipped, problem.lower, problem.upper
        gamma = np.minimum(np.maximum(model.flow.gamma, lower), upper)
        begun = model.begin(view, model.flow.dt, lower, upper)
        base = model.flow.roll(begun, gamma)
        i, j = model.seen(view)
        if self._blending == "regulation":
            enough = model.level - np.log(_NOTHING) / self._beta
            tracks = Tracks.of(base)
            clear = nearest(tracks, i, tracks, j, enough) - model.level
            least = np.full(n, np.inf)
            for vehicle in (i, j):
                np.minimum.at(least, vehicle, clear)
            share = regulation(least, self._beta)
        else:
            share, clear = self._interpolated(begun, base, gamma, problem, i, j)
        self.record.checks["flow_clear"].see(self.record.steps, clear, i, j)
        self.record.steps += 1
        u = wish + share[:, None] * (gamma - wish)
        model.told(u)
        none = np.full(n, int(Status.NONE))
        return problem.decision(u, none, np.zeros(n), None, np.zeros(0))

    def _interpolated(
        self, begun: Begun, base: Paths, gamma: Array, problem: Problem, i: Indices, j: Indices
    ) -> tuple[Array, Array]:
        """mu (N,), and the pairs' clearances (P,) m on gamma's flow."""
        flow, n = self._model.flow, len(gamma)
        inputs = np.stack([gamma, problem.lower, problem.upper, problem.clipped])
        covered = flow.covered(begun, inputs)
        wish = flow.paths(begun, covered[3])
        moves = furthest(begun, *covered[:3])
        turned = self._turn * (self.record.steps + begun.times.size)
        kept = Kept(self._model.level, self._share, self._phases, turned)
        found = samples(base, i, j, kept, moves)
        made = rows(found, kept, moves)
        moved = made.displacement(wish, base)
        needed = interpolation(moved[:, None], np.zeros((moved.size, 1)), made.least[:, None])
        share = np.zeros(n)
        np.maximum.at(share, made.vehicle, needed)
        return share, found.least - self._model.level
