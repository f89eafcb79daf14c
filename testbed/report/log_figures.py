"""Draws a flight log: commands, the flight, the simulated aircraft's, and the identified lags."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aircraft.logs.events import Event
from aircraft.logs.record import CHANNELS, FlightLog
from aircraft.logs.reflight import Reflight
from testbed.report.style import BLACK, BLUE, PAGE, VERMILION, drawing, save

_LABELS = {
    "v": "ground speed [m/s]",
    "omega": "course rate [deg/s]",
    "zeta": "climb rate [m/s]",
}
NAME = "log"


def draw(
    log: FlightLog, found: list[Event], flown: Reflight | None, simulated: str, folder: Path
) -> list[Path]:
    """Write log.png, .pdf and .svg into `folder`: one panel a channel.

    flown      the same commands flown by `simulated`; None leaves it out
    """
    with drawing() as plt:
        figure, axes = plt.subplots(3, 1, figsize=(PAGE, 6.0), sharex=True, layout="constrained")
        for k, (name, ax) in enumerate(zip(CHANNELS, axes, strict=True)):
            scale = 180 / np.pi if name == "omega" else 1.0
            ax.plot(log.t, scale * log.command[:, k], color=BLACK, lw=0.8, label="commanded")
            ax.plot(log.t, scale * log.response[:, k], color=BLUE, label=f"flown ({log.source})")
            if flown is not None:
                ax.plot(
                    flown.t,
                    scale * flown.rates[:, k],
                    color=VERMILION,
                    ls="--",
                    label=f"simulated {simulated}",
                )
            for event in found:
                if event.channel == k:
                    ax.axvspan(log.t[event.begin], log.t[event.end - 1], color="0.92", zorder=0, lw=0)
            ax.set_ylabel(_LABELS[name])
        axes[0].legend(loc="best")
        axes[0].set_title("Commands of the log, flown and simulated; grey: steps that lags are identified on")
        axes[-1].set_xlabel("time in the log [s]")
        return save(figure, folder, NAME)
