"""Defines the style of every figure: colours, dashes, limit lines, and how figures are saved.

Colours are Okabe and Ito's, safe for the colour-blind; dashes tell lines apart in grey. PNG is for screens,
PDF for papers, SVG for the report page; equal data give equal files.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BLUE, VERMILION, GREEN, PURPLE = "#0072B2", "#D55E00", "#009E73", "#CC79A7"
ORANGE, SKY, BLACK = "#E69F00", "#56B4E9", "#000000"
STYLES: dict[str, dict[str, Any]] = {
    "unicycle": {"color": BLUE, "linestyle": "-"},
    "lagged": {"color": GREEN, "linestyle": "-."},
    "jsbsim": {"color": VERMILION, "linestyle": "--"},
    # The aircraft that jsbsim flies, where several are compared.
    "x8": {"color": VERMILION, "linestyle": "--"},
    "rascal": {"color": PURPLE, "linestyle": (0, (3, 1, 1, 1))},
    "turn": {"color": BLUE, "linestyle": "-"},
    "straight": {"color": VERMILION, "linestyle": "--"},
    "navigation": {"color": GREEN, "linestyle": "-."},
    "paper": {"color": VERMILION, "linestyle": "-"},
    "smoothed": {"color": BLUE, "linestyle": "--"},
    "cubic 0.1": {"color": BLUE, "linestyle": "-"},
    "linear 1": {"color": SKY, "linestyle": (0, (5, 1))},
    "linear 0.3": {"color": ORANGE, "linestyle": "--"},
    "linear 0.1": {"color": VERMILION, "linestyle": ":"},
}
LIMIT: dict[str, Any] = {"color": "0.35", "linestyle": ":", "linewidth": 1.0}
RC: dict[Any, Any] = {
    "font.size": 8,
    "axes.grid": True,
    "grid.alpha": 0.25,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.3,
    "axes.prop_cycle": f"cycler('color', {[BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK]})",
    "legend.framealpha": 0.8,
    "legend.edgecolor": "none",
    "legend.fontsize": 7,
    "axes.titlesize": 8,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "svg.hashsalt": "cbf-jsbsim-testbed",
    # Text stays text: small files, found by search, read aloud. Editable in PDF too.
    "svg.fonttype": "none",
    "pdf.fonttype": 42,
}
# Inches: one column of a two-column page, and the whole page.
COLUMN, PAGE = 3.4, 7.2


@contextmanager
def drawing() -> Iterator[Any]:
    """pyplot in this style, needing no screen."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    with pyplot.rc_context(RC):
        yield pyplot


COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK)
DASHES: tuple[Any, ...] = ("-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1)), (0, (1, 1)))


def nth(k: int) -> dict[str, Any]:
    """Colour and dash of the k-th of a series (from 0): all differ, however many there are."""
    n = len(COLOURS)
    if k < n * n:
        # Both change at every step; the second round of colours has every dash shifted by one.
        return {"color": COLOURS[k % n], "linestyle": DASHES[(k + k // n) % n]}
    import colorsys

    k -= n * n
    # Hues in golden-ratio steps never repeat.
    red, green, blue = colorsys.hsv_to_rgb((k * 0.618033988749895) % 1.0, 0.9, 0.7)
    colour = "#" + "".join(f"{round(255 * c):02x}" for c in (red, green, blue))
    return {"color": colour, "linestyle": (0, (1 + k // 1000, 2, 4, 2))}


def styles(names: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Colour and dash of each plant, barrier or law of one figure or page; all differ.

    A name of `STYLES` has its own look unless another name of the figure has it already; the others take the
    next free looks in order.
    """
    found: dict[str, dict[str, Any]] = {}
    wanted = list(dict.fromkeys(names))
    for name in wanted:
        if name in STYLES and STYLES[name] not in found.values():
            found[name] = STYLES[name]
    k = 0
    for name in wanted:
        while name not in found:
            look, k = nth(k), k + 1
            # A page shows colours without dashes: while there are free ones, colours do not repeat.
            used = {of["color"] for of in found.values()}
            free = len(used) < len(COLOURS)
            if look not in found.values() and not (free and look["color"] in used):
                found[name] = look
    return {name: found[name] for name in wanted}


def limits(axes: Axes, *values: float) -> None:
    """Horizontal limit lines."""
    for value in values:
        axes.axhline(value, **LIMIT)


def log_distance(axes: Axes) -> None:
    """A logarithmic ordinate with plain numbers: 5 and 60, not powers of ten."""
    from matplotlib.ticker import LogFormatter

    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(LogFormatter())
    axes.yaxis.set_minor_formatter(LogFormatter(minor_thresholds=(1.5, 0.5)))


def separation(axes: Axes, d_safe: float) -> None:
    """The line of Ds, named."""
    limits(axes, d_safe)
    axes.text(0.01, d_safe, " Ds", va="bottom", fontsize=7, transform=axes.get_yaxis_transform())


def save(figure: Figure, folder: Path, name: str, dpi: int = 160) -> list[Path]:
    """Write NAME.png, NAME.pdf and NAME.svg, and close the figure."""
    from matplotlib import pyplot as plt

    files = [folder / f"{name}.{kind}" for kind in ("png", "pdf", "svg")]
    figure.savefig(files[0], dpi=dpi)
    # Laid out once; and no dates: equal data give equal files.
    figure.set_layout_engine("none")
    figure.savefig(files[1], metadata={"CreationDate": None})
    figure.savefig(files[2], metadata={"Date": None})
    plt.close(figure)
    return files
