"""Adopts an aircraft and writes its folder: stages one after another, a verdict at the end.

    python -m aircraft.adopt.adopt NAME|FOLDER OUT

prints a JSON object a line, {"stage": ...} and at the end {"verdict": ...}; `aircraft.adopt.command` runs it
in a process of its own, for JSBSim aborts the process on some models.
"""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

from numpy.linalg import LinAlgError

from aircraft.adopt.adopting import Model, examine
from aircraft.adopt.failures import AdoptionError
from aircraft.adopt.readme import readme
from aircraft.adopt.rig import Rig
from aircraft.adopt.scoring import cases, disk_margins, flown
from aircraft.adopt.search import search
from aircraft.adopt.skeleton import write
from aircraft.adopt.verdict import REFUSED, REMARKS, Verdict, judge
from aircraft.autopilots.remaking import remade_lags
from aircraft.jsbsim.errors import FdmError
from aircraft.jsbsim.steady import Trim

EXAMINED_S, FLOWN_S = 25.0, 90.0  # processor time until derivatives are known, and for search and flights
_LATE = "not done in the time that a sound model takes: it does not settle, or has too many parts"
_EVERY = 8  # periods between instants of a flight that lags are fitted to
_HEAD = """# Written by `testbed aircraft adopt`; README.md says what was found and assumed.
# Gains become properties ap/SECTION-NAME. After an edit: testbed aircraft autopilot FOLDER."""
_COMMENTS = {
    "gains.airframe": "The aircraft as the feed-forward knows it: derivatives at level flights, averaged.",
    "gains.level": "Level flight at five airspeeds: what is left of lift, drag and surfaces.",
    "gains.thrust": "Thrust over mass there, and its shares at eighths of the throttle's range.",
    "gains.turn": "Loops: from time constants of the aircraft, then scaled by a search on steps.",
}


class _Trims:
    """Trims of a model by speed, found once each."""

    def __init__(self, model: Model) -> None:
        self._model, self._rig = model, Rig(model.airframe)
        self._known: dict[float, Trim] = {}

    def __call__(self, v: float) -> Trim | None:
        if v not in self._known:
            known = (*self._model.found.trims, *self._known.values())
            self._known[v] = self._rig.trim(v, min(known, key=lambda t: abs(t.airspeed - v)))
        return self._known[v]


def adopt(name_or_path: str, folder: Path, say: Callable[[str], None]) -> Verdict:
    """Adopt a model into `folder`. Raises AdoptionError where that is not possible."""
    model = examine(name_or_path, folder, say)
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_PROF, FLOWN_S)
    try:
        near = _Trims(model)
        scales = search(model, near, say)
        say("files: airframe.toml and the autopilot")
        airframe = write(model.with_scales(scales), _HEAD, _COMMENTS)
        say("steps: flown at slow, middle and fast speeds")
        scored = [flown(airframe, case, near)[0] for case in cases(airframe)]
        say("margins: of every loop, measured in flight")
        s = airframe.speeds
        disks = disk_margins(airframe, (s.v_min_mps, s.v_max_mps), near)
        verdict = judge(scored, disks)
        if verdict.flies:
            say("lags: identified on steps")
            try:
                remade_lags(airframe, lambda what: None, _EVERY, near).write()
            except FdmError as error:  # it flies; what predicts by lags says that there are none
                said = f"its lags are not identified: {' '.join(str(error).split())}"
                verdict = replace(verdict, kind=REMARKS, remarks=(*verdict.remarks, said))
    except FdmError as error:
        raise AdoptionError("steps", " ".join(str(error).split())) from None
    (folder / "README.md").write_text(readme(model, name_or_path, scored, disks, verdict), encoding="utf-8")
    return verdict


def main(name_or_path: str, folder: Path) -> None:
    """Print stages and the verdict; leave without running destructors, in which JSBSim may abort."""

    def say(**what: object) -> None:
        print(json.dumps(what), flush=True)

    stage = "files"

    def next_(what: str) -> None:
        nonlocal stage
        stage = what.partition(":")[0]
        say(stage=what)

    def late(*_: object) -> None:
        raise AdoptionError(stage, _LATE)

    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGPROF, late)
        signal.setitimer(signal.ITIMER_PROF, EXAMINED_S)
    try:
        verdict = adopt(name_or_path, folder, next_)
    except AdoptionError as error:
        verdict = Verdict(REFUSED, error.stage, (error.reason,), {})
    except (ArithmeticError, LinAlgError, ValueError, FdmError, OSError) as error:
        said = " ".join(str(error).split())
        verdict = Verdict(REFUSED, stage, (f"{type(error).__name__}: {said}",), {})
    say(verdict=asdict(verdict))
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
