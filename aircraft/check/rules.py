"""What the text of an airframe folder shows to be wrong, rule by rule."""

from __future__ import annotations

from collections.abc import Callable
from difflib import get_close_matches

import numpy as np

from aircraft.airframes.files import Files, Finding, toml_line
from aircraft.airframes.references import declared
from aircraft.airframes.schema import INVERTING, property_name
from aircraft.autopilots.gains import gain_faults, needed_gains
from aircraft.check.spelling import ENGINE, MODEL
from aircraft.equations.catalogue import xml_of
from aircraft.equations.compiler import MADE_BY
from aircraft.jsbsim.properties import INTEGRALS, NODES, TELEMETRY


def _root(files: Files) -> list[Finding]:
    root = files.trees[files.model]
    if root.name == "fdm_config":
        return []
    return [
        Finding(
            "xml", "error", files.model, root.line, f"root element <{root.name}>", "it must be <fdm_config>"
        )
    ]


def _words(files: Files) -> list[Finding]:
    """JSBSim drops or misreads an element that it does not know, often without a message."""
    findings = []
    for file, tree in files.trees.items():
        engine = file.startswith("engine/")
        for e in tree.walk():
            if e.name in (ENGINE if engine else MODEL):
                continue
            near = get_close_matches(e.name, sorted(ENGINE if engine else MODEL), 1, 0.75)
            if near or not engine:  # an engine file may hold words of an engine that is not known here
                remedy = f"write <{near[0]}>" if near else "remove it"
                if engine:  # it may be right for an engine that is not known here
                    remedy = f"write <{near[0]}> if that is what is meant; JSBSim does not read this one"
                message = f"<{e.name}> is no element of JSBSim"
                findings.append(Finding("misspelt", "error", file, e.line, message, remedy))
    return findings


def _engine(files: Files) -> list[Finding]:
    root = files.trees[files.model]
    if any(e.parent is not None and e.parent.name == "propulsion" for e in root.all("engine")):
        return []
    where = root.first("propulsion") or root
    message = "no engine: JSBSim offers no throttle without one"
    remedy = "add <propulsion> with an <engine>, a placeholder if thrust is an external reaction"
    return [Finding("engine", "error", files.model, where.line, message, remedy)]


_UNITS = {"SLUG*FT2": 1.0, "KG*M2": 0.7375621492772656, "LBS*FT2": 1 / 32.17404855643045}


_INERTIA = {"ixx", "iyy", "izz", "ixy", "ixz", "iyz", "emptywt"}


def _inertia(files: Files) -> list[Finding]:
    mass = files.trees[files.model].first("mass_balance")
    if mass is None:
        line = files.trees[files.model].line
        return [Finding("inertia", "error", files.model, line, "no <mass_balance>", "add it")]
    if wrong := [e for e in mass.children if e.name in _INERTIA and e.number() is None]:
        message = f"<{wrong[0].name}> is no number: {wrong[0].text}"
        return [Finding("inertia", "error", files.model, wrong[0].line, message, "write a number")]
    empty = mass.first("emptywt")
    weight = 0.0 if empty is None else empty.number() or 0.0
    if weight < 0.0 or (weight == 0.0 and mass.first("pointmass") is None):
        line = (empty or mass).line
        message = f"<emptywt> is {weight:g}: a mass is above zero"
        return [Finding("inertia", "error", files.model, line, message, "write the mass of the aircraft")]
    terms = {
        e.name: (e.number() or 0.0) * _UNITS.get(e.attributes.get("unit", "SLUG*FT2"), 1.0)
        for e in mass.children
    }
    at = {e.name: e.line for e in mass.children}
    x, y, z, xy, xz, yz = (terms.get(f"i{n}", 0.0) for n in ("xx", "yy", "zz", "xy", "xz", "yz"))
    findings = []
    low, middle, high = np.linalg.eigvalsh([[x, xy, xz], [xy, y, yz], [xz, yz, z]])
    if low <= 0 or high > (low + middle) * (1 + 1e-9):
        moments = f"{low:.4g}, {middle:.4g} and {high:.4g} slug ft^2"
        message = f"no body has principal moments of inertia {moments}"
        remedy = "estimate them again: all positive, the largest not above the sum of the others"
        findings.append(Finding("inertia", "error", files.model, at.get("ixx", mass.line), message, remedy))
    if (xy or xz or yz) and "negated_crossproduct_inertia" not in mass.attributes:
        remedy = 'add negated_crossproduct_inertia="false" to <mass_balance> if it is the integral of x z dm'
        findings.append(
            Finding("jxz-sign", "error", files.model, mass.line, "the sign of Jxz is not stated", remedy)
        )
    return findings


def _metrics(files: Files) -> list[Finding]:
    """Wing area, span and chord, by which JSBSim multiplies and divides: above zero."""
    root = files.trees[files.model]
    metrics = root.first("metrics")
    findings = []
    for name in ("wingarea", "wingspan", "chord"):
        e = None if metrics is None else metrics.first(name)
        size = 0.0 if e is None else e.number()
        if size is None or size > 0.0:  # of what is no number, JSBSim speaks
            continue
        message = f"no <{name}>" if e is None else f"<{name}> is {e.text}: it must be above zero"
        where = (e or metrics or root).line
        findings.append(Finding("metrics", "error", files.model, where, message, f"write the true <{name}>"))
    return findings


