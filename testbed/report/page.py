"""Writes one self-contained HTML page about folders that commands wrote: no network, no files beside it."""

from __future__ import annotations

import base64
import hashlib
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from typing import Any

from testbed.errors import UserError
from testbed.records.store import MARKS, staged
from testbed.report import embed
from testbed.report.blocks import SIGNS, Part, cell
from testbed.report.registry import OWN, Account, Kind, kind_of

PAGE_FILE = "report.html"
SCRIPTS = tuple(
    f"templates/{name}.js" for name in ("playback-model", "playback-view", "playback-strips", "playback")
)


def write(folders: Sequence[Path], out: Path, kinds: Sequence[Kind] = ()) -> Path:
    """Write the page of `folders` as the file `out`, replaced at once.

    kinds   of folders, beside those of this package
    Raises  UserError if a folder is of no kind or damaged, or `out` cannot be written
    """
    return written(out, page([part(folder, folder.resolve().name, kinds) for folder in folders]))


def written(out: Path, text: str) -> Path:
    """Write the file `out`, replaced at once. Raises UserError if it cannot be written."""
    partial = out.with_name(f".{out.name}.partial")
    try:
        partial.write_text(text, encoding="utf-8")
        partial.replace(out)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise UserError(f"cannot write {out}: {error.strerror}") from None
    return out


def attach(folder: Path, title: str, account: Account) -> None:
    """Write `folder`/report.html at the end of a study. A failure is reported and costs no result.

    title    the folder's final name
    account  makes the folder's part of the page
    """
    try:
        (folder / PAGE_FILE).write_text(page([account(folder, title)]), encoding="utf-8")
    except Exception as error:  # a page that cannot be made must not cost the results
        print(f"no {PAGE_FILE}: {type(error).__name__}: {error}; try testbed report", file=sys.stderr)


@contextmanager
def reported(path: Path, account: Account, overwrite: bool = False) -> Iterator[Path]:
    """`staged`, with a report in the folder when the block has filled it."""
    with staged(path, overwrite) as folder:
        yield folder
        attach(folder, path.name, account)


def part(folder: Path, name: str, kinds: Sequence[Kind] = ()) -> Part:
    """The part of a page for one folder, whose kind is known by the mark it carries."""
    if not folder.is_dir():
        raise UserError(f"{folder} is no folder; give one that a command wrote")
    kind = kind_of(folder, (*kinds, *OWN))
    if kind is not None:
        try:
            return kind.part(folder, name)
        except (KeyError, ValueError, OSError, IndexError) as error:
            raise UserError(f"{folder} is damaged: {type(error).__name__}: {error}") from None
    if (folder / "datasheet.json").is_file():
        raise UserError(f"{folder} is a datasheet, a page already: {folder / 'index.html'}")
    inside = sorted({str(f.parent) for mark in MARKS for f in folder.glob(f"*/{mark}")})
    hint = f"give one of: {', '.join(inside[:5])}" if inside else "give a folder that a command wrote"
    raise UserError(f"{folder} holds nothing to report on; {hint}")


def page(parts: Sequence[Part]) -> str:
    """The page; equal parts give equal text."""
    playing = any(block.kind == "playback" for p in parts for s in p.sections for block in s.blocks)
    script = _script() if playing else ""
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    sheets = ["vendor/uplot/uPlot.min.css"] if playing else []
    return rendered(
        "report.html",
        [*sheets, "templates/report.css"],
        title=" and ".join(p.title for p in parts),
        parts=parts,
        script=markup(script),
        # Only our own script may run, and nothing may be fetched, whatever a scenario's text says.
        policy=f"default-src 'none'; style-src 'unsafe-inline'; img-src data:; script-src 'sha256-{digest}'",
    )


def rendered(name: str, sheets: Sequence[str], **values: Any) -> str:
    """A template of this package with `values`; `sheets` are its style sheets."""
    from jinja2 import Environment, PackageLoader

    environment = Environment(
        loader=PackageLoader("testbed.report"), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters.update(cell=cell, own_ids=embed.own_ids)
    environment.globals["signs"] = SIGNS
    style = markup("".join(_read(sheet) for sheet in sheets))
    return environment.get_template(name).render(style=style, **values)


def markup(text: str) -> Any:
    """Text that a template takes as it is."""
    from markupsafe import Markup

    return Markup(text)


def _script() -> str:
    code = "\n".join(_read(name) for name in SCRIPTS)
    return f'{_read("vendor/uplot/uPlot.iife.min.js")}\n(() => {{\n"use strict";\n{code}\n}})();'


def _read(name: str) -> str:
    return (resources.files("testbed.report") / name).read_text(encoding="utf-8")
