"""How often intervals of rare-event estimates hold known probabilities: 500 repetitions, some minutes."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

FILE = Path(__file__).parent.parent.parent / "docs" / "rare_tables.py"


@pytest.mark.soak
@pytest.mark.parametrize("method", ["importance", "subset"])
@pytest.mark.parametrize("probability", [1e-4, 1e-6])
def test_intervals_cover_93_percent_of_500(method: str, probability: float) -> None:
    spec = importlib.util.spec_from_file_location("rare_tables", FILE)
    assert spec is not None and spec.loader is not None
    tables = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tables)
    for case in tables.CASES:
        (row,) = tables.joined([{k: str(v) for k, v in tables.row(method, case, probability, 500).items()}])
        print(row)
        assert float(str(row["covered"]).partition(" ")[0]) >= 93.0, row
        if (method, case) != ("importance", "sphere"):  # no mixture of two is near a sphere
            assert float(str(row["times fewer than plain"])) >= 10.0, row
