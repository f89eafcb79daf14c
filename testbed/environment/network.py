"""Delayed measurements, and communication links with latency and packet loss."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from filters.model import Array, View, step
from testbed.environment.sensing import pack, unpack

Stale = Literal["hold", "extrapolate-lost", "extrapolate"]


@dataclass
class Network:
    """Every vehicle knows itself `delay` s late, and the others `latency` s later still.

    dt       s, the filter period, at which every vehicle sends its state
    loss     probability that a packet is lost, per link and step; the last one received is used instead
    stale    "hold": it is used as it stands; "extrapolate-lost": carried forward over the steps lost, along
             the arc of its rates; "extrapolate": over its whole age, delay and latency included
    central  one computer hears all vehicles over links and sees for all; otherwise each vehicle hears the
             others, and itself without a link
    At t = 0 every link has worked, and vehicles have flown straight on until then.
    All numbers are drawn whatever the loss, so that a greater loss loses the same packets and more.
    """

    vehicles: int
    dt: float
    delay: float
    latency: float
    loss: float
    stale: Stale
    central: bool
    rng: np.random.Generator
    _sent: deque[Array] = field(init=False)
    _heard: Array = field(init=False)
    _lost_for: Array = field(init=False)

    def __post_init__(self) -> None:
        self._sent = deque(maxlen=int(np.ceil((self.delay + self.latency) / self.dt - 1e-9)) + 2)

    def __call__(self, view: View) -> View:
        """What is known when `view` is measured: (N,) if all know the same, or else [observer, vehicle].

        To be called once at every filter step. Who is known is not delayed.
        """
        made = self._heard_of(view)
        return View(made.state, made.rates, view.known, None if made.shared else self._age())

    def _age(self) -> Array:
        """(N, N) s: how long ago each vehicle sent what an observer has of it."""
        lost = self._lost_for if self.loss else np.zeros((self.vehicles, self.vehicles))
        return np.asarray(np.where(np.eye(self.vehicles, dtype=bool), 0.0, self.latency + lost * self.dt))

    def _heard_of(self, view: View) -> View:
        """The poses and rates that `__call__` returns."""
        values = pack(view.own() if self.central else view)
        first = not self._sent
        self._sent.append(values)
        heard = self._aged(self.delay + self.latency)
        if not self.loss and self.stale != "extrapolate":
            if self.central or not self.latency:
                return unpack(heard)
            return unpack(self._with_own(heard, self._aged(self.delay)))
        heard = self._through_links(heard, first)
        if self.stale != "hold":
            known_late = self.delay + self.latency if self.stale == "extrapolate" else 0.0
            heard = _carried(heard, self._lost_for * self.dt + known_late)
        if self.central:
            return unpack(heard)
        own = self._aged(self.delay)
        return unpack(
            self._with_own(heard, _carried(own, self.delay) if self.stale == "extrapolate" else own)
        )

    def _aged(self, age: float) -> Array:
        """Values `age` s old, between two stored ones if need be; before the first, straight flight."""
        steps = age / self.dt
        before = int(np.ceil(steps - 1e-9))
        if before >= len(self._sent):
            late = steps - (len(self._sent) - 1)
            return _carried(self._sent[0], -late * self.dt)
        older = self._sent[-1 - before]
        share = before - steps
        if share < 1e-9:
            return older
        return older + share * (self._sent[-before] - older)

    def _through_links(self, values: Array, first: bool) -> Array:
        """The values (..., N, 7) as the links delivered them last; notes for how many steps they did not."""
        n = self.vehicles
        links = (n,) if self.central else (n, n)
        values = np.broadcast_to(values, (*links, values.shape[-1]))
        arrived = self.rng.random(links) >= self.loss
        if first:
            self._heard, self._lost_for = values, np.zeros(links)
        else:
            self._heard = np.where(arrived[..., None], values, self._heard)
            self._lost_for = np.where(arrived, 0.0, self._lost_for + 1.0)
        return self._heard

    def _with_own(self, heard: Array, own: Array) -> Array:
        """[observer, vehicle] values, what each knows of itself on the diagonal."""
        itself = np.eye(self.vehicles, dtype=bool)[..., None]
        return np.where(itself, own, heard)


def _carried(values: Array, age: Array | float) -> Array:
    """The values after flying on along the arcs of their rates for `age` s."""
    view = unpack(values)
    return pack(View(step(view.state, view.rates, age), view.rates))
