"""Judges an adopted aircraft by its steps and margins: good, or flies with remarks, each named."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from aircraft.adopt.scoring import Scored

GOOD, REMARKS, REFUSED = "good", "flies with remarks", "refused"
OVERSHOOT, ERROR, DISK = 0.12, 0.05, 0.5
LOST = 1.0  # overshoot or final error as large as the step itself: the command was not followed


@dataclass(frozen=True)
class Verdict:
    """What became of a model.

    kind     GOOD, REMARKS or REFUSED
    stage    where it was refused, "" otherwise
    remarks  why it is not good
    worst    of the steps and loops: overshoot and final error as shares, disk margin, t63 [s] by channel
    """

    kind: str
    stage: str
    remarks: tuple[str, ...]
    worst: dict[str, float]

    @property
    def flies(self) -> bool:
        """Whether every step was flown to its end."""
        return self.kind != REFUSED


def judge(scored: Sequence[Scored], disks: dict[tuple[float, str], float]) -> Verdict:
    """The verdict on steps flown and disk margins measured."""
    ended = [s.case.title for s in scored if not math.isfinite(s.overshoot)]
    if ended:
        return Verdict(REFUSED, "steps", (f"it does not fly to the end: {', '.join(ended)}",), {})
    lost = [s.case.title for s in scored if max(s.overshoot, s.final_error) >= LOST]
    if lost:
        return Verdict(REFUSED, "steps", (f"it does not follow: {', '.join(lost)}",), {})
    remarks = []
    for s in scored:
        if s.overshoot > OVERSHOOT:
            remarks.append(f"{s.case.title} overshoots by {100 * s.overshoot:.0f} %")
        if s.final_error > ERROR:
            remarks.append(f"{s.case.title} ends {100 * s.final_error:.0f} % beside")
    for (v, loop), disk in disks.items():
        if disk < DISK:
            remarks.append(f"the {loop} loop at {v:g} m/s has a disk margin of {disk:.2f}")
    worst = {
        "overshoot": max(s.overshoot for s in scored),
        "final_error": max(s.final_error for s in scored),
        "disk_margin": min(disks.values()),
    }
    for channel in ("omega", "zeta", "v"):
        worst[f"t63_{channel}_s"] = max(s.t63 for s in scored if s.case.channel == channel)
    return Verdict(REMARKS if remarks else GOOD, "", tuple(remarks), worst)
