"""Fleets of 100 and 300: near pairs against all pairs, and workers against one, on all plants."""

import pytest

from tests.neighbour_runs import assert_equal_to_the_last_bit, city, flown


@pytest.mark.soak
@pytest.mark.parametrize("kind", ["limited", "centralised", "none"])
@pytest.mark.parametrize("plant", ["unicycle", "lagged", "jsbsim"])
@pytest.mark.parametrize("vehicles, duration", [(20, 5.0), (100, 3.0), (300, 1.0)])
def test_near_pairs_and_workers_change_no_bit(monkeypatch, vehicles, duration, plant, kind):
    more = {"workers": 3} if plant == "jsbsim" else {}
    s = city(vehicles, plant, kind, duration)
    workers = s.model_copy(update={"rates": s.rates.model_copy(update=more)})
    assert_equal_to_the_last_bit(flown(monkeypatch, workers, 2), flown(monkeypatch, s, 1000))
