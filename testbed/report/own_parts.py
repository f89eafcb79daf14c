"""Names the parts of a run that are the user's own, with their file and checksum."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from testbed.components.border.making import WORDS
from testbed.records.run import Run, called

# Hexadecimal digits of a checksum that are shown.
DIGITS = 12


def named(run: Run, part: str, scenarios: str) -> str:
    """Name of the user's own `part` (plant, filter, nominal, disturbance), or else `scenarios`."""
    return run.part(part) or scenarios


def origins(manifest: Mapping[str, Any]) -> dict[str, str]:
    """Role -> name, file and checksum, for the parts of a run's manifest that are the user's own."""
    return {WORDS.get(part, part): _said(origin) for part, origin in manifest.get("parts", {}).items()}


def of_campaign(manifest: Mapping[str, Any]) -> list[str]:
    """A sentence for each part of the user's own that a campaign's cells name."""
    return [
        f"Part of the user's own: {of['role']} {_said(of['origin'])}."
        for of in (manifest.get("parts") or {}).values()
    ]


def sentence(manifest: Mapping[str, Any]) -> str:
    """All of them in one sentence; "" if the run flew the scenario's parts only."""
    found = origins(manifest)
    return "Parts of the user's own: " + "; ".join(f"{k} {v}" for k, v in found.items()) if found else ""


def _said(origin: Mapping[str, Any]) -> str:
    file = origin.get("file") or "no file"
    sha = f"SHA-256 {origin['sha256'][:DIGITS]}" if origin.get("sha256") else "no checksum"
    more = [f"{name} {sum_[:DIGITS]}" for name, sum_ in origin.get("imports", {}).items()]
    more += [origin["package"]] if origin.get("package") else []
    return f"{called(origin)} ({', '.join([file, sha, *more])})"
