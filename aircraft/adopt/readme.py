"""Writes the README of an adopted aircraft: where it comes from, what was found, assumed and flown."""

from __future__ import annotations

import math
from collections.abc import Sequence

from aircraft.adopt.adopting import Model
from aircraft.adopt.scoring import Scored
from aircraft.adopt.verdict import Verdict


def readme(model: Model, source: str, scored: Sequence[Scored], disks: dict[tuple[float, str], float],
           verdict: Verdict) -> str:  # fmt: skip
    """The text of README.md."""
    name, about = model.airframe.name, model.copy.about
    lines = [f"# {name}", "", f"Adopted from `{source}` by `testbed aircraft adopt`.", ""]
    lines += [f"{key.capitalize()}: {text}." for key, text in about.items()]
    if "license" not in about:
        lines.append("The model states no licence: its author's terms apply.")
    lines += ["", f"Verdict: **{verdict.kind}**.", *(f"- {remark}" for remark in verdict.remarks), ""]
    lines += ["## Found", "", *_found(model), ""]
    if model.notes:
        lines += ["## Left out, added and assumed", "", *(f"- {note}" for note in model.notes), ""]
    lines += [
        "## Steps flown",
        "",
        "| step | t63 [s] | overshoot [%] | final error [%] |",
        "|---|---|---|---|",
    ]
    for s in scored:
        lines.append(
            f"| {s.case.title} | {s.t63:.2f} | {100 * s.overshoot:.1f} | {100 * s.final_error:.1f} |"
        )
    lines += ["", "## Disk margins", "", "| loop | at [m/s] | disk margin |", "|---|---|---|"]
    lines += [f"| {loop} | {v:g} | {disk:.2f} |" for (v, loop), disk in disks.items()]
    lines += [
        "",
        "The gains follow from these numbers by formulas and a short search;",
        f"`testbed aircraft adopt` remakes them. `testbed aircraft describe {name}` measures the rest.",
        "",
    ]
    return "\n".join(lines)


def _found(model: Model) -> list[str]:
    f, t, c, e = model.found, model.times, model.controls, model.airframe.engines
    flight, engines = model.airframe.speeds, "engines" if e.count > 1 else "engine"
    rudder = "none" if c.rudder is None else f"{_degrees(c.rudder.travel)} deg"
    return [
        f"- stall at {f.stall:.1f} m/s ({math.degrees(f.stall_alpha):.0f} deg, CL {f.cl_max:.2f});"
        f" level flight from {f.lowest:.1f} to {f.top:.1f} m/s or more",
        f"- flown from {flight.v_min_mps:g} to {flight.v_max_mps:g} m/s; steps of"
        f" {math.degrees(flight.turn_radps or 0):.1f} deg/s, {flight.climb_mps:g} m/s of climb and"
        f" {flight.step_mps:g} m/s of speed",
        f"- {e.count} {engines}, throttle from {e.idle:g} to {e.full:g}; thrust follows in {t.thrust:.2f} s",
        f"- travels: elevator {_degrees(c.elevator.travel)} deg, aileron {_degrees(c.aileron.travel)} deg,"
        f" rudder {rudder}{'; elevator and aileron share surfaces' if c.shared else ''}",
        f"- roll mode {t.roll:.2f} s, short period {t.short_period:.1f} rad/s, lift {t.lift:.2f} per s",
    ]


def _degrees(rad: float) -> str:
    return f"{math.degrees(abs(rad)):.0f}"
