"""The second opinion on every built-in scenario, flown whole: as recorded, and recorded at every step."""

from __future__ import annotations

from pathlib import Path

import pytest

from testbed.scenario.scenario import builtin, load
from testbed.simulation.simulate import run
from tests.forgery import differing, open_

pytestmark = pytest.mark.soak


@pytest.mark.parametrize("name", builtin())
def test_it_agrees_with_every_whole_run(name: str, tmp_path: Path) -> None:
    run(load(name), tmp_path / "built-in", force=True)
    assert differing(tmp_path / "built-in") == set()
    if name == "paper-50-turn":
        return  # recorded whole, five million pairs and instants take too much memory
    run(load(name, ["record_dt_s=0.005"]), tmp_path / "whole", force=True)
    assert differing(tmp_path / "whole") == set() and open_(tmp_path / "whole") == set()
