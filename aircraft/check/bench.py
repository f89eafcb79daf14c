"""Evaluates the forces and moments of a loaded model at rest, and finds the lines that findings name."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from aircraft.airframes.files import Files, Finding
from aircraft.airframes.xml import Element
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.rest import hold


class Bench:
    """The model at its start speed, evaluated at rest in time, and the lines of its parts in the text."""

    def __init__(self, files: Files, fdm: Fdm) -> None:
        self.files, self.fdm = files, fdm
        self.speed = files.airframe.speeds.start_mps
        self.commands = {f"fcs/{n}-cmd-norm": 0.0 for n in ("elevator", "aileron", "rudder", "throttle")}

    def at(
        self,
        alpha: float = 0.05,
        beta: float = 0.0,
        rates: tuple[float, float, float] = (0.0, 0.0, 0.0),
        speed: float | None = None,
        commands: Mapping[str, float] | None = None,
    ) -> np.ndarray:
        """Aerodynamic force along body axes and moment, (6,), in JSBSim's units; angles rad."""
        v = self.speed if speed is None else speed
        body = v * np.array(
            [math.cos(alpha) * math.cos(beta), math.sin(beta), math.sin(alpha) * math.cos(beta)]
        )
        given = {f"fcs/{name}-cmd-norm": value for name, value in (commands or {}).items()}
        hold(self.fdm, body, (0.0, alpha, 0.0), rates, {**self.commands, **given})
        forces = [self.fdm.read(f"forces/fb{a}-aero-lbs") for a in "xyz"]
        return np.array(forces + [self.fdm.read(f"moments/{a}-aero-lbsft") for a in "lmn"])

    def lift(self, alpha: float) -> float:
        x, _, z, *_ = self.at(alpha)
        return float(x * math.sin(alpha) - z * math.cos(alpha))

    def drag(self, alpha: float, elevator: float = 0.0) -> float:
        x, _, z, *_ = self.at(alpha, commands={"elevator": elevator})
        return float(-x * math.cos(alpha) - z * math.sin(alpha))

    def thrust(self, speed: float, throttle: float) -> float:
        """Along the body's x axis, from engines and external reactions."""
        self.at(speed=speed, commands={"throttle": throttle})
        return self.fdm.read("forces/fbx-prop-lbs") + self.fdm.read("forces/fbx-external-lbs")

    def line(self, *words: str, axis: str = "") -> int | None:
        """The first line of the model that mentions a word, inside the aerodynamic axis of that name."""
        tree = self.files.trees[self.files.model]
        scopes: list[Element] = [tree]
        if axis:
            scopes = [e for e in tree.all("axis") if e.attributes.get("name", "").upper() == axis]
        for scope in scopes:
            for word in words:
                if found := scope.mentions(word):
                    return found.line
        return scopes[0].line if axis and scopes else None

    def element(self, name: str) -> int | None:
        found = self.files.trees[self.files.model].first(name)
        return found.line if found else None

    def finding(self, rule: str, line: int | None, message: str, remedy: str) -> Finding:
        return Finding(rule, "warning", self.files.model, line, message, remedy)
