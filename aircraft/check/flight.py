"""Finds errors of an airframe by loading and flying it; `aircraft.check.check` runs this in its own process.

    python -m aircraft.check.flight FOLDER

prints a JSON object a line, {"stage": what comes next} and {"finding": ...}, each before JSBSim can abort.
"""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path

import numpy as np

from aircraft.airframes.files import Files, Finding, read_folder, toml_line
from aircraft.autopilots.faults import faults
from aircraft.autopilots.freshness import stale_feedforward, stale_lags
from aircraft.autopilots.tuning import fly
from aircraft.check.bench import Bench
from aircraft.check.plausibility import PLAUSIBILITY
from aircraft.check.surfaces import surfaces
from aircraft.jsbsim.errors import FdmError, UnresolvedError
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import Origin
from aircraft.jsbsim.loading import load
from aircraft.jsbsim.rest import Start
from aircraft.jsbsim.steady import Trim

_FLOWN_S = 5.0
_HELD = 0.5  # m/s or rad/s: how far level flight may stray


def findings(files: Files, stage: Callable[[str], None]) -> Iterator[Finding]:
    """All findings; harmless checks come first. Stops where no further check is possible."""
    stage("loading the model")
    try:
        executive = load(files.airframe, 0.005)
    except UnresolvedError as error:
        yield from error.findings
        return
    except FdmError as error:
        yield _loading(files, error)
        return
    manager = executive.get_property_manager()
    if wrong := list(surfaces(files, lambda path: manager.get_node(path) is not None)):
        yield from wrong
        return
    fdm = Fdm(files.airframe, 0.005, Origin())
    stage("evaluating forces")
    bench = Bench(files, fdm)
    for rule in PLAUSIBILITY:
        yield from rule(bench)
    stage("trimming")
    trims = list(_trims(files))
    yield from trims
    if any(f.severity == "error" for f in trims):
        return
    stage("disturbing level flight")
    bad = list(_autopilot(files))
    yield from bad
    if not bad:
        stage(f"flying {_FLOWN_S:g} s")
        yield from _flies(files)
    stage("comparing derived numbers with their sources")
    yield from _derived(files)


def _loading(files: Files, error: FdmError) -> Finding:
    """JSBSim's own message, at the file and line that it gives, or where the model has the word it quotes."""
    message = " ".join(str(error).replace(f"{files.folder}/", "").split())
    file, line = files.model, error.line
    if error.file is not None:
        file = Path(error.file).name
        file = next((name for name in files.trees if Path(name).name == file), files.model)
        message = message.removeprefix(f"{error.file}:{error.line}: ")
    message = message.removeprefix(f"{files.model}: ")
    if line is None:
        words = re.findall(r'"([^"]+)"|got: (\S+)', message)
        file, line = _mentions(files, [a or b for a, b in words])
    return Finding("load", "error", file, line, f"JSBSim does not load it: {message}", "correct this line")


def _mentions(files: Files, words: list[str]) -> tuple[str, int]:
    """The first file and line with one of `words`, as an attribute or in a text; else the model's root."""
    for word in words:
        for file, tree in files.trees.items():
            for e in tree.walk():
                if word in e.attributes.values() or word in e.text.split():
                    return file, e.line
    return files.model, files.trees[files.model].line


def _trims(files: Files) -> Iterator[Finding]:
    airframe, toml = files.airframe, files.folder / "airframe.toml"
    fdm = Fdm(airframe, 0.005, Origin())
    named = {f"trim_mps.{k}": v for k, v in enumerate(airframe.speeds.trim_mps)}
    for name in ("v_min_mps", "start_mps", "v_max_mps"):
        named[name] = getattr(airframe.speeds, name)
    found: dict[float, Trim] = {}
    failed: set[float] = set()
    for name, v in named.items():
        if v in found or v in failed:
            continue
        try:
            found[v] = fdm.trim(Start(0.0, 0.0, 0.0, 0.0, v))
        except FdmError as error:
            failed.add(v)
            message = f"no level flight at {v:g} m/s: {str(error).split(': ')[-1].strip()}"
            remedy = "state only speeds that it can fly, or correct mass, lift, thrust or elevator"
            yield Finding("trim", "error", toml.name, toml_line(toml, f"speeds.{name}"), message, remedy)
    if len(found) > 1:
        slow, fast = found[min(found)], found[max(found)]
        if (slow.elevator - fast.elevator) * (slow.alpha - fast.alpha) >= 0:
            message = "more angle of attack takes no more up elevator: it is not statically stable"
            remedy = "check Cm_alpha, and that the centre of gravity is ahead of the neutral point"
            line = Bench(files, fdm).line("aero/alpha-rad", axis="PITCH")
            yield Finding("sign", "warning", files.model, line, message, remedy)


# The rule that a fault of the autopilot breaks, and how grave it is.
_RULES = {
    "unstable": ("stability", "error"),
    "mis-scaled": ("scale", "error"),
    "saturated": ("limits", "warning"),
}


def _autopilot(files: Files) -> Iterator[Finding]:
    """The autopilot must be this aircraft's, stable in level flight at every trim speed, and reach its
    commands."""
    toml = files.folder / "airframe.toml"
    for fault in faults(files.airframe):
        rule, severity = _RULES[fault.kind]
        line = toml_line(toml, fault.setting or "autopilot")
        yield Finding(rule, severity, toml.name, line, fault.what, fault.remedy)


def _flies(files: Files) -> Iterator[Finding]:
    """Level flight under the autopilot must stay where it begins."""
    v = files.airframe.speeds.start_mps
    f = fly(files.airframe, v, (v, 0.0, 0.0), _FLOWN_S)
    worst = max(np.abs(f.v - v).max(), np.abs(f.zeta).max(), np.abs(f.omega).max())
    if not worst < _HELD:
        system = next((name for name in files.trees if name.startswith("systems/")), files.model)
        message = f"under its autopilot it does not hold level flight at {v:g} m/s for {_FLOWN_S:g} s"
        remedy = f"fit its feed-forward (testbed aircraft trim {files.airframe.argument}), or lower its gains"
        yield Finding("flight", "error", system, 1, message, remedy)


def _derived(files: Files) -> Iterator[Finding]:
    """Whether identified lags and fitted feed-forward are of this model and these gains."""
    toml = files.folder / "airframe.toml"
    stale = {"fitted": stale_feedforward(files.airframe), "identified": stale_lags(files.airframe)}
    for table, why in stale.items():
        if why is not None:
            message, _, remedy = why.partition("; ")
            yield Finding("stale", "warning", toml.name, toml_line(toml, table), message, remedy)


def main(folder: Path) -> None:
    """Print stages and findings; leave without running destructors, which JSBSim may abort in."""

    def say(**what: object) -> None:
        print(json.dumps(what), flush=True)

    files, _ = read_folder(folder)
    if files is not None:
        reached = [""]

        def stage(what: str) -> None:
            reached[0] = what
            say(stage=what)

        try:
            for found in findings(files, stage):
                say(finding=asdict(found))
        except Exception as error:
            say(finding=asdict(_unforeseen(files, reached[0], error)))
    say(stage="done")
    os._exit(0)


def _unforeseen(files: Files, stage: str, error: Exception) -> Finding:
    """The finding for an unexpected exception."""
    said = " ".join(str(error).replace(f"{files.folder}/", "").split())
    kind = "" if isinstance(error, FdmError) else f"{type(error).__name__}: "
    line = files.trees[files.model].line
    remedy = "correct what it names; if it names nothing, take parts off the model until it is gone"
    return Finding("flight", "error", files.model, line, f"failed while {stage}: {kind}{said}", remedy)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
