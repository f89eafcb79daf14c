"""Files and packages of a user's own parts, written into a folder for tests."""

from __future__ import annotations

from pathlib import Path

GUIDE = Path(__file__).parent.parent / "docs" / "guide" / "examples" / "my_parts.py"

SMALL = '''
import numpy as np
from filters.filter import Decision
from filters.model import Command
from helper import SPEED

class Slow:
    """Flies what is wanted, at a share of its speed."""

    def __init__(self, share=1.0):
        self.share = share

    def __call__(self, view, nominal, limits):
        zeros = np.zeros(len(nominal))
        chosen = limits.clip(Command(nominal.v * self.share, nominal.omega, nominal.zeta))
        changed = np.abs(chosen.array() - limits.clip(nominal).array()).max(axis=1)
        return Decision(chosen, zeros.astype(int), zeros, changed > 1e-6, changed, None, np.zeros(0))

class Straight:
    def __init__(self, goal, speed_mps=SPEED):
        self.speed = np.full(len(goal), speed_mps)

    def __call__(self, t, state):
        return Command(self.speed, 0 * self.speed, 0 * self.speed)

def itself(view, nominal, limits, share=1.0):
    return Slow(share)(view, nominal, limits)

def later(t, state):
    return Straight(state.x)(t, state)

def made(scenario, barrier, goal) -> Slow:
    return Slow()

def annotated(share=1.0) -> Slow:
    return Slow(share)

def unclear(share=1.0):
    return Slow(share)

class Told:
    role = "filter"

    def __init__(self, **anything):
        self.given = anything

    def __call__(self, *several):
        return Slow()(*several)

class Untold:
    def __call__(self, *several):
        return Slow()(*several)

class Air:
    def __init__(self, scenario, generators):
        from testbed.environment.environment import build
        self.usual = build(scenario, generators)
        self.wind, self.observe = self.usual.wind, self.usual.observe

    def wind(self, t, state): ...
    def observe(self, t, truth, rates): ...

class Glider:
    def reset(self, state, rng): ...
    def step(self, command, wind, n): ...
    def state(self): ...
    def achieved(self): ...
    def telemetry(self): ...
    def faults(self): ...

class Nothing:
    pass

GAIN = 2
shared = Slow()
'''


def write(folder: Path, text: str = SMALL, name: str = "mine.py", speed: float = 20.0) -> Path:
    """A user's file with a helper beside it."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "helper.py").write_text(f"SPEED = {speed}\n", encoding="utf-8")
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def install(folder: Path, version: str = "1.2", text: str = SMALL) -> Path:
    """A package with entry points, as it lies in site-packages; put the folder into sys.path."""
    package = folder / "slowpack"
    package.mkdir(parents=True, exist_ok=True)
    (package / "__init__.py").write_text("", encoding="utf-8")
    (package / "parts.py").write_text(text.replace("from helper import SPEED", "SPEED = 20.0"), "utf-8")
    told = folder / f"slowpack-{version}.dist-info"
    told.mkdir(exist_ok=True)
    (told / "METADATA").write_text(f"Metadata-Version: 2.1\nName: slowpack\nVersion: {version}\n", "utf-8")
    groups = {"filters": "slow-down = slowpack.parts:Slow", "guidance": "straight = slowpack.parts:Straight"}
    groups["plants"] = "brick = slowpack.parts:Glider"
    lines = [f"[cbf_jsbsim_testbed.{group}]\n{line}\n" for group, line in groups.items()]
    (told / "entry_points.txt").write_text("\n".join(lines), encoding="utf-8")
    return folder
