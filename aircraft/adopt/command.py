"""Adopts an aircraft in a process of its own, within a time limit, and publishes its folder at the end."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import IO

from aircraft.adopt.source import find
from aircraft.adopt.verdict import REFUSED, Verdict
from aircraft.airframes.schema import NAME

LIMIT_S = 900.0  # wall time of the whole adoption; the stages have limits of their own, in processor time


def default_folder(name_or_path: str) -> Path:
    """Where an aircraft is adopted to unless told: a folder of its name here."""
    name = re.sub(r"[^A-Za-z0-9_-]", "-", Path(name_or_path).expanduser().resolve().name.removesuffix(".xml"))
    return Path(name.lower().strip("-") or "adopted")


def adopted(
    name_or_path: str,
    folder: Path,
    say: Callable[[str], None] = lambda what: None,
) -> Verdict:
    """Adopt an aircraft; `folder` is written only if it flies.

    name_or_path  a stock aircraft of JSBSim, a folder, or a model's file
    say           called with the stage that begins
    Raises        FileExistsError if the folder exists; ValueError for a name that JSBSim cannot take;
                  OSError if the folder cannot be written
    """
    if folder.exists():
        raise FileExistsError(f"{folder} exists; give another with --out")
    if not re.fullmatch(NAME, folder.name) or "." in folder.name:
        raise ValueError(f"{folder.name!r} cannot name an airframe; use letters, digits, - and _")
    find(name_or_path)  # a mistake in the name needs no process
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".adopt-", dir=folder.parent) as aside:
        made = Path(aside) / folder.name
        verdict = _in_process(name_or_path, made, say)
        if verdict.flies:
            _rename_commands(made, folder)
            shutil.move(str(made), folder)
    return verdict


def _in_process(name_or_path: str, made: Path, say: Callable[[str], None]) -> Verdict:
    command = [sys.executable, "-m", "aircraft.adopt.adopt", name_or_path, str(made)]
    with (
        tempfile.TemporaryFile("w+") as errors,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True) as child,
    ):
        late: list[bool] = []

        def stop() -> None:
            late.append(True)
            child.kill()

        timer = threading.Timer(LIMIT_S, stop)
        timer.daemon = True
        timer.start()
        try:
            verdict = _listen(child, say, errors)
            if not late:
                return verdict
            return Verdict(
                REFUSED, verdict.stage, (f"stopped after {LIMIT_S:g} s: try on an idle machine",), {}
            )
        finally:
            timer.cancel()
            child.kill()


def _listen(child: subprocess.Popen[str], say: Callable[[str], None], errors: IO[str]) -> Verdict:
    stage = "files"
    assert child.stdout is not None
    for line in child.stdout:
        try:
            said = json.loads(line)
        except ValueError:
            continue  # what JSBSim itself prints
        if "stage" in said:
            stage = said["stage"].partition(":")[0]
            say(said["stage"])
        elif "verdict" in said:
            found = said["verdict"]
            return Verdict(found["kind"], found["stage"], tuple(found["remarks"]), found["worst"])
    code = child.wait()
    errors.seek(0)
    last = next((x.strip() for x in reversed(errors.read().splitlines()) if x.strip()), "")
    how = {s.value: s.name for s in signal.Signals}.get(-code, f"exit code {code}")
    return Verdict(REFUSED, stage, (f"JSBSim ended the process ({how}{': ' + last if last else ''})",), {})


def _rename_commands(made: Path, folder: Path) -> None:
    """Commands that remake derived numbers name the folder where it will be."""
    path = made / "airframe.toml"
    text = path.read_text(encoding="utf-8")
    command = r'^command = "testbed aircraft identify .*"$'
    name = folder.as_posix()
    text = re.sub(command, lambda _: f'command = "testbed aircraft identify {name}"', text, flags=re.M)
    aside = path.with_name(".airframe.new")
    aside.write_text(text, encoding="utf-8")
    os.replace(aside, path)
