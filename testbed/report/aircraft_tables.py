"""Makes the tables of an airframe's datasheet, for the terminal, the page and the guide."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from aircraft.autopilots.specification import GROUPS, Row

if TYPE_CHECKING:
    from aircraft.datasheets.datasheet import Datasheet

Rows = list[dict[str, Any]]

# Quantities of the specification: what to call them, their unit, and by what to multiply.
QUANTITIES = {
    "t63_s": ("t63", "s", 1.0),
    "settling_s": ("5 % settling", "s", 1.0),
    "overshoot": ("overshoot", "%", 100.0),
    "omega_overshoot": ("overshoot of omega", "%", 100.0),
    "final_error": ("steady error", "%", 100.0),
    "altitude_change_m": ("altitude change", "m", 1.0),
    "speed_change_mps": ("speed change", "m/s", 1.0),
    "crossings": ("crossings of the final value by 2 %", "", 1.0),
    "v_above": ("largest speed", "m/s", 1.0),
    "v_below": ("least speed", "m/s", 1.0),
    "limited_zeta": ("limitation reported", "", 1.0),
    "gain_db": ("gain margin", "dB", 1.0),
    "phase_deg": ("phase margin", "deg", 1.0),
    "disk": ("disk margin", "", 1.0),
    "surface_share": ("largest share of the surfaces' travel", "", 1.0),
    "v_rms_mps": ("rms error of v", "m/s", 1.0),
    "omega_rms_degps": ("rms error of omega", "deg/s", 1.0),
    "zeta_rms_mps": ("rms error of zeta", "m/s", 1.0),
}


def tables(sheet: Datasheet) -> dict[str, Rows]:
    """Title -> rows, in the order of reading; an absent number is nan or None."""
    found = {
        "Geometry and mass": geometry(sheet),
        "Steady flight; m/s, deg/s, deg, shares of full travel": trim(sheet),
        f"Envelope; m/s, m/s^2, deg, g; turning at {math.degrees(sheet.box.omega):.3g} deg/s": envelope(
            sheet
        ),
        "Corners of the filter's box; m/s, deg/s": corners(sheet),
        "Modes of the airframe, controls fixed": modes(sheet),
        "Stability under the autopilot": stability(sheet),
        "Loops broken at the plant input; measured by injection in brackets": loops(sheet),
        "Step specification": specification([r for r in sheet.rows if r.group != "margins"]),
    }
    if sheet.airframe.identified:
        found["Identified channels"] = identified(sheet)
    return found


def markdown(sheet: Datasheet) -> str:
    """The tables as Markdown, for the guide; a step's name stands once."""
    a = sheet.airframe
    lines = [
        f"# {a.title}",
        "",
        f"Made by `testbed aircraft describe {a.name} --markdown`; the same with plots:",
    ]
    lines += [f"`testbed aircraft describe {a.name} --out FOLDER`.", ""]
    for title, rows in tables(sheet).items():
        if not rows:
            continue
        lines += [f"## {title}", "", "| " + " | ".join(rows[0]) + " |", "|---" * len(rows[0]) + "|"]
        before = ""
        for row in rows:
            cells = [_text(v) if k != "step" or v != before else "" for k, v in row.items()]
            before = row.get("step", "")
            lines.append("| " + " | ".join(cells) + " |")
        lines.append("")
    return "\n".join(lines)


def _text(value: Any) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "–"
    return f"{value:.4g}" if isinstance(value, float) else str(value).replace("|", "/")


def geometry(sheet: Datasheet) -> Rows:
    units = {"kg": "kg", "m2": "m^2", "m": "m", "npm2": "N/m^2", "kgm2": "kg m^2", "ratio": ""}
    rows = []
    for key, value in sheet.geometry.items():
        name, _, unit = key.rpartition("_")
        name = key.replace("_", " ") if unit == "ratio" else name.replace("_", " ")
        name = name.replace("principal", "principal J")
        name = name.replace("jx", "Jx").replace("jy", "Jy").replace("jz", "Jz")
        rows.append({"quantity": name, "value": value, "unit": units[unit]})
    return rows


def trim(sheet: Datasheet) -> Rows:
    keys = ["v_mps", "zeta_mps", "omega_degps", "alpha_deg", "beta_deg", "roll_deg", "elevator", "aileron"]
    if sheet.airframe.has_rudder:
        keys.append("rudder")
    short = {"omega_degps": "omega", "v_mps": "v", "zeta_mps": "zeta"}
    return [
        {short.get(k, k.removesuffix("_deg")): _round(row[k], 3) for k in [*keys, "throttle"]}
        for row in sheet.trims
    ]


def envelope(sheet: Datasheet) -> Rows:
    return [
        {
            "v": x.v,
            "bank": _round(math.degrees(x.bank), 1),
            "load turn": _round(x.load_in_turn, 3),
            "load max": _round(x.load_available, 2),
            "climb": _round(x.climb, 2),
            "sink": _round(x.sink, 2),
            "accel": _round(x.acceleration, 2),
            "decel": _round(x.deceleration, 2),
            "v / stall": _round(x.stall_margin, 2),
            "alpha left": _round(math.degrees(x.alpha_stall - x.alpha), 1),
        }
        for x in sheet.envelope
    ]


