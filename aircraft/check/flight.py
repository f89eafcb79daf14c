"""Finds errors of an airframe by loading and flying it; `aircraft.check.check` runs this in its own process.

    python -m aircraft.check.flight FOLDER

prints a JSON object a line, {"stage": what comes next} and {"finding": ...}, each before JSBSim can abort.
"""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path

import numpy as np

from aircraft.check.files import Files, Finding, read_folder
from aircraft.check.property_names import UnresolvedError
from aircraft.check.xml import Element
from aircraft.jsbsim.fdm import Fdm, FdmError, Start, Trim
from aircraft.jsbsim.geodesy import Origin

_FLOWN_S = 5.0
# Thresholds of the plausible. Ours are far inside: yaw from aileron 0.03 (X8) and 0.23 (Rascal) of its roll.
_YAW_SHARE = 0.5
_ELEVATOR_DRAG = (
    0.15  # of the zero-lift drag at 5 deg, growing as |de|: 0.09 on the Rascal, 0.28 with the fault
)
_STATED = 0.01


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
    bench = _Bench(files, fdm)
    for rule in (_mass, _signs, _yaw_from_aileron, _elevator_drag, _stall, _saturation, _thrust):
        yield from rule(bench)
    stage("trimming")
    trims = list(_trims(files))
    yield from trims
    if not trims:
        stage(f"flying {_FLOWN_S:g} s")
        yield from _flies(files)


class _Bench:
    """The model at rest in time at its start speed, and where its parts stand in the text."""

    def __init__(self, files: Files, fdm: Fdm) -> None:
        self.files, self.fdm = files, fdm
        self.speed = files.airframe.speeds.start_mps
        self.commands = {f"fcs/{n}-cmd-norm": 0.0 for n in ("elevator", "aileron", "rudder", "throttle")}

    def at(
        self,
        alpha: float = 0.05,
        beta: float = 0.0,
        rates: tuple[float, float, float] = (0.0, 0.0, 0.0),
        speed: float | None = None,
        commands: Mapping[str, float] | None = None,
    ) -> np.ndarray:
        """Aerodynamic force along body axes and moment, (6,), in JSBSim's units; angles rad."""
        v = self.speed if speed is None else speed
        body = v * np.array(
            [math.cos(alpha) * math.cos(beta), math.sin(beta), math.sin(alpha) * math.cos(beta)]
        )
        given = {f"fcs/{name}-cmd-norm": value for name, value in (commands or {}).items()}
        self.fdm.hold(body, (0.0, alpha, 0.0), rates, {**self.commands, **given})
        forces = [self.fdm.read(f"forces/fb{a}-aero-lbs") for a in "xyz"]
        return np.array(forces + [self.fdm.read(f"moments/{a}-aero-lbsft") for a in "lmn"])

    def lift(self, alpha: float) -> float:
        x, _, z, *_ = self.at(alpha)
        return float(x * math.sin(alpha) - z * math.cos(alpha))

    def drag(self, alpha: float, elevator: float = 0.0) -> float:
        x, _, z, *_ = self.at(alpha, commands={"elevator": elevator})
        return float(-x * math.cos(alpha) - z * math.sin(alpha))

    def thrust(self, speed: float, throttle: float) -> float:
        """Along the body's x axis, from engines and external reactions."""
        self.at(speed=speed, commands={"throttle": throttle})
        return self.fdm.read("forces/fbx-prop-lbs") + self.fdm.read("forces/fbx-external-lbs")

    def line(self, *words: str, axis: str = "") -> int | None:
        """The first line of the model that mentions a word, inside the aerodynamic axis of that name."""
        tree = self.files.trees[self.files.model]
        scopes: list[Element] = [tree]
        if axis:
            scopes = [e for e in tree.all("axis") if e.attributes.get("name", "").upper() == axis]
        for scope in scopes:
            for word in words:
                if found := scope.mentions(word):
                    return found.line
        return scopes[0].line if axis and scopes else None

    def element(self, name: str) -> int | None:
        found = self.files.trees[self.files.model].first(name)
        return found.line if found else None

    def finding(self, rule: str, line: int | None, message: str, remedy: str) -> Finding:
        return Finding(rule, "warning", self.files.model, line, message, remedy)


