"""Errors of the JSBSim wrapper."""

from __future__ import annotations

from aircraft.airframes.files import Finding
from aircraft.airframes.schema import Airframe


class FdmError(RuntimeError):
    """JSBSim could not load, start or fly an airframe; where in which file, if JSBSim says so."""

    def __init__(self, message: str, file: str | None = None, line: int | None = None) -> None:
        super().__init__(message)
        self.file = file
        self.line = line


class UnsteadyError(FdmError):
    """There is no steady flight; `missing` says which force or moment is missing, at which airspeed."""

    def __init__(self, message: str, missing: str) -> None:
        super().__init__(f"{message}: {missing}")
        self.missing = missing


class UnresolvedError(FdmError):
    """A model refers to properties that do not exist; `findings` names each, with file and line."""

    def __init__(self, airframe: Airframe, findings: list[Finding]) -> None:
        first = findings[0]
        where = f"{airframe.folder / first.file}:{first.line}"
        super().__init__(f"{where}: {first.message}; {first.remedy}", first.file, first.line)
        self.findings = findings
