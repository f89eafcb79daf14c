"""Decides whether derived numbers still belong to their aircraft: identified lags and fitted feed-forward.

They do if the fingerprint is the same. Files may differ in something that does not change the flight, such
as a landing light. So where fingerprints differ the model is tested: if it flies as recorded, or the fit
gives the same numbers, they belong to it.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

from aircraft.airframes.provenance import FITTED, differs, fitted_fingerprint, identified_fingerprint
from aircraft.airframes.schema import Airframe
from aircraft.autopilots.feedforward import feedforward
from aircraft.autopilots.specification import CLIMB, climb_rate, turn_rate
from aircraft.autopilots.tuning import fly
from aircraft.jsbsim.errors import FdmError

_CLIMB_MPS, _TURN_RADPS, _FLOWN_S = 2.0, 0.2, 3.0
_INSTANTS = (50, 100, 200, 400, 600)  # periods of 5 ms
_DECIMALS, _SAME = 5, 3e-5
_FIT_SAME = 2e-5  # relative: the file has six digits


def flown(airframe: Airframe) -> list[float]:
    """Ground speed, course rate and climb rate [m/s, rad/s, m/s] at five instants of a step in all three."""
    v, to = airframe.speeds.within(0.5), airframe.speeds.within(0.9)
    turn = min(_TURN_RADPS, turn_rate(airframe.speeds, to))
    f = fly(airframe, v, (to, turn, _CLIMB_MPS * (climb_rate(airframe.speeds) / CLIMB)), _FLOWN_S)
    rows = np.stack([f.v, f.omega_measured, f.zeta], axis=1)[np.array(_INSTANTS) - 1]
    return [round(x, _DECIMALS) for x in rows.ravel().tolist()]


def stale_lags(airframe: Airframe) -> str | None:
    """Why the identified lags are not this aircraft's, and what remakes them; None if they are.

    Lags from a flight log are of the aircraft that flew; where the log lies in the folder, its hash must be
    theirs. May fly the model for 3 s, in this process.
    """
    known = airframe.identified
    if known is None:
        return None
    if known.log is not None:
        log = airframe.folder / Path(known.log).name
        if not log.is_file() or hashlib.sha256(log.read_bytes()).hexdigest() == known.log_sha256:
            return None
        return f"[identified] was made from another {known.log}; run: {known.command}"
    remedy = f"run: testbed aircraft identify {airframe.argument}"
    if known.fingerprint is None:
        return f"[identified] does not say from which model and gains it was made; {remedy}"
    other = differs(known.fingerprint, identified_fingerprint(airframe))
    if other == "gains":
        return f"[identified] was made from other gains or speeds; {remedy}"
    if other == "model" and not _flies_as_recorded(airframe, known.flown):
        return f"[identified] was made from another model; {remedy}"
    return None


def stale_feedforward(airframe: Airframe) -> str | None:
    """Why the fitted feed-forward is not this model's, and what remakes it; None if it is.

    Gains without a [fitted] table are a person's own, and never stale. May trim the model, in this process.
    """
    if airframe.fitted is None:
        return None
    remedy = f"run: testbed aircraft trim {airframe.argument}"
    if airframe.fitted.fingerprint is None:
        return f"[fitted] does not say from which model and gains it was made; {remedy}"
    other = differs(airframe.fitted.fingerprint, fitted_fingerprint(airframe))
    if other == "gains":
        return f"the feed-forward of [fitted] was edited, or made from other gains or speeds; {remedy}"
    if other == "model" and not _fits_as_recorded(airframe):
        return f"the feed-forward of [fitted] was made from another model; {remedy}"
    return None


def _flies_as_recorded(airframe: Airframe, recorded: list[float]) -> bool:
    try:
        now = flown(airframe)
    except FdmError:
        return False
    return len(now) == len(recorded) and bool(np.abs(np.subtract(now, recorded)).max() < _SAME)


def _fits_as_recorded(airframe: Airframe) -> bool:
    try:
        now = feedforward(airframe)
    except FdmError:
        return False
    written = airframe.gains["airframe"]
    return all(abs(now[name] - written[name]) <= _FIT_SAME * abs(written[name]) + 1e-9 for name in FITTED)
