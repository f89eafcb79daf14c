"""Draws the random fields of a campaign's runs.

Each field of each run has a generator of its own, from the run's seed and the field's name. So a field that
is added changes no other, equal seeds have equal draws in every cell, and the streams that the run itself
draws from (`testbed.components.initial_conditions.STREAMS`) stay as they are.
"""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np

from testbed.campaigns.file import Distribution


def generator(seed: int, path: str) -> np.random.Generator:
    name = int.from_bytes(hashlib.sha256(f"campaign {path}".encode()).digest()[:8], "big")
    return np.random.default_rng(np.random.SeedSequence([seed, name]))


def draw(d: Distribution, seed: int, path: str) -> Any:
    """The value of the field at `path` in the run of `seed`: a plain number, or one of the choices."""
    rng = generator(seed, path)
    if d.choice is not None:
        return d.choice[int(rng.integers(len(d.choice)))]
    if d.integers is not None:
        return int(rng.integers(d.integers[0], d.integers[1], endpoint=True))
    if d.uniform is not None:
        return float(rng.uniform(d.uniform[0], d.uniform[1]))
    if d.loguniform is not None:
        return float(np.exp(rng.uniform(*np.log(d.loguniform))))
    assert d.normal is not None
    mean, deviation = d.normal
    if d.low is None and d.high is None:
        return float(rng.normal(mean, deviation))
    from scipy.stats import truncnorm

    low = -np.inf if d.low is None else (d.low - mean) / deviation
    high = np.inf if d.high is None else (d.high - mean) / deviation
    return float(truncnorm.rvs(low, high, mean, deviation, random_state=rng))
