"""Reads the guide's pages and runs what they say, as a reader would.

Fenced blocks marked sh, and indented lines that begin with a command, are run in order in an empty folder in
which docs/ is the project's; python blocks too. What stands in a comment above a block changes that:

<!-- test: --seeds 1 --set duration_s=1 -->  add these options to each command of the block that knows them
<!-- test: exit 1 -->                        the block's commands end with this code, not 0
<!-- test: skip, REASON -->                  do not run the block
<!-- test: soak, REASON -->                  run the block in `make soak` only
<!-- file: NAME -->                          the block is that file of the guide, word for word; if there is
                                             none, it is written to the folder under that name
<!-- output -->                              the block's lines are among what the commands above it printed
"""

from __future__ import annotations

import os
import re
import runpy
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import pytest
from typer.main import get_command

from testbed.cli.main import app

ROOT = Path(__file__).parent.parent
SHELL = ("", "sh", "bash", "console")
# What sets up a reader's shell; here it is set up.
SETTING_UP = (".", "source", "cd", "git", "pip", "python3")


@dataclass
class Block:
    """A fenced or indented block, and the words of the comments above it."""

    language: str
    text: str
    line: int
    test: str = ""
    file: str = ""
    output: bool = False


def blocks(page: Path) -> Iterator[Block]:
    """All blocks of a page, in order."""
    lines = page.read_text(encoding="utf-8").split("\n")
    notes: dict[str, str] = {}
    k = 0
    while k < len(lines):
        line, start = lines[k], k + 1
        k += 1
        if note := re.fullmatch(r"<!-- (test|file|output)(?:: (.*))? -->", line):
            notes[note[1]] = note[2] or ""
            continue
        indented = re.match(r"    (testbed|python|make) ", line)
        fenced = re.match(r"```(\w*)", line)
        if indented or fenced:
            end = (lambda text: not text.startswith("    ")) if indented else (lambda text: text == "```")
            body = [line[4:]] if indented else []
            while k < len(lines) and not end(lines[k]):
                body.append(lines[k][4:] if indented else lines[k])
                k += 1
            k += bool(fenced)
            language = "sh" if indented else fenced[1] if fenced else ""
            text = "\n".join(body) + "\n"
            yield Block(
                language, text, start, notes.get("test", ""), notes.get("file", ""), "output" in notes
            )
        if line.strip():
            notes = {}


def commands(block: Block) -> list[str]:
    """The command lines of a block: continued lines joined, comments and prompts gone."""
    joined = re.sub(r"\s*\\\n\s*", " ", block.text)
    lines = (re.sub(r"(^|\s)#.*", "", line).strip().removeprefix("$ ") for line in joined.split("\n"))
    return [line for line in lines if line]


@dataclass
class Reader:
    """Runs a page in the current folder; `call` is the fixture of that name."""

    page: Path
    call: Callable[..., int]
    monkeypatch: pytest.MonkeyPatch

    def read(self) -> int:
        """Run all blocks; returns how many commands and python blocks ran."""
        Path("docs").symlink_to(ROOT / "docs")
        names: dict[str, object] = {"__name__": "guide"}
        ran, printed = 0, ""
        for block in blocks(self.page):
            if block.file:
                self._file(block)
            elif block.output:
                missing = [line for line in _words(block.text) if line not in _words(printed)]
                assert not missing, f"{self.page.name}:{block.line} shows what was not printed: {missing}"
            elif block.test.startswith("skip"):
                assert block.test.removeprefix("skip").strip(", "), f"{self.page.name}:{block.line}: why?"
            elif block.test.startswith("soak") and "TESTBED_SOAK" not in os.environ:
                assert block.test.removeprefix("soak").strip(", "), f"{self.page.name}:{block.line}: why?"
            elif block.language == "python":
                exec(compile(block.text, f"{self.page.name}:{block.line}", "exec"), names)
                ran += 1
            elif block.language in SHELL:
                out = StringIO()
                for line in commands(block):
                    with redirect_stdout(out):
                        self._run(line, block)
                    ran += 1
                printed = out.getvalue()
        return ran

    def _file(self, block: Block) -> None:
        there = self.page.parent / block.file
        if there.is_file():
            assert block.text == there.read_text(encoding="utf-8"), f"{self.page.name}: not {block.file}"
        else:
            Path(block.file).write_text(block.text, encoding="utf-8")

    def _run(self, line: str, block: Block) -> None:
        where = f"{self.page.name}:{block.line}: {line}"
        words = shlex.split(line.removeprefix(".venv/bin/"))
        asked = re.match(r"exit (\d)", block.test)
        wanted = int(asked[1]) if asked else 0
        if words[0] == "make":
            # Its recipe, but for the set-up and the tests themselves.
            dry = subprocess.run(
                ["make", "-n", *words[1:]], cwd=ROOT, capture_output=True, text=True, check=True
            )
            for recipe in dry.stdout.splitlines():
                if "/testbed " in recipe:
                    self._run("testbed " + recipe.partition("/testbed ")[2], block)
        elif words[0] == "cp" or re.search(r"[|>;&]|\$\(", line):
            path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
            code = subprocess.run(["bash", "-c", line], env=os.environ | {"PATH": path}).returncode
            assert code == wanted, where
        elif words[0] == "testbed":
            whole = asked or block.test.startswith("soak")
            added = [] if whole else known(words[1:], shlex.split(block.test))
            assert self.call(*words[1:], *added) == wanted, where
        elif words[0] == "python":
            self._python(words[1:])
        else:
            assert words[0] in SETTING_UP, f"{where}: not a command that the guide's tests know"

    def _python(self, words: list[str]) -> None:
        module = words[0] == "-m"
        self.monkeypatch.setattr(sys, "argv", words[module:])
        run = runpy.run_module if module else runpy.run_path
        run(words[module], run_name="__main__")


def known(words: list[str], options: list[str]) -> list[str]:
    """Those of `options`, each with a value, that the command begun by `words` has."""
    command = get_command(app)
    for word in words:
        inner = getattr(command, "commands", {})
        if word not in inner:
            break
        command = inner[word]
    names = {name for p in command.params for name in p.opts}
    pairs = zip(options[::2], options[1::2], strict=True)
    return [w for option, value in pairs if option in names for w in (option, value)]


def _words(text: str) -> list[str]:
    """Non-empty lines with their spacing evened out."""
    return [" ".join(line.split()) for line in text.splitlines() if line.strip()]
