"""What the README and the guide say is what the committed tables hold, and what is linked exists."""

from __future__ import annotations

import re
from pathlib import Path

import pandas as pd
import pytest

from testbed.studies.answer import markdown

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_and_pictures_exist(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", page.read_text(encoding="utf-8")):
        if "://" not in target:
            assert (page.parent / target).exists(), target


def test_the_central_page_shows_the_table_the_command_wrote() -> None:
    table = pd.read_csv(ROOT / "docs/guide/data/answer/answer.csv")
    assert markdown(table) in (ROOT / "docs/guide/answer.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_commands_named_exist(page: Path) -> None:
    """Every `testbed X` in a code block or span is a command, and its long options are known to its help."""
    from typer.main import get_command

    from testbed.cli import app

    commands = get_command(app).commands  # type: ignore[attr-defined]
    for name, rest in re.findall(r"(?:^|`)testbed ([a-z]+)([^`\n#]*)", page.read_text("utf-8"), re.M):
        assert name in commands, f"testbed {name}"
        command, words = commands[name], rest.split()
        while words and hasattr(command, "commands") and words[0] in command.commands:
            command = command.commands[words.pop(0)]
        known = {o for p in command.params for o in p.opts}
        for word in words:
            if word.startswith("--"):
                assert word.partition("=")[0] in known | {"--help"}, f"testbed {name} {word}"


def test_nothing_is_left_to_fill_in() -> None:
    for page in PAGES:
        assert not re.search(r"\b(TODO|HEADLINE_\w+|ANSWER_\w+)\b", page.read_text("utf-8")), page
