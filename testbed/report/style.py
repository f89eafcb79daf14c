"""The one style of every figure: SI labels, limits drawn, one colour and dash per thing compared.

Colours are Okabe & Ito's, safe for the colour-blind; the dash tells them apart in grey. PNG for screens, PDF
for papers, SVG for the report page, each the same bytes for the same data.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zlib import crc32

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


# For names not known here, such as a plant of one's own: always the same look for the same name.
OTHERS = ((PURPLE, (0, (3, 1, 1, 1))), (ORANGE, (0, (5, 1))), (SKY, ":"), (BLACK, (0, (1, 1))))


def style(name: str) -> dict[str, Any]:
    """Colour and dash of a plant, barrier or law."""
    color, dash = OTHERS[crc32(name.encode()) % len(OTHERS)]
    return STYLES.get(name, {"color": color, "linestyle": dash})


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
