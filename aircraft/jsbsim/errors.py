"""Errors of the JSBSim wrapper."""

from __future__ import annotations

from aircraft.airframes.files import Finding
from aircraft.airframes.schema import Airframe


class FdmError(RuntimeError):
    """JSBSim could not load, start or fly an airframe."""


class UnresolvedError(FdmError):
    """A model refers to properties that do not exist; `findings` names each, with file and line."""

    def __init__(self, airframe: Airframe, findings: list[Finding]) -> None:
        first = findings[0]
        super().__init__(f"{airframe.folder / first.file}:{first.line}: {first.message}; {first.remedy}")
        self.findings = findings
