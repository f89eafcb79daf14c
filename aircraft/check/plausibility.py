"""Checks what a loaded model does at rest: mass, signs, damping, drag, stall, saturation, thrust."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from aircraft.airframes.files import Finding, toml_line
from aircraft.check.bench import Bench
from aircraft.datasheets.datasheet import measured

# Thresholds of plausibility. Our airframes are far inside: yaw from aileron 0.03 (X8) and 0.23 (Rascal) of
# its roll.
_YAW_SHARE = 0.5
_ELEVATOR_DRAG = (
    0.15  # of the zero-lift drag at 5 deg, growing as |de|: 0.09 on the Rascal, 0.28 with the fault
)
_STATED = 0.01
# Engines and thrusters whose thrust JSBSim works out of airspeed or Mach number: it may be flat.
_JSBSIMS_OWN = frozenset(("turbine_engine", "turboprop_engine", "propeller"))


def _mass(b: Bench) -> Iterator[Finding]:
    """What airframe.toml states of its sources against what JSBSim has loaded."""
    stated = b.files.airframe.stated
    if not stated:
        return
    b.at()
    loaded = measured(b.fdm)
    toml = b.files.folder / "airframe.toml"
    for name, value in stated.items():
        if name not in loaded:
            message, remedy = f"stated.{name} is not checked", f"known are {', '.join(loaded)}"
            yield Finding("stated", "error", toml.name, toml_line(toml, f"stated.{name}"), message, remedy)
        elif abs(loaded[name] - value) > _STATED * abs(value) + 1e-9:
            part = {"jxz_kgm2": "ixz", "jx_kgm2": "ixx", "jy_kgm2": "iyy", "jz_kgm2": "izz"}.get(name, "")
            message = f"{name} is {loaded[name]:.4g} as JSBSim loads it, airframe.toml states {value:.4g}"
            remedy = "correct the one that is wrong"
            if name == "jxz_kgm2" and abs(loaded[name] + value) <= _STATED * abs(value):
                remedy = "the sign of Jxz is reversed: correct negated_crossproduct_inertia or the number"
            yield Finding(
                "stated", "error", b.files.model, b.element(part) if part else None, message, remedy
            )


def _signs(b: Bench) -> Iterator[Finding]:
    """Signs that the autopilot assumes, and those of a stable, damped aircraft."""
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


def _yaw_from_aileron(b: Bench) -> Iterator[Finding]:
    change = b.at(commands={"aileron": 0.1}) - b.at(commands={"aileron": -0.1})
    if change[3] and abs(change[5] / change[3]) > _YAW_SHARE:
        share = change[5] / change[3]
        same = ": the roll coefficient copied?" if abs(abs(share) - 1) < 0.05 else ""
        message = f"ailerons yaw with {share:.2f} of the moment they roll with{same}"
        line = b.line("aileron", "elevon", axis="YAW")
        yield b.finding("yaw-from-aileron", line, message, "check Cn_da; it is a tenth of Cl_da, and adverse")


def _elevator_drag(b: Bench) -> Iterator[Finding]:
    """Drag from the elevator, at zero lift, where there is no induced drag."""
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


def _surface(b: Bench, name: str, command: float) -> float:
    """The position [rad] of the surface that moves most with a command."""
    paths = b.files.airframe.surfaces.values()
    b.at(commands={name: command})
    now = np.array([b.fdm.read(p) for p in paths])
    b.at(commands={name: 0.0})
    moved = np.abs(now - np.array([b.fdm.read(p) for p in paths]))
    return float(moved.max(initial=0.0))


def _stall(b: Bench) -> Iterator[Finding]:
    angles = np.radians(np.arange(0, 46, 1.5))
    lifts = np.array([b.lift(float(a)) for a in angles])
    if int(np.argmax(lifts)) == len(angles) - 1:
        message = "lift has no maximum up to 45 deg of angle of attack: the wing never stalls"
        line = b.line("aero/alpha-rad", axis="LIFT") or b.line("aero/alpha-rad")
        yield b.finding(
            "stall", line, message, "bend the lift curve, with a table or a blend to a flat plate"
        )


def _saturation(b: Bench) -> Iterator[Finding]:
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


def _thrust(b: Bench) -> Iterator[Finding]:
    speeds = b.files.airframe.speeds
    slow, fast = (b.thrust(v, 1.0) for v in (speeds.v_min_mps, speeds.v_max_mps))
    line = b.element("external_reactions") or b.element("propulsion")
    if not slow > b.thrust(speeds.v_min_mps, 0.0):
        message = "thrust does not grow with the throttle"
        yield b.finding("thrust", line, message, "connect fcs/throttle-pos-norm to the thrust")
    elif fast > 0.97 * slow and not _JSBSIMS_OWN & {tree.name for tree in b.files.trees.values()}:
        span = f"{speeds.v_min_mps:g} to {speeds.v_max_mps:g} m/s"
        message = f"full thrust is {fast / slow:.2f} times as large after {span}: it must fall with airspeed"
        yield b.finding("thrust", line, message, "use a propeller, or T = k Vd (Vd - Va)")


PLAUSIBILITY: tuple[Callable[[Bench], Iterator[Finding]], ...] = (
    _mass,
    _signs,
    _yaw_from_aileron,
    _elevator_drag,
    _stall,
    _saturation,
    _thrust,
)
