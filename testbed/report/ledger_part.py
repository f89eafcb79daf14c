"""What is made of one run, its ledger and its exported tables, as parts of a report."""

from __future__ import annotations

from pathlib import Path

from testbed.records.verdict import Status
from testbed.report import settings
from testbed.report.blocks import KEPT, LOST, OPEN, Block, Note, Part, Section, Table, read_csv
from testbed.report.folder_files import Rows, about, attached, json_of, pictures, text_of

CHANNELS = {
    "total": "realised minus predicted",
    "v": "speed",
    "omega": "turn rate",
    "zeta": "climb rate",
    "course": "course against heading",
    "rest": "rest",
}
# Rows of a long table on the page; its file has them all.
SHOWN_ROWS = 5


def ledger(folder: Path, title: str) -> Part:
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
            data.get("run", {}), "the ledger, what the unicycle promised of h and the motion made of it"
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


def export(folder: Path, title: str) -> Part:
    """A run's tables as CSV: what happened, what the columns mean, and the beginning of each table."""
    data = json_of(folder / "export.json")
    events = read_csv(text_of(folder / "events.csv"))
    columns = read_csv(text_of(folder / "columns.csv"))
    guarantee = next(g for g in data["guarantees"] if g["id"] == "separation")
    said = guarantee["verdict"] + (f", {guarantee['value']:.3f} m" if guarantee["value"] is not None else "")
    return Part(
        title=title,
        what=about(data["run"], "a run's tables as CSV"),
        status={Status.HOLDS: KEPT, Status.VIOLATED: LOST}.get(guarantee["verdict"], OPEN),
        headline=f"Separation: {said}",
        details=[f"{len(events)} events; testbed report RUN has the scorecard and the playback."],
        sections=[
            Section("Events", [Table(events, downloads=attached(folder / "events.csv")) if events else NONE]),
            Section("Tables", [_beginning(folder, name) for name in ("vehicles", "pairs")]),
            Section("Columns", [Table(columns, downloads=attached(folder / "columns.csv"))]),
            Section("Settings and provenance", settings.of_study(data["run"])),
        ],
    )


NONE = Note("Nothing happened that would be an event.")


def _beginning(folder: Path, name: str) -> Block:
    """The first rows of a table of the folder, and how many there are."""
    path = folder / f"{name}.csv"
    text = text_of(path)
    count = max(0, text.count("\n") - 1)
    rows = read_csv("".join(text.splitlines(keepends=True)[: SHOWN_ROWS + 1]))
    shown = f", the first {SHOWN_ROWS} of {count} rows" if count > SHOWN_ROWS else ""
    files = attached(path)
    return Table(
        rows, path.name + shown + ("" if files else "; too long to travel in this page"), downloads=files
    )
