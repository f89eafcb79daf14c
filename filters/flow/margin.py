"""Bounds what the flow's samples leave open: how near a pair may come between them."""

from __future__ import annotations

import numpy as np

from filters.flow.channels import Channels
from filters.model import Array


def between_samples(least: float, channels: Channels, lower: Array, upper: Array, dt: float) -> float:
    """How near [m] a pair may come between instants dt apart at which it is at least `least` apart.

    lower, upper  (3,) or (N, 3), what the channels can be at

    A path that is accelerated by at most A leaves its chord by A dt^2 / 8 at most, and a chord of length L
    between two points at least D from a third is at least sqrt(D^2 - L^2 / 4) from it.
    """
    chord, sag = _moved(channels, lower, upper, dt)
    return float(np.sqrt(max(least**2 - 0.25 * chord**2, 0.0))) - sag


def grid_margin(d_safe: float, channels: Channels, lower: Array, upper: Array, dt: float) -> float:
    """The margin [m] with which pairs that keep it at the samples keep d_safe between them."""
    chord, sag = _moved(channels, lower, upper, dt)
    return float(np.sqrt((d_safe + sag) ** 2 + 0.25 * chord**2)) - d_safe


def _moved(channels: Channels, lower: Array, upper: Array, dt: float) -> tuple[float, float]:
    """How far [m] a pair moves against each other in dt, and how far from the chord."""
    most = np.maximum(np.abs(lower), np.abs(upper))
    fastest = np.broadcast_to(most, channels.constant.shape)
    # A channel's rate is bounded by its limit, and by what is left to go.
    rate = np.minimum(np.maximum(channels.rise, channels.fall), (upper - lower) / channels.constant)
    pull = np.sqrt(rate[:, 0] ** 2 + (fastest[:, 0] * fastest[:, 1]) ** 2 + rate[:, 2] ** 2)
    speed = np.sqrt(fastest[:, 0] ** 2 + fastest[:, 2] ** 2)
    chord = 2 * float(speed.max()) * dt
    return chord, 2 * float(pull.max()) * dt**2 / 8