def _mass(b: _Bench) -> Iterator[Finding]:
    """What airframe.toml states of its sources against what JSBSim has loaded."""
    from aircraft.check.files import toml_line
    from aircraft.datasheets.datasheet import geometry

    stated = b.files.airframe.stated
    if not stated:
        return
    loaded = geometry(b.files.airframe)
    toml = b.files.folder / "airframe.toml"
    for name, value in stated.items():
        if name not in loaded:
            message, remedy = f"stated.{name} is not checked", f"known are {', '.join(loaded)}"
            yield Finding("stated", "error", toml.name, toml_line(toml, name), message, remedy)
        elif abs(loaded[name] - value) > _STATED * abs(value) + 1e-9:
            part = {"jxz_kgm2": "ixz", "jx_kgm2": "ixx", "jy_kgm2": "iyy", "jz_kgm2": "izz"}.get(name, "")
            message = f"{name} is {loaded[name]:.4g} as JSBSim loads it, airframe.toml states {value:.4g}"
            remedy = "correct the one that is wrong"
            if name == "jxz_kgm2" and abs(loaded[name] + value) <= _STATED * abs(value):
                remedy = "the sign of Jxz is reversed: correct negated_crossproduct_inertia or the number"
            yield Finding(
                "stated", "error", b.files.model, b.element(part) if part else None, message, remedy
            )


def _signs(b: _Bench) -> Iterator[Finding]:
    """Signs that the autopilot takes for granted, and those of a stable, damped aircraft."""
    small = 0.05
    slopes = {
        # what, the axis of its moment: moment index, wanted sign, the state or input that is moved
        ("elevator down must push the nose down", "PITCH", "elevator"): (
            4,
            -1,
            {"commands": {"elevator": small}},
        ),
        ("aileron must roll right", "ROLL", "aileron"): (3, 1, {"commands": {"aileron": small}}),
        ("sideslip must turn the nose into the wind", "YAW", "beta"): (5, 1, {"beta": small}),
        ("roll rate must be damped", "ROLL", "p-aero"): (3, -1, {"rates": (small, 0.0, 0.0)}),
        ("pitch rate must be damped", "PITCH", "q-aero"): (4, -1, {"rates": (0.0, small, 0.0)}),
        ("yaw rate must be damped", "YAW", "r-aero"): (5, -1, {"rates": (0.0, 0.0, small)}),
    }
    for (what, axis, word), (index, sign, moved) in slopes.items():
        base = b.at()[index]
        now = b.at(**moved)[index]  # type: ignore[arg-type]
        if (now - base) * sign <= 0:
            yield b.finding("sign", b.line(word, axis=axis), what, "check the sign of that coefficient")


def _yaw_from_aileron(b: _Bench) -> Iterator[Finding]:
    change = b.at(commands={"aileron": 0.1}) - b.at(commands={"aileron": -0.1})
    if change[3] and abs(change[5] / change[3]) > _YAW_SHARE:
        share = change[5] / change[3]
        same = ": the roll coefficient copied?" if abs(abs(share) - 1) < 0.05 else ""
        message = f"ailerons yaw with {share:.2f} of the moment they roll with{same}"
        line = b.line("aileron", "elevon", axis="YAW")
        yield b.finding("yaw-from-aileron", line, message, "check Cn_da; it is a tenth of Cl_da, and adverse")


