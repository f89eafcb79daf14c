"""Flies a campaign into its folder, from the beginning or from where it was interrupted."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from testbed.campaigns import engine, file, folder, tables
from testbed.campaigns.bases import bases, kept, read_back
from testbed.campaigns.distinct import check_distinct
from testbed.campaigns.file import SCHEMA_VERSION
from testbed.campaigns.flight import FAILED, blank, fly
from testbed.campaigns.identity import changed_airframes
from testbed.campaigns.job import Job
from testbed.campaigns.outcome import CrashError, Executor, Outcome
from testbed.campaigns.plan import Plan, Planned, expand
from testbed.campaigns.progress import Progress, progress
from testbed.campaigns.sent_parts import OwnParts, SentParts
from testbed.campaigns.summary import summary
from testbed.campaigns.view import View
from testbed.components.named_parts import NamedPart
from testbed.components.versions import versions
from testbed.errors import UserError
from testbed.records.store import write_json
from testbed.scenario import scenario


def prepare(source: str, out: Path, overwrite: bool = False, parts: Sequence[NamedPart] = ()) -> Plan:
    """The plan of a campaign by name or file, with its folder; the folder of the same campaign is kept.

    parts  of the user's own, as `named_parts.read` gives them
    Raises UserError for a malformed file, seeds that change nothing, or a folder that holds something else.
    """
    campaign, here = file.load(source)
    own = OwnParts.of(parts)
    plan = expand(campaign, bases(campaign, here), parts=own)
    check_distinct(plan)
    if (out / folder.MANIFEST).is_file():
        found = folder.manifest(out)
        if found.get("id") == plan.id and not overwrite:
            return plan
        if not overwrite:
            if found.get("name") == campaign.name and (why := own.changed(found.get("parts", {}))):
                raise UserError(f"{out} was begun {why}, or give another --out, or --overwrite")
            theirs = found.get("name")
            other = "of other content or code" if theirs == campaign.name else repr(theirs)
            raise UserError(f"{out} belongs to another campaign, {other}; give another --out, or --overwrite")
        with folder.locked(out):
            pass
    folder.create(out, _manifest(plan, out), overwrite)
    return plan


def reopen(out: Path, to_fly: bool = True, parts: Sequence[NamedPart] = ()) -> Plan:
    """The plan that a folder was made for.

    to_fly  False: nothing will be flown, so code, airframes and own parts may have changed
    parts   of the user's own: those that it was begun with, again
    Raises  UserError if something that the runs depend on has changed since, naming it
    """
    found = folder.manifest(out)
    if found.get("schema_version") != SCHEMA_VERSION:
        raise UserError(f"{out} has schema version {found.get('schema_version')}, not {SCHEMA_VERSION}")
    campaign = file.parse(found["campaign"], str(out / folder.MANIFEST))
    varied = read_back(found, out, str(out / folder.MANIFEST))
    recorded = found.get("airframes")
    home = varied[0].scenario.airframes_folder
    if to_fly and recorded is not None and (changed := changed_airframes(recorded, home)):
        raise UserError(
            f"{out} was begun with other files or gains of airframe {', '.join(changed)}; restore them, or"
            " run the campaign again into another folder; campaign status and report read it as it is"
        )
    known = found.get("parts", {})
    own = OwnParts.of(parts)
    if to_fly and (why := own.changed(known)):
        raise UserError(f"{out} was begun {why}, or run the campaign again into another folder")
    if to_fly:
        plan = expand(campaign, varied, parts=own)
    else:
        plan = expand(campaign, varied, found["code"], recorded, OwnParts(known))
    if (plan.id, plan.code) != (found["id"], found["code"]):
        raise UserError(
            f"{out} was begun by other code or packages (code {found['code']}, now {plan.code}); go on with"
            " those, or run the campaign again into another folder"
        )
    return plan


def fly_all(plan: Plan, out: Path, pool: Executor, view: View) -> Progress:
    """Fly what is missing, and write the tables once nothing is.

    Raises UserError, saying how to go on, if the disk is full or the workers fail; what is flown is kept.
    """
    with folder.locked(out):
        _sweep(out)
        journal = folder.journal(out)
        state = progress(plan, journal.entries)
        try:
            with view.showing(state, len({r.id for r in plan.runs}), pool):
                while not state.complete:
                    runs = state.missing
                    jobs, ids = _Jobs(plan, runs, out), [r.id for r in runs]
                    engine.fly(fly, jobs, ids, journal, pool, lambda _, row: view.done(row), _row)
                    state = progress(plan, journal.entries)
            _finish(state, out)
        except OSError as error:
            raise UserError(f"{out}: {error.strerror or error}; {hint(state, out)}") from None
        except (UserError, RuntimeError, MemoryError) as error:
            raise UserError(f"{error or 'out of memory'}; {hint(state, out)}") from None
    return state


def hint(state: Progress, out: Path) -> str:
    return f"{len(state.entries)} runs are kept, go on with: testbed campaign resume {out}"


def _row(outcome: Outcome) -> dict[str, Any]:
    if isinstance(outcome.error, CrashError):
        return blank(FAILED, str(outcome.error))
    if isinstance(outcome.error, UserError | OSError | MemoryError):
        raise outcome.error
    if outcome.error is not None:
        raise RuntimeError(f"a worker failed: {type(outcome.error).__name__}: {outcome.error}")
    row: dict[str, Any] = outcome.result
    return row


class _Jobs(Sequence[Job]):
    """Jobs made when they are asked for: the scenarios of a hundred thousand runs would fill the memory."""

    def __init__(self, plan: Plan, runs: list[Planned], out: Path) -> None:
        self._plan, self._runs, self._out = plan, runs, out.resolve()
        self._known: dict[tuple[Any, ...], SentParts | None] = {}

    def __len__(self) -> int:
        return len(self._runs)

    def __getitem__(self, index: Any) -> Any:
        run, campaign = self._runs[index], self._plan.campaign
        data = self._plan.data(run)
        where = None if campaign.keep == "none" else self._out / "runs" / run.id
        unless = campaign.guarantee if campaign.keep == "violations" else ""
        text, sent = json.dumps(data), self._sent(run, data)
        asked = tuple(campaign.requirements.items())
        of = campaign.measures.settings() if campaign.measures else None
        return Job(run.id, text, run.seed, unless, campaign.force, self._plan.code, where, sent, asked, of)

    def _sent(self, run: Planned, data: dict[str, Any]) -> SentParts | None:
        # Of a cell all runs have the same parts, unless a draw changes a kind.
        key = (run.cell, data["plant"], data["filter"]["kind"], data["guidance"]["kind"])
        if key not in self._known:
            s = scenario.parse(data, self._plan.campaign.name)
            self._known[key] = self._plan.sent(run, s)
        return self._known[key]


def _finish(state: Progress, out: Path) -> None:
    # Cell by cell in the tables, whatever the order of flight.
    wanted = {id(r) for r in state.wanted}
    flown = [r for r in state.plan.runs if id(r) in wanted]
    tables.write(out, state.plan, flown, state.entries)
    data = {"campaign": state.plan.campaign.name, "runs": len(flown), "cells": summary(state)}
    folder.replace(out / folder.SUMMARY, lambda partial: write_json(partial, data))


def _sweep(out: Path) -> None:
    """Remove files that an interrupted process left half-written. Call it with the lock held."""
    for partial in [*out.glob(".*.partial"), *(out / "runs").glob(".*.partial-*")]:
        shutil.rmtree(partial, ignore_errors=True) if partial.is_dir() else partial.unlink()


def _manifest(plan: Plan, out: Path) -> dict[str, Any]:
    return {
        "schema_version": SCHEMA_VERSION,
        "name": plan.campaign.name,
        "id": plan.id,
        "code": plan.code,
        "versions": versions(),
        "runs": len(plan.runs),
        "campaign": plan.campaign.model_dump(
            mode="json",
            exclude={
                name
                for name in ("requirements", "encounters", "measures")
                if not getattr(plan.campaign, name)
            },
        ),
        **kept(plan.bases, out),
        "airframes": plan.airframes,
        "parts": {label: dict(of) for label, of in plan.parts.origins.items()},
    }
