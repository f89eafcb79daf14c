"""The dossier has a title, contents and chapters; names what was not covered; and prints to PDF."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from aircraft.airframe import load as airframe
from testbed.errors import UserError
from testbed.records.checksums import sha256
from testbed.report.dossier import evidence
from testbed.report.dossier.document import Heading, css_text
from testbed.scenario.scenario import load
from testbed.simulation.simulate import run
from testbed.verification.check import check

SAID = ("--title", "Two <X8s>", "--author", "A. Engineer", "--date", "2026-11-27")


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("dossier") / "two"
    run(load("paper-2-turn", ["plant=lagged", "lags.source=airframe", "duration_s=0.2"]), out)
    return out


@pytest.fixture(scope="module")
def text(flown: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    from testbed.report.dossier.document import write
    from testbed.studies.pages import KINDS

    file = tmp_path_factory.mktemp("file") / "d.html"
    heading = Heading("Two <X8s>", "A. Engineer", "2026-11-27")
    return write([flown], file, heading, KINDS).read_text(encoding="utf-8")


def test_the_title_page_has_what_was_handed_in_as_text(text: str) -> None:
    assert "<h1>Two &lt;X8s&gt;</h1>" in text and "<X8s>" not in text
    assert "A. Engineer" in text and "2026-11-27" in text


def test_every_page_says_which_document_it_is_of_and_no_title_leaves_its_string(text: str) -> None:
    (footer,) = re.findall(r'@bottom-left \{ content: "([^"]*)";', text)
    assert re.sub(r"\\([0-9a-f]+) ", lambda m: chr(int(m[1], 16)), footer) == "Two <X8s>, 2026-11-27"
    assert not set("<>\"';{}") & set(css_text("a\"';}</style>é").strip('"'))


def test_what_the_record_cannot_decide_and_the_seals_are_listed(flown: Path, text: str) -> None:
    undecided = evidence.checked(flown, "two").open
    assert undecided and all(why and html.escape(what) in text for what, why in undecided.items())
    assert f"<td>{sha256(flown / 'manifest.json')}</td>" in text


def test_contents_lead_to_every_chapter_and_section(text: str) -> None:
    inside = set(re.findall(r'href="#([^"]+)"', text))
    ids = re.findall(r'id="((?:chapter|section)-[^"]+)"', text)
    assert len(ids) == len(set(ids)) and set(ids) == {
        i for i in inside if i.startswith(("chapter", "section"))
    }
    chapters = ("Summary", "Results", "Aircraft", "Methods", "What was not covered", "Provenance")
    assert re.findall(r'<h2 id="chapter-\d">\d ([^<]+)</h2>', text) == list(chapters)


def test_the_airframes_hash_and_every_stated_assumption_are_there(text: str) -> None:
    x8 = airframe("x8")
    now, points = evidence.assumptions("x8", ["x8"])
    assert now == x8.fingerprint() and now in text and "<td>yes</td>" in text
    assert len(points) >= 5 and all(p.split(" ")[0] in text for p in points)
    assert any(p.startswith("Inertia Jx 0.335") for p in points)


def test_everything_that_the_second_opinion_leaves_is_listed(flown: Path, text: str) -> None:
    chapter = text[text.index("What was not covered</h2>") :]
    for item in check(flown).uncovered:
        table = item.what.rpartition(".")[0]
        assert item.what in chapter or f"{table}.* (" in chapter, item


def test_a_record_that_was_changed_is_said_to_differ(flown: Path, tmp_path: Path) -> None:
    forged = tmp_path / "forged"
    shutil.copytree(flown, forged)
    said = json.loads((forged / "guarantees.json").read_text())
    said[0]["value"] = 99.0
    (forged / "guarantees.json").write_text(json.dumps(said))
    found = evidence.checked(forged, "forged")
    assert found.fault or found.differs
    assert not evidence.checked(flown, "two").differs


def test_folders_flown_with_other_files_of_an_airframe_are_refused(flown: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    shutil.copytree(flown, other)
    manifest = json.loads((other / "manifest.json").read_text())
    manifest["airframes"] = {"x8": "0" * 64}
    (other / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(UserError, match="other files of airframe x8"):
        evidence.airframes([flown, other], ())


def test_assumptions_are_read_from_their_heading_alone() -> None:
    text = (
        "# A\n- no\n## Assumptions\n- **One** of `a`\n  more\n\n| t | u |\n- see [b](c.md)\n## Next\n- no\n"
    )
    assert evidence.stated(text) == ["One of a more", "see b"]


MISTAKES = {
    ("--dossier",): "--dossier: give --title and --author and --date too",
    ("--title", "T"): "--title: goes with --dossier",
    ("--dossier", *SAID[:4], "--date", "27.11.2026"): "--date '27.11.2026': give a day as 2026-01-31",
    ("--dossier", "--title", " ", *SAID[2:]): "--title: give one",
    ("--dossier", *SAID[:2], "--author", "a\nb", *SAID[4:]): "give one line of at most 200",
}


@pytest.mark.parametrize("words", MISTAKES)
def test_a_mistake_is_one_line(
    words: tuple[str, ...], flown: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("report", flown, *words) == 2
    assert MISTAKES[words] in capsys.readouterr().err
    assert not (flown / "dossier.html").exists()


@pytest.mark.slow
def test_it_prints_to_pdf_with_a_page_for_each_chapter(text: str, tmp_path: Path) -> None:
    browser = next((p for p in map(shutil.which, ("chromium", "google-chrome")) if p), None)
    if browser is None:
        pytest.skip("no browser is installed")
    (tmp_path / "d.html").write_text(text, encoding="utf-8")
    flags = ["--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'p'}"]
    pdf = tmp_path / "d.pdf"
    subprocess.run(
        [browser, *flags, f"--print-to-pdf={pdf}", (tmp_path / "d.html").as_uri()],
        check=True, capture_output=True, timeout=60,
    )  # fmt: skip
    data = pdf.read_bytes()
    assert data.startswith(b"%PDF")
    # Title, contents and six chapters, each on a page of its own at least.
    assert len(re.findall(rb"/Type\s*/Page\b", data)) >= 8