def _elevator_drag(b: _Bench) -> Iterator[Finding]:
    """At zero lift, where induced drag is out of the way."""
    first, second = b.lift(0.0), b.lift(0.05)
    none = -first * 0.05 / (second - first) if second != first else 0.0
    zero = b.drag(none)
    both = {c: (b.drag(none, elevator=c), b.drag(none, elevator=-c)) for c in (0.1, 0.2)}
    even = {c: 0.5 * (up + down) - zero for c, (up, down) in both.items()}
    odd = 0.5 * (both[0.2][0] - both[0.2][1])
    line = b.line("elevator-pos", "elevon", axis="DRAG") or b.line("elevator-pos", "elevon")
    for e in b.files.trees[b.files.model].all("abs"):
        if e.mentions("elev"):
            line = e.line
    if abs(odd) > 2 * abs(even[0.2]) and abs(odd) > 0.01 * abs(zero):
        message = "drag falls with the elevator to one side: it is signed"
        yield b.finding("elevator-drag", line, message, "use the square of the deflection, or its size")
    elif zero > 0 and even[0.1] > 0 and even[0.2] / even[0.1] < 3:
        angle = abs(_surface(b, "elevator", 0.2) - _surface(b, "elevator", 0.0))
        share = even[0.2] / zero * math.radians(5) / angle if angle else 0.0
        if share > _ELEVATOR_DRAG:
            message = f"drag grows as |elevator|, at 5 deg by {100 * share:.0f} % of the zero-lift drag"
            remedy = "use the square of the deflection if the coefficient is that of de^2"
            yield b.finding("elevator-drag", line, message, remedy)


def _surface(b: _Bench, name: str, command: float) -> float:
    """The position [rad] of the surface that moves most with a command."""
    paths = b.files.airframe.surfaces.values()
    b.at(commands={name: command})
    now = np.array([b.fdm.read(p) for p in paths])
    b.at(commands={name: 0.0})
    moved = np.abs(now - np.array([b.fdm.read(p) for p in paths]))
    return float(moved.max(initial=0.0))


def _stall(b: _Bench) -> Iterator[Finding]:
    angles = np.radians(np.arange(0, 46, 1.5))
    lifts = np.array([b.lift(float(a)) for a in angles])
    if int(np.argmax(lifts)) == len(angles) - 1:
        message = "lift has no maximum up to 45 deg of angle of attack: the wing never stalls"
        line = b.line("aero/alpha-rad", axis="LIFT") or b.line("aero/alpha-rad")
        yield b.finding(
            "stall", line, message, "bend the lift curve, with a table or a blend to a flat plate"
        )


def _saturation(b: _Bench) -> Iterator[Finding]:
    for name, index in (("elevator", 4), ("aileron", 3)):
        once, neutral = (b.at(commands={name: c})[index] for c in (8.0, 0.0))
        twice = b.at(commands={name: 16.0})[index]
        if abs(twice - once) > 0.05 * abs(once - neutral):
            tree = b.files.trees[b.files.model]
            bare = (e for e in tree.all("actuator") if not list(e.all("clipto")))
            where = next(bare, None) or tree.first("flight_control")
            message = (
                f"the moment of the {name} grows without limit with its command: surfaces never saturate"
            )
            remedy = "give the actuator a <clipto> at the surface's travel"
            yield b.finding("saturation", where.line if where else None, message, remedy)


def _thrust(b: _Bench) -> Iterator[Finding]:
    speeds = b.files.airframe.speeds
    slow, fast = (b.thrust(v, 1.0) for v in (speeds.v_min_mps, speeds.v_max_mps))
    line = b.element("external_reactions") or b.element("propulsion")
    if not slow > b.thrust(speeds.v_min_mps, 0.0):
        message = "thrust does not grow with the throttle"
        yield b.finding("thrust", line, message, "connect fcs/throttle-pos-norm to the thrust")
    elif fast > 0.97 * slow:
        span = f"{speeds.v_min_mps:g} to {speeds.v_max_mps:g} m/s"
        message = f"full thrust is {fast / slow:.2f} times as large after {span}: it must fall with airspeed"
        yield b.finding("thrust", line, message, "use a propeller, or T = k Vd (Vd - Va)")


def _trims(files: Files) -> Iterator[Finding]:
    airframe, toml = files.airframe, files.folder / "airframe.toml"
    from aircraft.check.files import toml_line

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
    from aircraft.autopilots.tuning import fly

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
