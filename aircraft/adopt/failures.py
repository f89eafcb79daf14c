"""The one way in which an adoption ends early: refused, at a stage, for a reason."""

from __future__ import annotations


class AdoptionError(RuntimeError):
    """The aircraft cannot be adopted: at which stage, and the reason in one line."""

    def __init__(self, stage: str, reason: str) -> None:
        super().__init__(f"refused at {stage}: {reason}")
        self.stage = stage
        self.reason = reason
