"""Makes the part of a page about one run, or one scenario on several plants."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from testbed.claims.nearest import nearest_approach
from testbed.measures import hdot_ledger
from testbed.records.run import Run
from testbed.records.store import load
from testbed.report import embed, fences, figures, ledger_figures, playback, run_tables, scorecard, settings
from testbed.report.blocks import Block, Note, Part, Picture, Playback, Scorecard, Section, Table, download
from testbed.report.own_parts import named, sentence
from testbed.report.style import drawing, styles

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Runs = Mapping[str, Run]


def part(runs: Runs, folder: Path | None, title: str) -> Part:
    """The account of `runs`, one scenario on several plants.

    folder  where figures drawn of them may lie already, as figures/NAME.svg
    """
    looks = styles(runs)
    facts = [scorecard.fact(label, run, looks[label]["color"]) for label, run in runs.items()]
    left = [label for label, run in runs.items() if scorecard.left_safe_set(run)]
    status, headline = scorecard.fenced(runs, *scorecard.headline(facts, left))
    first = next(iter(runs.values()))
    scenario = first.manifest["scenario"]
    what = f"{scenario['vehicles']} vehicles, Ds {scenario['d_safe_m']:g} m, {scenario['duration_s']:g} s"
    filters = dict.fromkeys(named(run, "filter", scenario["filter"]["kind"]) for run in runs.values())
    what += f", filter {' and '.join(filters)}, barrier {scenario['barrier']['kind']}"
    claims = pd.DataFrame(scorecard.csv_rows(runs))
    sections = [
        Section(
            "Scorecard",
            [
                Scorecard(
                    scorecard.rows(runs), downloads=download("scorecard (CSV)", "scorecard.csv", claims)
                ),
            ],
        ),
        Section("Fences", _fences({label: run for label, run in runs.items() if len(run.fences)}, folder)),
        *_motion({label: run for label, run in runs.items() if len(run.vehicles)}, folder),
        Section("Settings and provenance", settings.of_runs(runs)),
    ]
    return Part(
        title=f"{scenario['name']} on {', '.join(runs)}",
        what=f"{what}. {scenario['description']}".strip().rstrip(".") + f". Folder: {title}",
        status=status,
        headline=headline,
        details=[line for label, run in runs.items() for line in _details(label, run)],
        facts=facts,
        sections=[s for s in sections if s.blocks],
    )


def _motion(runs: Runs, folder: Path | None) -> list[Section]:
    """The sections that show the motion of `runs`; none where every run ended before its first row."""
    if not runs:
        return []
    return [
        Section("Playback", [Playback(playback.data(runs))]),
        Section("Ledger: predicted against realised hdot", _ledger(runs, folder)),
        Section("The paper's panels", [_panels(runs, folder)]),
        Section("Tracking: commanded against achieved", _tracking(runs, folder)),
    ]


def _fences(runs: Runs, folder: Path | None) -> list[Block]:
    """How near vehicles came to their fences; nothing of runs without fences."""
    if not runs:
        return []
    rows = [row for label, run in runs.items() for row in fences.table(label, run)]
    bands = fences.bands(next(iter(runs.values())).manifest["scenario"])
    nearest = min(rows, key=lambda row: row["least clearance [m]"])
    return [
        Table(
            rows,
            "Clearance at recorded times: the signed distance less the margin; the scorecard has every step",
            downloads=download("CSV", "fences.csv", pd.DataFrame(rows)),
        ),
        *([Note(f"Not on the map: {'; '.join(bands)}.")] if bands else []),
        Picture(
            name="fences",
            caption="The least clearance of any vehicle from any of its fences, and the least h: the least"
            " clearance along the evading manoeuvre from there.",
            alt=f"Two series over time. Nearest: {nearest['least clearance [m]']:.2f} m from"
            f" {nearest['fence']} on {nearest['plant']}.",
            svg=_svg(folder, "fences", lambda: fences.over_time(runs)),
            downloads=download(
                "series (CSV)",
                "fence-series.csv",
                pd.concat(run.fences.assign(plant=label) for label, run in runs.items()),
            ),
        ),
    ]


def _details(label: str, run: Run) -> list[str]:
    own = sentence(run.manifest)
    return [scorecard.other_claims(label, run), *([f"{label}: {own}."] if own else [])]


def of_folder(folder: Path, title: str) -> Part:
    """The account of a run folder."""
    run = load(folder)
    return part({named(run, "plant", run.manifest["scenario"]["plant"]): run}, folder, title)


def _svg(folder: Path | None, name: str, draw: Callable[[], Figure | None]) -> str:
    """The figure's markup, from the folder if it was drawn there."""
    file = folder / "figures" / f"{name}.svg" if folder is not None else None
    if file is not None and file.is_file():
        return embed.inline(file.read_text(encoding="utf-8"))
    with drawing():
        figure = draw()
        assert figure is not None, f"nothing to draw for {name}"
        return embed.markup(figure)


