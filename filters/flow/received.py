"""Keeps the flows that vehicles have sent, and says where each expects the others by what it has received.

A packet tells where its sender flies if it evades from then on: its flow under gamma. Whoever has not heard
anything since expects it there, whatever was commanded meanwhile. The sender's own rows bound how far it may
leave that flow towards the other: by a share kappa / 2 of the clearance in a period.
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from filters.constraints import Indices
from filters.flow.rollout import Flow, Paths
from filters.model import Array


class Received:
    """The flows sent at each period, as long as somebody still has to go by them."""

    def __init__(self, flow: Flow) -> None:
        self._turn = float(flow.gamma[0, 1]) * flow.dt
        self._dt = flow.dt
        self._sent: dict[int, Paths] = {}
        self._step = -1

    def images(self, own: Paths, observer: Indices, vehicle: Indices, age: Array) -> Paths:
        """Where each observer expects a vehicle (P,), at the instants of `own`.

        own   paths (N, M) of all vehicles under gamma, by what each knows of itself now
        age   (N, N) s, since the vehicle sent what the observer heard last; at the first call all know all

        To be called once a period.
        """
        self._step = now = self._step + 1
        self._sent[now] = own
        old = np.minimum(np.ceil(age / self._dt - 1e-9).astype(int), now)
        periods = old[observer, vehicle]
        both = np.empty((vehicle.size, own.z.shape[-1]), dtype=complex)
        made = Paths(both, both.real.copy(), both[:, 0].copy(), both[:, 0].copy(), both.real.copy())
        for a in np.unique(periods).tolist():
            who = np.flatnonzero(periods == a)
            then = self._since(self._sent[now - a], vehicle[who], a, own.z.shape[-1])
            for x in fields(Paths):
                getattr(made, x.name)[who] = getattr(then, x.name)
        # Nothing else will be asked for: a link's packets only become newer, or older by one period.
        links = np.unique(old[~np.eye(len(old), dtype=bool)]).tolist()
        wanted = {now - a for a in links}
        self._sent = {k: v for k, v in self._sent.items() if k in wanted or k >= now - min(links, default=0)}
        return made

    def _since(self, sent: Paths, vehicle: Indices, age: int, instants: int) -> Paths:
        """Paths of some vehicles sent `age` periods ago, from now on."""
        last = sent.z.shape[-1] - 1
        k = age + np.arange(instants)
        early, late = np.minimum(k, last), self._turn * np.maximum(k - last, 0)
        centre, arm = sent.centre[vehicle], sent.arm[vehicle]
        row = vehicle[:, None]
        at = np.where(k > last, centre[:, None] + arm[:, None] * np.exp(1j * late), sent.at[row, early])
        # If the circle has not begun at the last of the instants, `arm` is that of a later one.
        arm = arm * np.exp(1j * self._turn * (k[-1] - last))
        return Paths(at, sent.z[row, early], centre, arm, sent.turned[row, early] + late)
