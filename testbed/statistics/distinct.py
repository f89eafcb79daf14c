"""Counts runs that differ: equal runs are one run, however many seeds they have."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any


def distinct(results: Iterable[Any]) -> int:
    """How many of `results` (plain data, one entry a run: numbers, words, lists, dictionaries) differ.

    Seed and identity of a run are not results: leave them out. A missing number equals a missing number.
    """
    return len({json.dumps(result, sort_keys=True, default=str) for result in results})


def nothing_random(seeds: int) -> str:
    """What a campaign says that would fly one run `seeds` times."""
    return f"{seeds} seeds, nothing random: add [random], or seeds = 1"
