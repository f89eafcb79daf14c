"""Ready campaigns that bring an airframe of their own find it from anywhere, and its lags are its own."""

import pytest

from aircraft.airframe import load
from aircraft.autopilots.freshness import stale_lags
from testbed.campaigns import plan
from testbed.campaigns.bases import bases
from testbed.campaigns.file import load as load_campaign
from testbed.scenario.location import path_of


def data_of(name):
    """Plain data of each cell of a campaign."""
    campaign, folder = load_campaign(name)
    made = plan.expand(campaign, bases(campaign, folder), "code")
    return [made.varied(cell, 0) for cell in made.cells]


def test_the_slow_autopilot_is_found_from_another_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    data = data_of("slow-loops")
    slow = [d for d in data if d["airframes"] != ["x8"]]
    assert len(slow) == len(data) / 2
    airframe = load(path_of(slow[0]["airframes"][0], slow[0]["airframes_folder"]))
    bandwidths = [airframe.gains[s]["bandwidth_radps"] for s in ("turn", "climb", "speed")]
    assert bandwidths == [3.6, 0.8, 0.6]
    assert stale_lags(airframe) is None
    own = load("x8").identified
    assert all(
        getattr(airframe.identified, c).time_constant_s > 2 * getattr(own, c).time_constant_s
        for c in ("v", "omega", "zeta")
    )


def test_late_sensors_differ_in_nothing_but_the_age_of_measurements():
    cells = data_of("late-sensors")
    ages = [data["sensing"]["delay_s"] for data in cells]
    assert sorted(ages) == [0.0, 0.0, 0.12, 0.12]
    for data in cells:
        data["sensing"]["delay_s"] = 0.0
    assert cells[0] == cells[2] and cells[1] == cells[3]


@pytest.mark.parametrize("name", ["late-sensors", "slow-loops", "finite-range"])
def test_encounters_are_fresh(name):
    assert min(load_campaign(name)[0].seed_list) > 1000
