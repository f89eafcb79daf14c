"""The versions promised are those tested: tests/lowest.txt pins every lower bound of pyproject.toml."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parent.parent


def version(text: str) -> tuple[int, ...]:
    """1.26.0 and 1.26 alike."""
    numbers = [int(n) for n in text.split(".")]
    while numbers and numbers[-1] == 0:
        numbers.pop()
    return tuple(numbers)


def test_every_lower_bound_is_pinned_for_the_tests_of_the_lowest() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    optional = project["optional-dependencies"]
    # pytest and hypothesis decide what is tested; ruff, mypy and the like do not run in those tests
    tools = [d for d in optional["dev"] if d.split(">")[0] in ("pytest", "pytest-xdist", "hypothesis")]
    bounds = {}
    for requirement in [*project["dependencies"], *optional["cluster"], *optional["gym"], *tools]:
        found = re.fullmatch(r"([\w-]+)>=([\d.]+)(?:,<[\d.]+)?", requirement)
        assert found, f"{requirement}: give a lower bound first"
        bounds[found[1]] = version(found[2])
    lines = (ROOT / "tests" / "lowest.txt").read_text().splitlines()
    pinned = dict(line.split("==") for line in lines if not line.startswith("#"))
    assert {name: version(text) for name, text in pinned.items()} == bounds


def test_pyarrow_is_one_that_unpickles_nothing_by_itself() -> None:
    """Before 14.0.1 reading a parquet file could run code of its author's (CVE-2023-47248)."""
    assert re.search(r"^pyarrow==(\d+)", (ROOT / "tests" / "lowest.txt").read_text(), re.M)[1] >= "15"  # type: ignore[index]
