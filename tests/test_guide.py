"""What the README and the guide say is so.

Commands and examples run, tables are the committed ones, links lead somewhere, generated pages are current.
How the blocks of a page are run, and cheaply, says tests/guide_pages.py.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from testbed.scenario import reference_page

ROOT = Path(__file__).parent.parent
sys.path[:0] = [str(Path(__file__).parent), str(ROOT / "docs")]
import api_page  # noqa: E402
import autopilot_page  # noqa: E402
from guide_pages import Reader, blocks, commands, known  # noqa: E402

PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_and_pictures_exist(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", page.read_text(encoding="utf-8")):
        if "://" not in target:
            assert (page.parent / target).exists(), target


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_commands_named_exist(page: Path) -> None:
    """Every `testbed X` in a code block or span is a command, and its long options are known to its help."""
    from typer.main import get_command

    from testbed.cli.main import app

    commands = get_command(app).commands  # type: ignore[attr-defined]
    # A command inside another's $(...) is one of its own.
    text = re.sub(r"\$\((.*?)\)", r"\n\1\n", page.read_text("utf-8"))
    for name, rest in re.findall(r"(?:^|`)testbed ([a-z]+)([^`\n#]*)", text, re.M):
        assert name in commands, f"testbed {name}"
        command, words = commands[name], rest.split()
        while words and hasattr(command, "commands") and words[0] in command.commands:
            command = command.commands[words.pop(0)]
        known = {o for p in command.params for o in p.opts}
        for word in words:
            if word.startswith("--"):
                assert word.partition("=")[0] in known | {"--help"}, f"testbed {name} {word}"


GUIDE = [ROOT / "README.md", *sorted((ROOT / "docs/guide").glob("*.md"))]


@pytest.mark.slow
@pytest.mark.parametrize("page", [p for p in GUIDE if any(blocks(p))], ids=lambda p: p.name)
def test_every_command_and_example_of_a_page_runs(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: Callable[..., int]
) -> None:
    monkeypatch.chdir(tmp_path)
    # Examples set warnings and paths of their own; what a page runs is not measured.
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "1")
    Reader(page, call, monkeypatch).read()


def test_a_reader_meets_what_a_page_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: Callable[..., int]
) -> None:
    """The reader itself: files, options added where known, output compared, mistakes noticed."""
    monkeypatch.chdir(tmp_path)
    page = tmp_path / "page.md"
    good = (
        "<!-- file: s.toml -->\n```toml\nname = 's'\nvehicles = 1\n```\n\n"
        "<!-- test: --set duration_s=0.05 -->\n```sh\n# why\ntestbed run s.toml \\\n  --out r\n```\n"
        "<!-- output -->\n```text\nrun folder:  r\n```\n\n    testbed export r --format csv\n\nand\n"
        "```python\nassert 1 + 1 == 2\n```\n"
    )
    page.write_text(good)
    assert [commands(b) for b in blocks(page)][1] == ["testbed run s.toml --out r"]
    assert known(["run", "x"], ["--seeds", "1", "--set", "a=1"]) == ["--set", "a=1"]
    assert Reader(page, call, monkeypatch).read() == 3
    assert (tmp_path / "r-csv" / "vehicles.csv").is_file()
    for bad in ("```sh\ntestbed run nowhere\n```\n", "```python\nassert False\n```\n", "```sh\nrm x\n```\n"):
        (tmp_path / "docs").unlink()
        page.write_text(bad)
        with pytest.raises(AssertionError):
            Reader(page, call, monkeypatch).read()


def test_generated_pages_are_up_to_date() -> None:
    remake = "testbed schema --markdown > docs/guide/scenarios.md"
    assert (ROOT / "docs/guide/scenarios.md").read_text("utf-8") == reference_page.markdown(), remake
    remake = "python docs/api_page.py > docs/guide/api.md"
    assert (ROOT / "docs/guide/api.md").read_text("utf-8") == api_page.markdown(), remake
    remake = "make guide"
    assert (ROOT / "docs/guide/loops.md").read_text("utf-8") == autopilot_page.markdown(), remake


def test_the_index_names_every_page() -> None:
    index = (ROOT / "docs/guide/README.md").read_text("utf-8")
    for page in (ROOT / "docs/guide").glob("*.md"):
        assert page.name == "README.md" or f"]({page.name})" in index, page.name


def test_nothing_is_left_to_fill_in() -> None:
    for page in PAGES:
        assert not re.search(r"\b(TODO|HEADLINE_\w+|ANSWER_\w+)\b", page.read_text("utf-8")), page
