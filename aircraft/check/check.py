"""Lints a user's airframe folder: first the files as text, then the model, flown in a process of its own.

Each finding names the file, the line and the remedy. `NOT_SEEN` states what neither the text nor a flight
can show.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

from aircraft.airframes.files import Files, Finding, read_folder
from aircraft.airframes.safety import dangers
from aircraft.check.rules import RULES

FLIGHT_LIMIT_S = 120.0
NOT_SEEN = (
    "a wrong number that is still plausible; compare each with its source, and let [stated] in airframe.toml"
    " guard mass and inertia, the sign of Jxz included"
)


def check(folder: Path) -> list[Finding]:
    """Everything found wrong with an airframe folder.

    Raises  NotADirectoryError if there is none.
    """
    if not folder.is_dir():
        raise NotADirectoryError(
            f"{folder} is not a folder; give the folder that holds airframe.toml, or make one of a JSBSim"
            f" aircraft: testbed aircraft adopt {folder}"
        )
    findings = list(dangers(folder))
    if any(f.rule in ("refused", "xml", "files", "airframe.toml") for f in findings):
        return findings
    files, _ = read_folder(folder)
    assert files is not None  # or there were findings
    for rule in RULES:
        findings += rule(files)
    if not any(f.severity == "error" for f in findings):
        findings += fly(files)
    return findings


def fly(files: Files) -> list[Finding]:
    """The findings of `aircraft.check.flight` on this folder, in a process that JSBSim may abort."""
    with tempfile.TemporaryDirectory() as nowhere:  # what a model writes, it writes here
        try:
            done = subprocess.run(
                [sys.executable, "-m", "aircraft.check.flight", str(files.folder)],
                capture_output=True, text=True, cwd=nowhere, timeout=FLIGHT_LIMIT_S, check=False,
            )  # fmt: skip
            printed, ended = done.stdout, _ending(done.returncode, done.stderr)
        except subprocess.TimeoutExpired as late:
            out = late.stdout or b""
            printed = out.decode(errors="replace") if isinstance(out, bytes) else out
            ended = f"did not end in {FLIGHT_LIMIT_S:g} s"
    findings, stage = [], "starting"
    for line in printed.splitlines():
        said: dict[str, Any] = json.loads(line)
        stage = said.get("stage", stage)
        if "finding" in said:
            found = Finding(**said["finding"])
            # Commands are given as they are typed here, not where the other process runs.
            remedy = found.remedy.replace(str(files.folder), files.airframe.argument)
            findings.append(replace(found, remedy=remedy))
    if stage != "done":
        remedy = "correct what is named above" if findings else "take parts off the model until it goes on"
        top = files.trees[files.model].line
        message = f"{'' if _raised(ended) else 'JSBSim '}{ended} while {stage}"
        findings.append(Finding("flight", "error", files.model, top, message, remedy))
    return findings


_RAISED = "the check itself failed: "


def _raised(ended: str) -> bool:
    """Whether a process ended by an exception of Python, not by JSBSim."""
    return ended.startswith(_RAISED)


def _ending(code: int, errors: str) -> str:
    """How a process ended, with the last line that it wrote to standard error."""
    last = next((line.strip() for line in reversed(errors.splitlines()) if line.strip()), "")
    if code == 1 and "Traceback (most recent call last)" in errors:
        return f"{_RAISED}{last}"
    how = f"exit code {code}"
    if code < 0:
        known = {s.value: s.name for s in signal.Signals}
        how = known.get(-code, f"signal {-code}")
    return f"ended the process ({how}{': ' + last if last else ''})"
