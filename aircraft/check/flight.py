"""Finds errors of an airframe by loading and flying it; `aircraft.check.check` runs this in its own process.

    python -m aircraft.check.flight FOLDER

prints a JSON object a line, {"stage": what comes next} and {"finding": ...}, each before JSBSim can abort.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path

import numpy as np

from aircraft.airframes.files import Files, Finding, read_folder, toml_line
from aircraft.autopilots.tuning import fly
from aircraft.check.bench import Bench
from aircraft.check.plausibility import PLAUSIBILITY
from aircraft.jsbsim.errors import FdmError, UnresolvedError
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import Origin
from aircraft.jsbsim.rest import Start
from aircraft.jsbsim.steady import Trim

_FLOWN_S = 5.0


def findings(files: Files, stage: Callable[[str], None]) -> Iterator[Finding]:
    """Everything, in an order that asks the harmless first."""
    model, airframe = files.model, files.airframe
    stage("loading the model")
    try:
        fdm = Fdm(airframe, 0.005, Origin())
    except UnresolvedError as error:
        yield from error.findings
        return
    except FdmError as error:
        message = " ".join(str(error).replace(f"{files.folder}/", "").split())
        line = next((int(w) for w in message.replace(":", " ").split() if w.isdigit()), None)
        yield Finding("load", "error", model, line, message, "mend what JSBSim names")
        return
    stage("evaluating forces")
    bench = Bench(files, fdm)
    for rule in PLAUSIBILITY:
        yield from rule(bench)
    stage("trimming")
    trims = list(_trims(files))
    yield from trims
    if not trims:
        stage(f"flying {_FLOWN_S:g} s")
        yield from _flies(files)


def _trims(files: Files) -> Iterator[Finding]:
    airframe, toml = files.airframe, files.folder / "airframe.toml"
    fdm = Fdm(airframe, 0.005, Origin())
    speeds = {airframe.speeds.v_min_mps, airframe.speeds.v_max_mps, *airframe.speeds.trim_mps}
    found: list[Trim] = []
    for v in sorted({*speeds, airframe.speeds.start_mps}):
        try:
            found.append(fdm.trim(Start(0.0, 0.0, 0.0, 0.0, v)))
        except FdmError as error:
            message = f"no level flight at {v:g} m/s: {str(error).split(';')[-1].strip()}"
            remedy = "state only speeds that it can fly, or mend lift, thrust or elevator"
            yield Finding("trim", "error", toml.name, toml_line(toml, "trim_mps"), message, remedy)
    if len(found) > 1 and (found[0].elevator - found[-1].elevator) * (found[0].alpha - found[-1].alpha) >= 0:
        message = "more angle of attack takes no more up elevator: it is not statically stable"
        remedy = "check Cm_alpha, and that the centre of gravity is ahead of the neutral point"
        yield Finding("sign", "warning", files.model, None, message, remedy)


def _flies(files: Files) -> Iterator[Finding]:
    """Level flight under the autopilot must stay where it begins."""
    v = files.airframe.speeds.start_mps
    f = fly(files.airframe, v, (v, 0.0, 0.0), _FLOWN_S)
    worst = max(np.abs(f.v - v).max(), np.abs(f.zeta).max(), np.abs(f.omega).max())
    if not worst < 0.5:
        system = next((name for name in files.trees if name.startswith("systems/")), files.model)
        message = f"under its autopilot it does not hold level flight at {v:g} m/s for {_FLOWN_S:g} s"
        yield Finding("flight", "error", system, 1, message, "see testbed aircraft describe for its loops")


def main(folder: Path) -> None:
    """Print stages and findings; leave without running destructors, which JSBSim may abort in."""

    def say(**what: object) -> None:
        print(json.dumps(what), flush=True)

    files, _ = read_folder(folder)
    if files is not None:
        for found in findings(files, lambda stage: say(stage=stage)):
            say(finding=asdict(found))
    say(stage="done")
    os._exit(0)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
