"""Checks what guidance wanted, and how far vehicles were from the tracks that they follow."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from testbed.verification import guidance_laws
from testbed.verification.finding import Finding, compared, thin
from testbed.verification.future import Pose, manoeuvre
from testbed.verification.recorded import Recorded
from testbed.verification.settings import knows_itself, nominal


def guidance(run: Recorded) -> Iterator[Finding]:
    if not set(run.parts) & {"nominal", "disturbance"} and knows_itself(run.scenario):
        yield from _nominal(run)
    yield from _tracks(run)


def _nominal(run: Recorded) -> Iterator[Finding]:
    """What the controller wanted, from the pose recorded, or that of some steps before."""
    s = run.scenario
    late, steps = s["guidance"]["delay_steps"], round(s["rates"]["record_dt_s"] / s["rates"]["filter_dt_s"])
    if late % steps:
        return
    wanted = nominal(s, run.t, Pose(run.position, run.vehicles["theta_rad"]), manoeuvre(s), run.complete)
    if late:
        none = np.zeros((late // steps, *wanted.shape[1:]))
        wanted = np.concatenate([none, wanted])[: len(run.t)]
    said = run.channels("_nominal")
    open_ = ~np.isfinite(wanted)  # told by nothing, and never so by a vehicle's own numbers
    wanted = np.where(open_, said, wanted)
    if open_.all():
        return
    yield compared("nominal", said, wanted, 1e-9 * (1.0 + np.abs(wanted)))


def _tracks(run: Recorded) -> Iterator[Finding]:
    """How far vehicles were from the tracks that they follow."""
    laws = guidance_laws.tables(run.scenario)
    follow = [k for k, law in enumerate(laws) if law["kind"] == "track" and "nominal" not in run.parts]
    said = run.manifest.get("track_error")
    if not follow and said is None:
        return
    if [one.get("vehicle") for one in said or []] != [k + 1 for k in follow]:
        yield Finding("track", f"{len(said or [])} tracks", f"{len(follow)}", False, None, "other vehicles")
        return
    if not run.complete or run.flew_on:
        yield Finding("track", f"{len(follow)} tracks", "unknown", None, None, thin(run))
        return
    told = np.array([[one["largest_m"], one["rms_m"]] for one in said or []])
    own = [guidance_laws.farthest_from_track(laws[k], run.t, run.position[:, k]) for k in follow]
    yield compared("track", told, np.array(own), np.full(told.shape, 1e-6))
    for k in follow:
        if laws[k].get("sha256") and laws[k]["sha256"] != guidance_laws.checksum(laws[k]["rows"]):
            yield Finding("track", "a checksum", "another", False, None, f"the rows of vehicle {k + 1}")
