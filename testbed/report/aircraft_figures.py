"""Draws the figures of an airframe's datasheet."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from aircraft.autopilots.identification import model
from testbed.report.style import BLUE, GREEN, LIMIT, PAGE, VERMILION, limits, nth

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from aircraft.datasheets.datasheet import Datasheet, Loop


def _sheet(rows: int, columns: int, height: float) -> tuple[Figure, np.ndarray]:
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(rows, columns, figsize=(PAGE, height), layout="constrained", squeeze=False)
    return figure, axes


def trim(sheet: Datasheet) -> Figure:
    """Angle of attack, bank, throttle and elevator over speed, by climb rate and turn rate."""
    figure, ((alpha, bank), (throttle, elevator)) = _sheet(2, 2, 4.6)
    cases = list(dict.fromkeys((r["zeta_mps"], round(r["omega_degps"], 1)) for r in sheet.trims))
    for k, (zeta, omega) in enumerate(cases):
        rows = [r for r in sheet.trims if (r["zeta_mps"], round(r["omega_degps"], 1)) == (zeta, omega)]
        name = f"turn {omega:g} deg/s" if omega else f"climb {zeta:+g} m/s" if zeta else "level"
        look = nth(k) | {"marker": "o", "markersize": 2.5}
        v = [r["v_mps"] for r in rows]
        for axes, key, scale in (
            (alpha, "alpha_deg", 1.0),
            (bank, "roll_deg", -1.0),
            (throttle, "throttle", 1.0),
            (elevator, "elevator", 1.0),
        ):
            axes.plot(v, [scale * r[key] for r in rows], label=name, **look)
    labels = ("angle of attack [deg]", "bank into a left turn [deg]", "throttle", "elevator, share of travel")
    for axes, label in zip((alpha, bank, throttle, elevator), labels, strict=True):
        axes.set(xlabel="speed [m/s]", ylabel=label)
    limits(throttle, 0.0, 1.0)
    alpha.legend(loc="best")
    return figure


def envelope(sheet: Datasheet) -> Figure:
    """What the airframe can do at each speed, against what the filter's box asks."""
    figure, ((climb, along), (load, stall)) = _sheet(2, 2, 4.6)
    v = [x.v for x in sheet.envelope]
    climb.fill_between(v, [x.sink for x in sheet.envelope], [x.climb for x in sheet.envelope], alpha=0.15)
    climb.plot(v, [x.climb for x in sheet.envelope], color=BLUE, label="best climb")
    climb.plot(v, [x.sink for x in sheet.envelope], color=VERMILION, ls="--", label="deepest sink")
    limits(climb, sheet.box.zeta, -sheet.box.zeta)
    climb.text(v[0], sheet.box.zeta, " box", va="bottom", fontsize=7)
    along.plot(v, [x.acceleration for x in sheet.envelope], color=BLUE, label="full throttle")
    along.plot(v, [x.deceleration for x in sheet.envelope], color=VERMILION, ls="--", label="idle")
    load.plot(v, [x.load_available for x in sheet.envelope], color=BLUE, label="of the wing")
    load.plot(
        v, [x.load_in_turn for x in sheet.envelope], color=VERMILION, ls="--", label="in the box's turn"
    )
    load.set_ylim(0, None)
    stall.plot(v, [math.degrees(x.alpha) for x in sheet.envelope], color=BLUE, label="level flight")
    stall.plot(
        v,
        [math.degrees(x.alpha_stall) for x in sheet.envelope],
        color=VERMILION,
        ls="--",
        label="largest lift",
    )
    labels = ("climb rate [m/s]", "level acceleration [m/s$^2$]", "load factor", "angle of attack [deg]")
    for axes, label in zip((climb, along, load, stall), labels, strict=True):
        axes.set(xlabel="speed [m/s]", ylabel=label)
        axes.legend(loc="best")
    return figure


