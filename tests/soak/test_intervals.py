"""How often the intervals of identified channels hold what is true: 200 plants of each kind, some minutes."""

from __future__ import annotations

import numpy as np
import pytest

from aircraft.autopilots.channel_family import choose
from tests.test_channel_family import TRUE, noisy


@pytest.mark.soak
@pytest.mark.parametrize("kind", ["first order", "second order", "tracked loop"])
def test_nine_of_ten_intervals_hold_the_true_value(kind: str) -> None:
    held: dict[str, list[bool]] = {}
    chosen = 0
    for seed in range(200):
        rng = np.random.default_rng(20_000 + seed)
        fits, checks = (noisy(kind, rng, n, [2.0, 3.9, -1.5]) for n in (9, 3))
        best, tried = choose("zeta", fits, checks)
        chosen += best.kind == kind
        mine = next(f for f in tried if f.kind == kind)
        for name, low in mine.low.items():
            if name not in ("falls", "rises"):
                held.setdefault(name, []).append(low <= TRUE[kind][name] <= mine.high[name])
    print(kind, f"chosen {chosen} of 200;", {k: f"{sum(v)} of {len(v)}" for k, v in held.items()})
    assert chosen > 150
    for name, seen in held.items():
        # 0.9 with a standard error of 0.02
        assert len(seen) > 190 and 0.82 < np.mean(seen) < 0.97, (name, np.mean(seen))
