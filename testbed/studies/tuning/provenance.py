"""Records what a folder of tuned gains depends on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from aircraft.airframes.schema import Airframe


def provenance_of(command: str, airframe: Airframe) -> dict[str, Any]:
    """What made a folder of gains: command, versions, the airframe's files."""
    from testbed.components.versions import versions

    return {
        "command": command,
        "versions": versions(),
        "airframes": {airframe.name: airframe.fingerprint()},
    }


def changed_gains(airframe: Airframe, source: str) -> dict[str, float]:
    """The gains in which the airframe differs from the one it is read from: those of --gains."""
    from aircraft.airframe import load

    before = load(source)
    return {
        name: airframe.gain(name)
        for name in airframe.gain_names()
        if before.gain(name) != airframe.gain(name)
    }


def fingerprint(airframe: Airframe) -> str:
    """Of the airframe and of all that flies and scores it: neither changed code nor files resume old rows."""
    from importlib.metadata import version

    from aircraft.equations.catalogue import text_of
    from testbed.campaigns.identity import code_id, content_id

    equations = text_of(airframe)
    return content_id(
        [airframe.fingerprint(), code_id("testbed.studies.tuning.sweeps"), version("control"), equations]
    )