def _panels(runs: Runs, folder: Path | None) -> Picture:
    least = "; ".join(f"{label}: {_least(run)}" for label, run in runs.items())
    ended = "; ".join(
        f"{label} {run.manifest['ended_early']}" for label, run in runs.items() if run.manifest["ended_early"]
    )
    return Picture(
        name="panels",
        caption="As in the paper: speed and turn rate of vehicle 1, the smallest distance of any pair,"
        " all paths. Limits and Ds are dotted.",
        alt=f"Four panels over time. Smallest distance of any pair: {least}."
        + (f" Ended early: {ended}." if ended else ""),
        svg=_svg(folder, "panels", lambda: figures.panels(runs)),
        downloads=(
            *download("series (CSV)", "panels.csv", run_tables.series(runs)),
            *download("paths (CSV)", "paths.csv", run_tables.paths(runs)),
        ),
    )


def _least(run: Run) -> str:
    e = nearest_approach(run)
    return f"{e['value']:.2f} m at {e['t_s']:.2f} s" if e["value"] is not None else "none, there is no pair"


def _ledger(runs: Runs, folder: Path | None) -> list[Block]:
    """Quantiles of the residual by channel, and the worst moments, of each run that has pairs near."""
    found = {label: hdot_ledger.summary(run) for label, run in runs.items() if len(run.pairs)}
    rows = [
        {"plant": label, "channel": channel}
        | {_level(q): x for q, x in of.items() if q in ("0", "0.05", "0.5", "0.95", "1")}
        for label, s in found.items()
        for channel, of in s["quantiles"].items()
    ]
    if not rows:
        return []
    worst = [
        {
            "plant": label,
            "t [s]": w["t_s"],
            "vehicles": " and ".join(map(str, w["vehicles"])),
            "h [m]": w["h_m"],
        }
        | {"residual [m/s]": w["residual_mps"]}
        | {f"{c} [m/s]": w[c] for c in hdot_ledger.CHANNELS}
        for label, s in found.items()
        for w in s["worst"]
    ]
    near = next(iter(found.values()))["near_h_m"]
    picture = _ledger_picture({label: runs[label] for label in found}, folder)
    return [
        Note(
            "Realised minus predicted hdot of recorded pairs with h below"
            f" {near:g} m: negative is clearance lost against what the unicycle model promised."
            " Each channel's part is what its tracking error took."
        ),
        *([picture] if picture else []),
        Table(
            rows,
            "Residual by channel [m/s], quantiles",
            downloads=download("CSV", "ledger.csv", pd.DataFrame(rows)),
        ),
        Table(
            worst,
            "The five worst moments of each run",
            downloads=download("CSV", "ledger-worst.csv", pd.DataFrame(worst)),
        ),
    ]


def _ledger_picture(runs: Runs, folder: Path | None) -> Picture | None:
    worst = {label: hdot_ledger.summary(run, worst_moments=1)["worst"] for label, run in runs.items()}
    rows = pd.concat(
        hdot_ledger.near(run)[
            lambda d, w=w: (d.i == w[0]["vehicles"][0]) & (d.j == w[0]["vehicles"][1])
        ].assign(plant=label)
        for (label, run), w in zip(runs.items(), worst.values(), strict=True)
        if w
    )
    return Picture(
        name="ledger",
        caption="What each channel took from hdot: over time for the pair of least residual, and in quantiles"
        " over all pairs near.",
        alt="Residuals by channel. "
        + " ".join(
            f"{label}: at worst {w[0]['residual_mps']:.3g} m/s at {w[0]['t_s']:.2f} s."
            for label, w in worst.items()
            if w
        ),
        svg=_svg(folder, "ledger", lambda: ledger_figures.ledger(runs)),
        downloads=download("series (CSV)", "ledger-series.csv", rows),
    )


def _level(q: str) -> str:
    return {"0": "least", "0.5": "median", "1": "most"}.get(q, f"{100 * float(q):g} %")


def _exact(run: Run) -> bool:
    """Whether the plant flies its commands exactly: the unicycle of the scenario does."""
    return run.part("plant") is None and run.manifest["scenario"]["plant"] == "unicycle"


def _tracking(runs: Runs, folder: Path | None) -> list[Block]:
    flown = {label: run for label, run in runs.items() if not _exact(run)}
    if not flown:
        return []
    rows = [row for label, run in flown.items() for row in run_tables.tracking(label, run)]
    blocks: list[Block] = [
        Table(
            rows,
            "Achieved minus commanded, all vehicles, at recorded times",
            downloads=download("CSV", "tracking.csv", pd.DataFrame(rows)),
        )
    ]
    aircraft = {label: run for label, run in flown.items() if {"roll_rad", "beta_rad"} & set(run.vehicles)}
    errors = [f"{r['plant']}: {r['channel']} error at most {r['largest']:.3g}." for r in rows]
    if aircraft:
        blocks.append(
            Picture(
                name="aircraft",
                caption="A vehicle of the closest pair: bank, sideslip, and tracking errors by channel."
                " Dotted: the moment of least distance.",
                alt="Five series over time. " + " ".join(errors),
                svg=_svg(folder, "aircraft", lambda: figures.aircraft(aircraft, styles(runs))),
                downloads=download(
                    "series (CSV)",
                    "aircraft.csv",
                    pd.concat(
                        run_tables.one_vehicle(label, run, figures.lead(run))
                        for label, run in aircraft.items()
                    ),
                ),
            )
        )
    return blocks
