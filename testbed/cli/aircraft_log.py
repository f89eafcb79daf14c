"""`testbed aircraft log`: identifies lags on a flight log and compares it with the simulated aircraft."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from testbed.cli.aircraft import JsonOption, OutOption, OverwriteOption, airframe_of, show_table
from testbed.errors import UserError

if TYPE_CHECKING:
    from aircraft.airframes.schema import Airframe
    from aircraft.logs.fitting import Fit


EXAMPLES = (
    "Examples: testbed aircraft log flight.bin --airframe x8 --out log;"
    " testbed aircraft log flight.ulg --airframe my-wing --write"
)


def log(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="ArduPilot's .bin, PX4's .ulg, or .csv (see the guide)")
    ],
    airframe: Annotated[
        str | None,
        typer.Option("--airframe", metavar="NAME", help="fly its commands again with this airframe"),
    ] = None,
    vehicle: Annotated[
        int | None, typer.Option("--vehicle", help="which vehicle of a CSV table, counted from 1")
    ] = None,
    write: Annotated[
        bool, typer.Option("--write", help="write the lags into the airframe's file as [identified]")
    ] = False,
    out: OutOption = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Find the steps in a flight log, identify delay, lag and rate limits, and compare with the simulation.

    Commands and responses become (v, omega, zeta): ground speed, course rate, climb rate. With --airframe the
    simulated aircraft flies the same commands in the same wind, and --out gets a figure of both.
    """
    from aircraft.logs import events, fitting, reading, reflight, writing
    from aircraft.logs.record import LogError
    from testbed.records.store import check_free, staged, write_json

    if write and airframe is None:
        raise UserError("--write: say whose lags they are: --airframe NAME")
    if out is not None:
        check_free(out, overwrite)
    model = None if airframe is None else airframe_of(airframe)
    try:
        flight = reading.read(file, vehicle)
        found = events.events(flight)
        fits = [f for k in range(3) if (f := fitting.fit(flight, found, k)) is not None]
        flown = None if model is None else reflight.refly(flight, model)
        remade = writing.remade(model, flight, file, fits) if write and model is not None else None
    except (LogError, FileNotFoundError) as error:
        raise UserError(str(error)) from None
    errors = [] if flown is None else reflight.errors(flight, flown)
    result: dict[str, Any] = {
        "log": flight.source,
        "sha256": flight.sha256,
        "from_s": float(flight.t[0]),
        "to_s": float(flight.t[-1]),
        "notes": list(flight.notes),
        "lags": [asdict(f) for f in fits],
        "airframe": None if model is None else model.name,
        "simulated_minus_flown": errors,
        "simulation_ended": None if flown is None else flown.fault or None,
    }
    if out is not None:
        from testbed.report.log_figures import draw

        with staged(out, overwrite) as folder:
            draw(flight, found, flown, "" if model is None else model.name, folder)
            write_json(folder / "log.json", result)
    if remade is not None:
        try:
            remade.write()
        except OSError as error:
            raise UserError(f"cannot write {remade.path}: {error.strerror}") from None
    if as_json:
        print(json.dumps(result, indent=2))
        return
    print(f"{flight.source}: {flight.t[-1] - flight.t[0]:.0f} s, {len(found)} steps")
    for note in flight.notes:
        print(f"note: {note}")
    show_table("lags identified", [_row(f, model) for f in fits]) if fits else print(
        "no steps found: a step holds for 1.5 s while nothing else is commanded"
    )
    if errors:
        show_table(f"simulated {model.name if model else ''} minus flown", errors)
    if flown is not None and flown.fault:
        print(f"the simulated aircraft ended early at {flown.t[-1]:.1f} s: {flown.fault}")
    if remade is not None:
        print(f"{remade.path}: written", file=sys.stderr)
    if out is not None:
        print(f"figure: {out / 'log.png'}")


def _row(fit: Fit, model: Airframe | None) -> dict[str, Any]:
    """A fit as a row of the table, beside what the airframe's file says."""
    row = {
        "channel": fit.channel,
        "steps": fit.steps,
        "lag_s": round(fit.time_constant_s, 3),
        "delay_s": round(fit.delay_s, 3),
        "rate_min": round(fit.rate_min, 3) if fit.reached[0] else "not reached",
        "rate_max": round(fit.rate_max, 3) if fit.reached[1] else "not reached",
        "misfit": f"{100 * fit.misfit:.1f} %",
        "held_out": "" if fit.held_out is None else f"{100 * fit.held_out:.1f} %",
    }
    if model is not None and model.identified is not None:
        known = getattr(model.identified, fit.channel)
        row[f"{model.name}: lag, delay"] = f"{known.time_constant_s:g}, {known.delay_s:g}"
    return row
