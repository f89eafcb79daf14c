"""Draws the loops of several airframes or sets of gains over each other: Bode, Nyquist and step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.report.style import LIMIT, PAGE, nth

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from aircraft.autopilots.margins import Margins
    from aircraft.datasheets.overlay import Compared, Loop

_UNITS = {"v": "m/s", "omega": "deg/s", "zeta": "m/s"}
_NAMES = {"v": "ground speed", "omega": "turn rate", "zeta": "climb rate"}
# Below this gain the phase of a measured loop is noise, and off the plot.
_FADED = 3e-3
_TIMES_APART = 4.0  # of the times to 63 %: from here on time is drawn in logarithms
_SWING = 0.05  # of the step: what an answer still moves by where the plot of it ends


def figures(found: Sequence[Compared]) -> dict[str, Figure]:
    """One figure for each loop that any of them has, by the loop's name; made inside `style.drawing`."""
    names = list(dict.fromkeys(name for c in found for name in c.loops))
    return {name: _figure(name, found) for name in names}


def _figure(name: str, found: Sequence[Compared]) -> Figure:
    from matplotlib import pyplot as plt

    from aircraft.datasheets.overlay import SHOWN_BY

    with_loop = [(k, c) for k, c in enumerate(found) if name in c.loops]
    figure, ((gain, nyquist), (phase, step)) = plt.subplots(
        2, 2, figsize=(PAGE, 5.2 + 0.22 * len(with_loop)), layout="constrained"
    )
    for k, c in with_loop:
        look, loop = _look(k), c.loops[name]
        _bode(gain, phase, loop, look, legend(c, loop))
        _nyquist(nyquist, loop, look)
    for axes, level in ((gain, 0.0), (phase, -180.0)):
        axes.axhline(level, **LIMIT)
        axes.set_xlim(0.1, 300)
    gain.set(ylabel="|L| [dB]", ylim=(-50, 50), title="Bode")
    phase.set(xlabel="frequency [rad/s]", ylabel="phase [deg]", ylim=(-360, 90), yticks=range(-360, 91, 90))
    _plane(nyquist)
    if name in SHOWN_BY:
        _steps(step, SHOWN_BY[name][0], with_loop)
    else:
        step.set_visible(False)
    handles, labels = gain.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=1, title=f"{name} loop", fontsize=7)
    return figure


def _look(k: int) -> dict[str, Any]:
    return nth(k)


def legend(c: Compared, loop: Loop) -> str:
    """An airframe's name, speed and margins of a loop, as a legend says them."""
    how = ", flown" if loop.flown else ""
    why = c.unstable.replace(f"unstable at {c.v:g} m/s: ", "unstable, ")
    return f"{c.airframe.name} at {c.v:g} m/s: {_margins(loop.margins) if loop.margins else why}{how}"


def _margins(m: Margins) -> str:
    def one(value: float, form: str, unit: str) -> str:
        return f"{value:{form}} {unit}" if math.isfinite(value) else "none"

    return (
        f"gain margin {one(m.gain_db, '.1f', 'dB')}, phase {one(m.phase_deg, '.0f', 'deg')},"
        f" disk {m.disk:.2f}, crossover {one(m.crossover, '.2g', 'rad/s')}"
    )


def _bode(gain: Axes, phase: Axes, loop: Loop, look: dict[str, Any], label: str) -> None:
    w, value = loop.transfer.frequency, loop.transfer.loop
    gain.semilogx(w, 20 * np.log10(np.maximum(np.abs(value), 1e-12)), label=label, **look)
    kept = np.abs(value) > _FADED
    angle = np.degrees(np.unwrap(np.angle(value[kept])))
    if not len(angle):
        return
    # the branch that is between -270 and 90 deg where the loop crosses unity
    middle = angle[int(np.argmin(np.abs(np.log(np.abs(value[kept])))))]
    angle -= 360.0 * round((middle + 90.0) / 360.0)
    phase.semilogx(w[kept], angle, **look)


def _nyquist(axes: Axes, loop: Loop, look: dict[str, Any]) -> None:
    value = loop.transfer.loop
    inside = np.abs(value) < 10.0  # far out a line between two samples would cross the plot
    axes.plot(np.where(inside, value.real, np.nan), np.where(inside, value.imag, np.nan), **look)


def _plane(axes: Axes) -> None:
    """The plane of L around -1: what a phase margin of 45 deg and a gain margin of 6 dB keep free."""
    circle = np.exp(1j * np.linspace(0, 2 * np.pi, 200))
    axes.plot(circle.real, circle.imag, **LIMIT)
    axes.plot([-1], [0], "+", color="black", markersize=8)
    # |1 / (1 + L) - 1/2| = 1 / disk: the circle of disk margin 0.5, which L must not enter
    level = 0.5
    ring = 1.0 / (0.5 + circle / level) - 1.0
    axes.fill(ring.real, ring.imag, color="0.35", alpha=0.12, linewidth=0)
    axes.set(
        xlim=(-3, 1.5), ylim=(-2.2, 2.2), xlabel="real", ylabel="imaginary", title="Nyquist; grey: disk 0.5"
    )
    axes.set_aspect("equal", adjustable="box")


def _steps(axes: Axes, channel: str, found: Sequence[tuple[int, Compared]]) -> None:
    from matplotlib.ticker import FuncFormatter

    last, times = 1.0, []
    for k, c in found:
        answer = c.answers[channel]
        times.append(answer.score.t63)
        share = (getattr(answer.flight, channel) - answer.before) / (answer.after - answer.before)
        axes.plot(answer.flight.t, share, **_look(k))
        moving = np.flatnonzero(np.abs(share - share[-1]) > _SWING)
        last = max(last, 1.6 * float(answer.flight.t[moving[-1]]) if len(moving) else 1.0)
    some = found[0][1].answers[channel]
    axes.axhline(1.0, **LIMIT)
    size = some.after - some.before
    shown = math.degrees(size) if channel == "omega" else size
    begin, last = 0.0, min(last, float(some.flight.t[-1]))
    if np.nanmax(times, initial=0.0) > _TIMES_APART * np.nanmin(times, initial=math.inf):
        begin = 0.05
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(FuncFormatter(lambda t, _: f"{t:g}"))
    axes.set(
        xlim=(begin, last),
        ylim=(-0.15, 1.6),
        xlabel="time [s]",
        ylabel="share of the step",
        title=f"Step in {_NAMES[channel]}, {shown:+.3g} {_UNITS[channel]}",
    )
