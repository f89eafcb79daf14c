"""`testbed ledger`: compares predicted and realised hdot of one run, by channel."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from testbed.cli.common import JsonOption, OverwriteOption, show
from testbed.errors import UserError

if TYPE_CHECKING:
    from testbed.records.run import Run

EXAMPLE = (
    "Examples: testbed ledger runs/head-on/jsbsim;"
    " testbed run paper-2-turn $(testbed ledger runs/head-on/jsbsim --settings --quantile 0.5)"
)


def ledger(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="a run folder")],
    near: Annotated[float, typer.Option("--near", help="only pairs with h below this [m]")] = 10.0,
    quantile: Annotated[
        float, typer.Option("--quantile", help="quantile of |achieved - commanded| that bounds each channel")
    ] = 1.0,
    settings: Annotated[
        bool, typer.Option("--settings", help="print only --set options: robust rows with those bounds")
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", help="folder to write; default RUN-ledger, beside the run")
    ] = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Compare the hdot that the unicycle model predicts with the realised one, by channel."""
    from testbed.measures.hdot_ledger import channel_bounds, robust_settings, summary

    flown = _run(run)
    if not 0.0 <= quantile <= 1.0:
        raise UserError(f"--quantile {quantile:g}: give a share between 0 and 1, such as 0.95")
    found = summary(flown, near)
    if not found["rows"]:
        raise UserError(f"{run}: no pair was recorded with h below {near:g} m; raise --near")
    bounds = channel_bounds(flown, quantile, near)
    fields = {name: float(f"{value:.4g}") for name, value in robust_settings(bounds).items()}
    if settings:
        print(" ".join(f"--set {name}={value:g}" for name, value in fields.items()))
        return
    data = found | {"quantile": quantile, "bounds": bounds, "settings": fields}
    where = out or run.resolve().parent / f"{run.resolve().name}-ledger"
    _write(flown, data, where, overwrite)
    if as_json:
        print(json.dumps({"folder": str(where)} | data, indent=2))
        return
    _print(run, data)
    print(f"tables and figure: {where}")


def _run(path: Path) -> Run:
    from testbed.records.store import load

    if (path / "comparison.json").is_file():
        names = ", ".join(sorted(p.parent.name for p in path.glob("*/manifest.json")))
        raise UserError(f"{path} holds several runs; name one of them: {names}")
    return load(path)


def _write(flown: Run, data: dict, where: Path, overwrite: bool) -> None:  # type: ignore[type-arg]
    import pandas as pd

    from testbed.records.store import staged, write_json
    from testbed.report.ledger_figures import ledger as draw
    from testbed.report.style import drawing, save

    with staged(where, overwrite) as folder:
        pd.DataFrame(data["quantiles"]).T.rename_axis("channel").to_csv(folder / "quantiles.csv")
        worst = [w | {"vehicles": "-".join(map(str, w["vehicles"]))} for w in data["worst"]]
        pd.DataFrame(worst).to_csv(folder / "worst.csv", index=False)
        with drawing():
            plant = flown.part("plant") or flown.manifest["scenario"]["plant"]
            figure = draw({plant: flown}, data["near_h_m"])
            assert figure is not None
            save(figure, folder, "ledger")
        write_json(folder / "ledger.json", data | {"run": flown.manifest})


def _print(run: Path, data: dict) -> None:  # type: ignore[type-arg]
    from testbed.report.tables import plain_table

    levels = ("0", "0.05", "0.5", "0.95", "1")
    rows = [
        {"channel": channel} | {f"{100 * float(level):g} %": of[level] for level in levels}
        for channel, of in data["quantiles"].items()
    ]
    title = f"{run}: realised minus predicted hdot [m/s], {data['rows']} rows with h < {data['near_h_m']:g} m"
    show(plain_table(title, rows))
    worst = [
        {"t [s]": f"{w['t_s']:.3f}", "pair": "-".join(map(str, w["vehicles"])), "h [m]": w["h_m"]}
        | {"residual": w["residual_mps"]}
        | {name: w[name] for name in ("v", "omega", "zeta", "course", "rest")}
        for w in data["worst"]
    ]
    show(plain_table("worst moments [m/s]", worst))
    print(f"|achieved - commanded| at quantile {data['quantile']:g}, as robust rows take it:")
    for name, value in data["settings"].items():
        print(f"  {name} = {value:g}")
