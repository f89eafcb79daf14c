"""What can befall a run in flight, in the words of its record: what, who, when. The run ends there, for all.

An aircraft that has left the air the model is made for, or a part that fails, has no motion that the others'
guarantee could be judged against; see docs/decisions/0008-a-fault-ends-the-run.md.
"""

from __future__ import annotations

import math
import traceback
from pathlib import Path

import numpy as np

from filters.model import Array


def lost(reported: list[str], track: Array) -> str | None:
    """Who of the fleet met what, None if nobody.

    reported  the plant's own words, one a vehicle, "" for none
    track     (n, N, 3) m, positions since the filter step before
    """
    if not any(reported) and math.isfinite(track.sum()):
        return None
    said = list(reported)
    for vehicle in np.flatnonzero(~np.isfinite(track).all(axis=(0, 2))):
        said[vehicle] = said[vehicle] or "position not finite"
    return "; ".join(f"vehicle {v}: {what}" for v, what in enumerate(said, 1) if what) or None


def raised(part: str, error: Exception) -> str:
    """An exception out of a plant, a filter, a controller or a disturbance, and where it came from."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    what = " ".join(str(error).split()) or "no message"
    return f"{part} failed: {type(error).__name__}: {what} ({Path(last.filename).name}:{last.lineno})"