def _loaded_twice(files: Files) -> list[Finding]:
    """A system file that the model names twice: its components run twice in a step."""
    seen: dict[str, int] = {}
    findings = []
    for e in files.trees[files.model].all("system"):
        name = e.attributes.get("file", "").removesuffix(".xml")
        if name and name in seen:
            message = f"the system {name} is already loaded on line {seen[name]}"
            findings.append(Finding("duplicate", "error", files.model, e.line, message, "remove this line"))
        elif name:
            seen[name] = e.line
    return findings


def _pitch_trim(files: Files) -> list[Finding]:
    used = [
        e
        for tree in files.trees.values()
        for e in tree.walk()
        if e.text.lstrip("-") == "fcs/pitch-trim-cmd-norm"
    ]
    if any(e.name in ("property", "p", "input") for e in used):
        return []
    where = files.trees[files.model].first("flight_control") or files.trees[files.model]
    remedy = "add fcs/pitch-trim-cmd-norm to what moves the elevator: JSBSim's own trim needs it"
    return [
        Finding(
            "pitch-trim", "error", files.model, where.line, "nothing reads fcs/pitch-trim-cmd-norm", remedy
        )
    ]


def _duplicates(files: Files) -> list[Finding]:
    """JSBSim loads two components of one name in a channel without a message, and uses the later one."""
    findings = []
    for file, channel in files.elements("channel"):
        seen: dict[str, int] = {}
        for e in channel.children:
            name = e.attributes.get("name")
            if name and e.name not in ("property",) and name in seen:
                message = f"{name} is already the name of the component on line {seen[name]}"
                findings.append(Finding("duplicate", "error", file, e.line, message, "rename one of them"))
            elif name:
                seen[name] = e.line
    return findings


def _autopilot(files: Files) -> list[Finding]:
    """The properties that the testbed commands, reads and settles, and a property for every gain."""
    have, findings = declared(files), []
    wanted = {p for p in NODES.values() if p.startswith("ap/")}
    wanted |= {p for p, _, _ in TELEMETRY.values() if p.startswith("ap/")}
    if files.airframe.autopilot == INVERTING:
        wanted |= set(INTEGRALS.values())
    if not wanted & have:
        return [_no_autopilot(files)]
    system = next((f for f in files.trees if f.startswith("systems/")), files.model)
    line = files.trees[system].line
    if missing := sorted(wanted - have):
        message = f"the autopilot has no {', '.join(missing)}"
        findings.append(Finding("autopilot", "error", system, line, message, _compile(files)))
    toml = files.folder / "airframe.toml"
    needed = needed_gains(files.airframe)  # the rule on gains reports the others
    for section, names in files.airframe.gains.items():
        for name in names:
            if property_name(f"{section}_{name}") not in have and f"{section}_{name}" in needed:
                message = f"gain {section}.{name}: the autopilot has no {property_name(f'{section}_{name}')}"
                where = toml_line(toml, f"gains.{section}.{name}")
                findings.append(Finding("autopilot", "error", toml.name, where, message, _compile(files)))
    return findings


def _no_autopilot(files: Files) -> Finding:
    """For a model that names no autopilot: where and how to name it."""
    root = files.trees[files.model]
    where = root.first("flight_control") or root
    remedy = 'add <system file="autopilot"/> to <fdm_config>'
    if not (files.folder / "systems" / "autopilot.xml").is_file():
        remedy = f"{_compile(files)}; then {remedy}"
    return Finding("autopilot", "error", files.model, where.line, "the model names no autopilot", remedy)


def _gains(files: Files) -> list[Finding]:
    toml = files.folder / "airframe.toml"
    return [
        Finding("gains", "error", toml.name, toml_line(toml, f"gains.{f.gain}"), str(f), f.remedy)
        for f in gain_faults(files.airframe)
    ]


def _current(files: Files) -> list[Finding]:
    """Whether the compiled autopilot is what the equations and the gains say."""
    path = files.folder / "systems" / "autopilot.xml"
    if "systems/autopilot.xml" not in files.trees or not path.is_file():
        return []
    text = path.read_text(encoding="utf-8", errors="replace")
    if not any(mark in text for mark in (MADE_BY, "Made by `python -m aircraft.autopilot")):
        return []  # an autopilot of the user's own
    try:
        now = xml_of(files.airframe)
    except ValueError:
        return []  # a missing gain, which another rule names
    if text == now:
        return []
    message = "not what the equations and the gains of airframe.toml compile to"
    return [Finding("autopilot", "warning", "systems/autopilot.xml", 1, message, _compile(files))]


def _compile(files: Files) -> str:
    return f"run: testbed aircraft autopilot {files.airframe.argument}"


RULES: tuple[Callable[[Files], list[Finding]], ...] = (
    _root,
    _words,
    _engine,
    _inertia,
    _metrics,
    _pitch_trim,
    _duplicates,
    _loaded_twice,
    _gains,
    _autopilot,
    _current,
)
