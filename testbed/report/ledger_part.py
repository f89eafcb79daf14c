"""Makes a ledger's part of a page: predicted against realised hdot of one run."""

from __future__ import annotations

from pathlib import Path

from testbed.report import settings
from testbed.report.blocks import (
    OPEN,
    Note,
    Part,
    Section,
    Table,
)
from testbed.report.folder_files import (
    Rows,
    about,
    attached,
    json_of,
    pictures,
)

CHANNELS = {
    "total": "realised minus predicted",
    "v": "speed",
    "omega": "turn rate",
    "zeta": "climb rate",
    "course": "course against heading",
    "rest": "rest",
}


def part(folder: Path, title: str) -> Part:
    """Predicted against realised hdot of a run, by channel."""
    data = json_of(folder / "ledger.json")
    quantiles: Rows = [
        {"channel": CHANNELS.get(name, name)} | {f"{100 * float(level):g} %": v for level, v in of.items()}
        for name, of in data["quantiles"].items()
    ]
    worst = [
        {"t [s]": w["t_s"], "vehicles": "-".join(map(str, w["vehicles"])), "h [m]": w["h_m"]}
        | {"in all [m/s]": w["residual_mps"]}
        | {CHANNELS[name]: w[name] for name in CHANNELS if name in w}
        for w in data["worst"]
    ]
    first = data["worst"][0]
    parts = sorted(((first[n], said) for n, said in CHANNELS.items() if n in first), key=lambda p: -abs(p[0]))
    fall = -first["residual_mps"]
    bounds = [{"setting": name, "value": value} for name, value in data["settings"].items()]
    sheets = {name: attached(folder / f"{name}.csv") for name in ("quantiles", "worst")}
    near = f"pairs with h below {data['near_h_m']:g} m"
    return Part(
        title=title,
        what=about(
            data.get("run", {}), "the ledger: hdot as the unicycle model predicts it, and as realised"
        ),
        status=OPEN,
        headline=f"At worst h falls {fall:.2f} m/s faster than promised"
        if fall > 0
        else "h never falls faster than promised",
        details=[
            f"At {first['t_s']:.3f} s, vehicles {' and '.join(map(str, first['vehicles']))}, h ="
            f" {first['h_m']:.2f} m; by channel: "
            + ", ".join(f"{said} {value:+.2f}" for value, said in parts)
            + " m/s.",
            f"{data['rows']} recorded rows of {near}. A ledger is no verdict.",
        ],
        sections=[
            Section(
                "Ledger",
                [
                    *pictures(
                        folder,
                        ("ledger",),
                        "Realised minus predicted hdot by channel, over time and in quantiles",
                        folder / "quantiles.csv",
                        quantiles,
                    ),
                    Table(
                        quantiles, f"Quantiles [m/s], {near}", downloads=attached(folder / "quantiles.csv")
                    ),
                    Table(worst, "The worst moments [m/s]", downloads=sheets["worst"]),
                ],
            ),
            Section(
                "As robust rows",
                [
                    Note(
                        f"|achieved - commanded| at quantile {data['quantile']:g} of the same rows, as the"
                        " fields of a scenario that raise the filter's rows by it (m/s, deg/s, m/s)."
                    ),
                    Table(bounds),
                ],
            ),
            Section("Settings and provenance", settings.of_study(data.get("run", {}))),
        ],
    )