def modes(sheet: Datasheet) -> Figure:
    """Eigenvalues of the airframe over speed; the arrow of speed goes from small to large marks."""
    figure, ((wide, near),) = _sheet(1, 2, 2.9)
    names = list(dict.fromkeys(m.name for listed in sheet.modes.values() for m in listed))
    for axes in (wide, near):
        for k, name in enumerate(names):
            sizes = np.linspace(2.0, 8.0, len(sheet.modes))
            for size, listed in zip(sizes, sheet.modes.values(), strict=True):
                values = [m.eigenvalue for m in listed if m.name == name]
                axes.plot(
                    [x.real for x in values],
                    [x.imag for x in values],
                    "o",
                    color=nth(k)["color"],
                    markersize=size,
                    markerfacecolor="none",
                    label=name if size == sizes[len(sizes) // 2] else None,
                )
        axes.axvline(0.0, **LIMIT)
        axes.set(xlabel="real [1/s]", ylabel="imaginary [1/s]")
    near.set(xlim=(-1.0, 0.3), ylim=(-0.1, 1.2), title="near the origin")
    wide.set_title("all; larger marks are faster flight")
    wide.legend(loc="best")
    return figure


def loops(sheet: Datasheet) -> Figure:
    """Bode plots of each loop at every trim speed: line the linear model, dots the measurement."""
    names = list(dict.fromkeys(x.name for x in sheet.loops))
    figure, axes = _sheet(2, len(names), 4.4)
    for k, name in enumerate(names):
        for s, loop in enumerate(x for x in sheet.loops if x.name == name):
            _bode(axes[0, k], axes[1, k], loop, nth(s)["color"])
        axes[0, k].set(title=name, ylim=(-60, 45))
        axes[1, k].set(xlabel="frequency [rad/s]", ylim=(-360, 180), yticks=range(-360, 181, 90))
        axes[0, k].axhline(0.0, **LIMIT)
        axes[1, k].axhline(-180.0, **LIMIT)
    axes[0, 0].set_ylabel("|L| [dB]")
    axes[1, 0].set_ylabel("phase [deg]")
    axes[0, -1].legend(loc="upper right")
    figure.suptitle("line: linear model, dots: measured by injection", fontsize=8)
    return figure


def _bode(gain: Axes, phase: Axes, loop: Loop, color: str) -> None:
    for r, line in ((loop.model_l, "-"), (loop.measured_l, "")):
        angle = np.degrees(np.unwrap(np.angle(r.loop)))
        # the branch that is between -270 and 90 deg where the loop crosses unity
        middle = angle[int(np.argmin(np.abs(np.log(np.abs(r.loop)))))]
        angle -= 360.0 * round((middle + 90.0) / 360.0)
        angle[np.abs(r.loop) < 1e-3] = np.nan  # off the plot of gains
        every = slice(None) if line else slice(None, None, 12)
        look = {"color": color, "linestyle": line, "marker": "" if line else "o", "markersize": 2.5}
        name = f"{loop.v:g} m/s" if line else None
        gain.semilogx(r.frequency[every], 20 * np.log10(np.abs(r.loop[every])), label=name, **look)
        phase.semilogx(r.frequency[every], angle[every], **look)


def steps(sheet: Datasheet) -> Figure:
    """The steps of the specification, each channel over its final value."""
    groups = {"turn": "omega", "speed": "v", "climb": "zeta"}
    figure, axes = _sheet(2, 2, 4.8)
    for axes_, (group, channel) in zip(axes.flat, groups.items(), strict=False):
        listed = [(s, f) for s, f in sheet.steps if s.group == group]
        for k, (step, f) in enumerate(listed):
            index = ("v", "omega", "zeta").index(channel)
            before, after = (step.start, 0.0, 0.0)[index], step.command[index]
            share = (getattr(f, channel) - before) / (after - before)
            name = f"{before:g} to {after:g} m/s" if group == "speed" else f"{step.start:g} m/s"
            name = f"{after:g} m/s at {step.start:g} m/s" if group == "climb" else name
            axes_.plot(f.t, share, label=name, **nth(k))
        axes_.set(
            title=channel, xlim=(0, 4), ylim=(-0.05, 1.15), xlabel="time [s]", ylabel="share of the step"
        )
        axes_.axhline(1.0, **LIMIT)
        axes_.legend(loc="lower right")
    last = axes[1, 1]
    for k, (step, f) in enumerate((s, f) for s, f in sheet.steps if s.group == "all"):
        for channel, dash in (("v", "-"), ("omega", "--"), ("zeta", ":")):
            index = ("v", "omega", "zeta").index(channel)
            before, after = (step.start, 0.0, 0.0)[index], step.command[index]
            share = (getattr(f, channel) - before) / (after - before)
            label = {"label": channel} if k == 0 else {}
            last.plot(f.t, share, color=nth(k)["color"], linestyle=dash, **label)
    last.set(
        title="all three at once, from 16, 18 and 20 m/s", xlim=(0, 6), ylim=(-0.1, 1.2), xlabel="time [s]"
    )
    last.axhline(1.0, **LIMIT)
    last.legend(loc="lower right")
    return figure


def channels(sheet: Datasheet) -> Figure | None:
    """Identified channels beside the steps they stand for."""
    known = sheet.airframe.identified
    if known is None:
        return None
    figure, axes = _sheet(1, 3, 2.4)
    shown = {"v": ("speed", 0), "omega": ("turn", 1), "zeta": ("climb", 1)}
    for axes_, (name, (group, which)) in zip(axes.flat, shown.items(), strict=True):
        step, f = [(s, f) for s, f in sheet.steps if s.group == group][which]
        c, index = getattr(known, name), ("v", "omega", "zeta").index(name)
        before, after = (step.start, 0.0, 0.0)[index], step.command[index]
        rises = c.rate_max or math.inf
        falls = -c.rate_min if c.rate_min is not None else rises
        constant = max(c.time_constant_s, 1e-9)
        y = model(np.array([before]), np.array([after]), constant, c.delay_s, falls, rises, len(f.t))[0]
        scale = math.degrees(1) if name == "omega" else 1.0
        axes_.plot(f.t, scale * getattr(f, name), color=VERMILION, ls="--", label="aircraft")
        axes_.plot(f.t, scale * y, color=GREEN, ls="-.", label="identified")
        unit = "deg/s" if name == "omega" else "m/s"
        axes_.set(xlabel="time [s]", ylabel=f"{name} [{unit}]", xlim=(0, 3))
        axes_.legend(loc="lower right")
    return figure


def all_of(sheet: Datasheet) -> dict[str, Figure]:
    """Every plot by name; made inside `style.drawing`."""
    made = {
        "trim": trim(sheet),
        "envelope": envelope(sheet),
        "modes": modes(sheet),
        **({"loops": loops(sheet)} if sheet.loops else {}),
        "steps": steps(sheet),
    }
    last = channels(sheet)
    return made | ({"channels": last} if last else {})
