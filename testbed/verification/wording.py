"""Compares the words of claims and manifest with those that are prescribed, and names what is unknown."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from testbed.claims import registry
from testbed.claims.monitored import RECORDED
from testbed.claims.registry import Claim
from testbed.errors import UserError
from testbed.scenario.installed import PLANTS
from testbed.scenario.scenario import parse
from testbed.verification import coverage, fleet
from testbed.verification.air import blows
from testbed.verification.coverage_table import AIRCRAFT, DECLARED, WIND
from testbed.verification.filter_view import AIRFRAMES, USUAL
from testbed.verification.finding import Finding
from testbed.verification.recorded import Recorded

RUN_SCHEMA = 1
STREAMS = ["start", "plant", "gust", "noise", "network", "other"]
WORDS = ("number", "claim", "source", "quantity", "unit")


def wording(run: Recorded) -> Iterator[Finding]:
    yield _texts(run)
    yield _unknown(run)
    yield _columns(run)
    yield _manifest(run)
    yield _scenario(run)


def _texts(run: Recorded) -> Finding:
    """Number, claim, source, quantity and unit of every entry are the registry's."""
    known = registry.CLAIMS | RECORDED
    wrong = []
    for e in run.entries:
        claim = known.get(e["id"])
        if claim is not None:
            due = _words(claim, run.scenario)
            wrong += [f"{name} of {e['id']} is {e[name]!r}" for name in WORDS if e[name] != due[name]]
    return _listed("texts", f"{len(run.entries)} claims", "as registered", wrong)


def _words(claim: Claim, s: dict[str, Any]) -> dict[str, str]:
    return {
        "number": claim.number,
        "claim": claim.words(s["goal_radius_m"], fleet.strangers(s)),
        "source": claim.source,
        "quantity": claim.quantity,
        "unit": claim.unit_of(s["barrier"]["form"]),
    }


def _unknown(run: Recorded) -> Finding:
    """Every recorded item is in the table of coverage, and no item that every run has is missing."""
    have = coverage.items(run)
    odd = [f"{name} is unknown" for name in have if coverage.entry(name, run) is None]
    odd += [f"{name} is missing" for name in coverage.required(run) if name not in have]
    return _listed("fields", f"{len(have)} fields", "known", odd)


def _columns(run: Recorded) -> Finding:
    """An aircraft has its telemetry, a run with wind its wind columns, and no other run has either."""
    s, wrong = run.scenario, []
    if not len(run.t):  # columns beside those of every run come with the first row
        return _listed("columns", f"{len(run.vehicles) + len(run.pairs)} columns", "as due", [])
    if "plant" not in run.parts:
        for name in AIRCRAFT:
            if (name in run.vehicles) != (s["plant"] == "jsbsim"):
                wrong.append(f"{name} is {'recorded' if name in run.vehicles else 'missing'}")
    if "disturbance" not in run.parts:
        for name in WIND:
            if (name in run.vehicles) != blows(s):
                wrong.append(f"{name} is {'recorded' if name in run.vehicles else 'missing'}")
    due = bool(run.declared) and bool(run.i.size)
    for name in DECLARED:
        if (name in run.pairs) != due:
            wrong.append(f"{name} is {'missing' if due else 'recorded'}")
    if run.declared and "filter" not in run.parts:
        wrong.append("a barrier is declared without a filter of the user's own")
    return _listed("columns", f"{len(run.vehicles) + len(run.pairs)} columns", "as due", wrong)


def _manifest(run: Recorded) -> Finding:
    """Airframes are those of the scenario, schema and random streams the known ones."""
    s, m, wrong = run.scenario, run.manifest, []
    if s["plant"] == "jsbsim" and "plant" not in run.parts:
        sensed = f"@{s['sensors']}" if s.get("sensors") else ""
        due = {name + sensed for name in fleet.airframes(s)}
        if not _called(due, set(m["airframes"])):
            wrong.append(f"airframes are {', '.join(sorted(m['airframes'])) or 'none'}")
    if m["schema_version"] != RUN_SCHEMA:
        wrong.append(f"schema_version is {m['schema_version']}")
    if m["seed_streams"] != STREAMS:
        wrong.append(f"seed_streams are {m['seed_streams']}")
    return _listed("manifest", "as written", "as due", wrong)


def _scenario(run: Recorded) -> Finding:
    """The scenario is one that can be flown: its fields fit each other, and its schema is a known one."""
    try:
        parse(run.manifest["scenario"], keep_idle=True)
    except UserError as error:
        if run.scenario["plant"] not in PLANTS:  # of an installed package: not everybody has it
            return Finding("scenario", "as written", "unknown", None, None, "its plant is not installed here")
        return _listed("scenario", "as written", "can be flown", [str(error).removeprefix("scenario: ")])
    return _listed("scenario", "as written", "can be flown", [])


def _called(due: set[str], named: set[str]) -> bool:
    """Whether airframes have these names: a folder's last part, or one that ends with the gains' file.

    An @ is followed by autopilot and sensors: those asked for, or those of a folder of the user's own.
    """

    def same(given: str, name: str) -> bool:
        (folder, *asked), (plain, *flown) = Path(given).name.split("@"), name.split("@")
        wanted = {a.removesuffix(".eq") for a in asked if a not in USUAL}
        if wanted - set(flown) or (set(flown) - wanted and (AIRFRAMES / folder).is_dir()):
            return False
        path = Path(folder)
        return folder == plain or (path.suffix == ".toml" and plain.endswith(f"+{path.stem}"))

    every = all(any(same(given, name) for name in named) for given in due)
    return every and all(any(same(given, name) for given in due) for name in named)


def _listed(what: str, said: str, own: str, wrong: list[str]) -> Finding:
    found = f"{len(wrong)} differ" if wrong else own
    return Finding(what, said, found, not wrong, None, "; ".join(wrong))