def corners(sheet: Datasheet) -> Rows:
    rows = []
    for c in sheet.corners:
        row: dict[str, Any] = {
            "v": c.v,
            "omega": _round(math.degrees(c.omega), 1),
            "zeta": c.zeta,
            "steady": "yes" if c.sustainable else "no",
        }
        if c.sustainable:
            row |= dict.fromkeys(("off 0.5 m/s in", "autopilot holds", "gives", "steady from"), "")
        else:
            row |= {
                "off 0.5 m/s in": f"{c.lasts:.2f} s",
                "autopilot holds": f"{c.held:.2f} s" if c.held else "never",
                "gives": c.gives,
                "steady from": f"{c.balances:.1f} m/s" if math.isfinite(c.balances) else "nowhere",
            }
        rows.append(row)
    return rows


def modes(sheet: Datasheet) -> Rows:
    """One row a speed, one column a mode: rad/s and damping ratio, or the rate of a real one."""
    rows = []
    for v, listed in sheet.modes.items():
        row: dict[str, Any] = {"v": v}
        for m in listed:
            one = f"{m.frequency:.2f} rad/s, {m.damping:.2f}"
            row[m.name] = one if m.eigenvalue.imag else f"{m.eigenvalue.real:.2f} /s"
        rows.append(row)
    names = list(dict.fromkeys(k for row in rows for k in row))
    return [{k: row.get(k) for k in names} for row in rows]


def stability(sheet: Datasheet) -> Rows:
    """Every unstable motion; else the speeds at which there was none."""
    if not sheet.unstable:
        speeds = ", ".join(f"{v:g}" for v in sheet.airframe.speeds.trim_mps)
        return [{"v": speeds, "closed loop": "stable: all poles decay, and so does a small pulse in flight"}]
    return [
        {
            "v": x.v,
            "loop": x.loop,
            "closed loop": "unstable",
            "frequency": f"{x.frequency:.1f} rad/s",
            "growth": "does not decay" if x.flown else f"{x.growth:.2g} per s",
            "shown by": "flight" if x.flown else "linear model",
        }
        for x in sheet.unstable
    ]


def loops(sheet: Datasheet) -> Rows:
    return [
        {
            "v": x.v,
            "loop": x.name,
            "gain dB": f"{x.model.gain_db:.1f} ({x.measured.gain_db:.1f})",
            "phase deg": f"{x.model.phase_deg:.1f} ({x.measured.phase_deg:.1f})",
            "disk": f"{x.model.disk:.2f} ({x.measured.disk:.2f})",
            "crossover": f"{x.model.crossover:.1f} ({x.measured.crossover:.1f})",
            "off dB, deg": f"{x.off_db:.2f}, {x.off_deg:.1f}",
        }
        for x in sheet.loops
    ]


def identified(sheet: Datasheet) -> Rows:
    known = sheet.airframe.identified
    if known is None:
        return []
    units = {"v": "m/s2", "omega": "deg/s2", "zeta": "m/s2"}
    rows = []
    for name, unit in units.items():
        c = getattr(known, name)
        scale = math.degrees(1) if name == "omega" else 1.0
        least = c.rate_min if c.rate_min is not None else -(c.rate_max or math.inf)
        row = {"channel": name, "time constant s": c.time_constant_s, "delay s": c.delay_s}
        limits = {
            "slowest": f"{least * scale:.3g} {unit}",
            "fastest": f"{(c.rate_max or math.inf) * scale:.3g} {unit}",
        }
        best = (
            {}
            if c.best is None
            else {"best model": f"{c.best.kind}, off by {100 * c.best.validation_rms:.1f} %"}
        )
        rows.append(row | limits | best)
    return rows


def specification(rows: list[Row]) -> Rows:
    """Case, quantity, value, target and whether it is met."""
    listed = []
    for r in sorted(rows, key=lambda r: GROUPS.index(r.group)):
        name, unit, scale = QUANTITIES[r.quantity]
        sign = "at most" if r.at_most else "at least"
        unstable = r.group == "margins" and math.isnan(r.value)
        bound = f"{sign} {r.target * scale:.3g} {unit}".rstrip() if math.isfinite(r.target) else ""
        listed.append(
            {
                "step": r.case,
                "quantity": name,
                "value": "unstable" if unstable else f"{r.value * scale:.3g} {unit}".rstrip(),
                "target": bound,
                "met": ("yes" if r.met else "NO") if bound else "",
            }
        )
    return listed


def worst(rows: list[Row]) -> list[Row]:
    """Of the margins, the least of each loop and kind over the trim speeds, in place of them all."""
    least: dict[tuple[str, str], Row] = {}
    for r in rows:
        if r.group == "margins":
            key = (r.case.split(" at ")[0], r.quantity)
            if key not in least or not r.value >= least[key].value:
                least[key] = r
    return [r for r in rows if r.group != "margins"] + list(least.values())


def _round(value: float, digits: int) -> float:
    return round(value, digits) + 0.0 if math.isfinite(value) else math.nan
