"""The page of measurements says what its data says."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from benchmarks import report


def test_the_page_is_made_from_its_data() -> None:
    found = json.loads(report.DATA.read_text(encoding="utf-8"))
    assert report.PAGE_FILE.read_text(encoding="utf-8") == report.page(found, report.rows(found))


@pytest.mark.parametrize(
    ("value", "at_most", "holds"), [(1.0, True, True), (1.1, True, False), (1.1, False, True)]
)
def test_a_row_holds_on_its_own_side_of_the_target(value: float, at_most: bool, holds: bool) -> None:
    assert report.Row("x", value, 1.0, at_most=at_most).holds is holds
