"""One self-contained page for a folder this program wrote: no network, nothing beside it, ready to print."""

from __future__ import annotations

import base64
import hashlib
import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import resources
from pathlib import Path

from testbed.errors import UserError
from testbed.records.run import Run
from testbed.records.store import MANIFEST, MARKS, load, staged
from testbed.report import embed
from testbed.report.blocks import SIGNS, Part, cell

PAGE_FILE = "report.html"
SCRIPTS = tuple(
    f"templates/{name}.js" for name in ("playback-model", "playback-view", "playback-strips", "playback")
)


def write(folders: Sequence[Path], out: Path) -> Path:
    """The page of `folders` as the file `out`, replaced at once. Raises UserError where none can be made."""
    text = page([part(folder, folder.resolve().name) for folder in folders])
    partial = out.with_name(f".{out.name}.partial")
    try:
        partial.write_text(text, encoding="utf-8")
        partial.replace(out)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise UserError(f"cannot write {out}: {error.strerror}") from None
    return out


def attach(folder: Path, title: str, runs: Mapping[str, Run] | None = None) -> None:
    """`folder`/report.html at the end of a study. What goes wrong here is said, and costs no result.

    title  name of the folder, once it has its own
    runs   of a comparison, where they are at hand
    """
    from testbed.report import run_part

    try:
        made = part(folder, title) if runs is None else run_part.part(runs, folder, title)
        (folder / PAGE_FILE).write_text(page([made]), encoding="utf-8")
    except Exception as error:  # hours of flying are not thrown away for a page
        print(f"no {PAGE_FILE}: {type(error).__name__}: {error}; try testbed report", file=sys.stderr)


@contextmanager
def reported(path: Path, overwrite: bool = False) -> Iterator[Path]:
    """`staged`, with a report in the folder when the block has filled it."""
    with staged(path, overwrite) as folder:
        yield folder
        attach(folder, path.name)


def part(folder: Path, name: str) -> Part:
    """The account of one folder, chosen by the mark it carries."""
    from testbed.report import run_part

    if not folder.is_dir():
        raise UserError(f"{folder} is no folder; give one that a command wrote")
    try:
        if (folder / "comparison.json").is_file():
            labels = json.loads((folder / "comparison.json").read_text(encoding="utf-8"))
            return run_part.part({label: load(folder / label) for label in labels}, folder, name)
        if (folder / MANIFEST).is_file():
            run = load(folder)
            return run_part.part({run.manifest["scenario"]["plant"]: run}, folder, name)
        for mark, account in _accounts().items():
            if (folder / mark).is_file():
                return account(folder, name)
    except (KeyError, ValueError, OSError, IndexError) as error:
        raise UserError(f"{folder} is damaged: {type(error).__name__}: {error}") from None
    if (folder / "datasheet.json").is_file():
        raise UserError(f"{folder} is a datasheet, a page already: {folder / 'index.html'}")
    inside = sorted({str(f.parent) for mark in MARKS for f in folder.glob(f"*/{mark}")})
    hint = f"give one of: {', '.join(inside[:5])}" if inside else "give a folder that a command wrote"
    raise UserError(f"{folder} holds nothing to report on; {hint}")


def _accounts() -> dict[str, Callable[[Path, str], Part]]:
    """What a folder's mark says it is -> who accounts for it."""
    from testbed.report import campaign_part
    from testbed.report import ledger_part as derived_parts
    from testbed.studies.falsify import page as other_parts
    from testbed.studies.ladder import page as study_parts

    return {
        "ladder.json": study_parts.ladder,
        "remedies.json": study_parts.remedies,
        "margin.json": study_parts.margin,
        "answer.json": study_parts.answer,
        "tune.json": other_parts.tune,
        "figures.json": other_parts.figures,
        "falsify.json": other_parts.falsify,
        "ledger.json": derived_parts.ledger,
        "export.json": derived_parts.export,
        "campaign.json": campaign_part.part,
    }


def page(parts: Sequence[Part]) -> str:
    """The page; equal parts give equal text."""
    from jinja2 import Environment, PackageLoader
    from markupsafe import Markup

    environment = Environment(
        loader=PackageLoader("testbed.report"), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters.update(cell=cell, own_ids=embed.own_ids)
    environment.globals["signs"] = SIGNS
    playing = any(block.kind == "playback" for p in parts for s in p.sections for block in s.blocks)
    script = _script() if playing else ""
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return environment.get_template("report.html").render(
        title=" and ".join(p.title for p in parts),
        parts=parts,
        style=Markup(
            (_read("vendor/uplot/uPlot.min.css") if playing else "") + _read("templates/report.css")
        ),
        script=Markup(script),
        # Only our own script may run, and nothing may be fetched, whatever a scenario's text says.
        policy=f"default-src 'none'; style-src 'unsafe-inline'; img-src data:; script-src 'sha256-{digest}'",
    )


def _script() -> str:
    code = "\n".join(_read(name) for name in SCRIPTS)
    return f'{_read("vendor/uplot/uPlot.iife.min.js")}\n(() => {{\n"use strict";\n{code}\n}})();'


def _read(name: str) -> str:
    return (resources.files("testbed.report") / name).read_text(encoding="utf-8")
