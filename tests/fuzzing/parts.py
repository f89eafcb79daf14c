"""Parts that break any one clause of their contract, and an honest plant that remembers its motion."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from filters.barriers.pairs import PairValues
from filters.cbf.collision import Passthrough
from filters.filter import Decision, Declaration
from filters.model import Array, Command, State, View, step
from testbed.components import catalogue
from testbed.scenario.scenario import Scenario


class RudeError(Exception):
    """An exception that cannot even say what it is."""

    def __str__(self) -> str:
        raise ValueError("no words")


ERRORS: list[Callable[[], BaseException]] = [
    lambda: RuntimeError("no map loaded"),
    lambda: ValueError("\x1b[2J\nnan"),
    lambda: SystemExit(3),
    lambda: StopIteration(),
    lambda: RecursionError("x" * 5000),
    lambda: AssertionError(),
    lambda: KeyError(None),
    RudeError,
]
JUNK: list[Callable[[], Any]] = [
    lambda: None,
    lambda: "text",
    lambda: 10**400,
    lambda: 3.5,
    lambda: float("nan"),
    lambda: True,
    lambda: [],
    lambda: {},
    lambda: [[1.0], [1.0, 2.0]],
    lambda: object(),
    lambda: np.zeros(0),
    lambda: np.array(["1.0", "2.0"]),
    lambda: b"bytes",
    lambda: Command.of(np.zeros((5, 3))),
    lambda: type,
]


def spoiled(values: Any, how: int, where: int) -> Any:
    """An array with one thing wrong."""
    a = np.array(values, dtype=float)
    kinds: list[Callable[[], Any]] = [
        lambda: a[:-1],
        lambda: np.concatenate([a, a[:1]]),
        lambda: a[None],
        lambda: a.astype(object),
        lambda: a.astype(complex),
        lambda: a.astype(str),
        lambda: float(a.flat[0]),
        lambda: _with(a, where, np.nan),
        lambda: _with(a, where, np.inf),
        lambda: _with(a, where, -1e300),
        lambda: _with(a, where, 1e12),
        lambda: np.ma.masked_invalid(_with(a, where, np.nan)),
    ]
    return kinds[how % len(kinds)]()


def _with(a: Array, where: int, value: float) -> Array:
    changed = a.copy()
    if changed.size:
        changed.flat[where % changed.size] = value
    return changed


def write(array: Array) -> None:
    """Write into an array, whatever it says of itself."""
    for target in (array.base, array):
        with contextlib.suppress(Exception):
            target.flags.writeable = True  # type: ignore[union-attr]
    with contextlib.suppress(Exception):
        array += 50.0


@dataclass
class Lie:
    """What a part does wrong: `what`, at call `at` of the method concerned, `how` and `where` in detail."""

    what: str
    at: int
    how: int
    where: int
    calls: int = 0

    def now(self) -> bool:
        """Whether this call is the one."""
        self.calls += 1
        return self.calls == self.at + 1

    def junk(self) -> Any:
        return JUNK[self.how % len(JUNK)]()

    def error(self) -> BaseException:
        return ERRORS[self.how % len(ERRORS)]()

    def pick(self, names: tuple[str, ...]) -> str:
        return names[self.where % len(names)]


class Honest:
    """Exact unicycles that remember their motion: the truth that verdicts are held against."""

    def __init__(self, s: Scenario, wind: Array) -> None:
        self.dt, self.n = s.rates.fdm_dt_s, s.vehicles
        self.states: list[Array] = []
        self.tracks: list[Array] = []
        self.commands: list[Array] = []

    def reset(self, state: State, rng: np.random.Generator) -> None:
        self.now = State.of(state.array())
        self.rates = Command.of(np.tile([20.0, 0.0, 0.0], (self.n, 1)))
        self.states.append(self.now.array())

    def step(self, command: Command, wind: Array, n: int) -> Array:
        self.rates = Command.of(command.array())
        track = np.empty((n, self.n, 3))
        for k in range(n):
            self.now = step(self.now, self.rates, self.dt)
            track[k] = self.now.position
        self.states.append(self.now.array())
        self.tracks.append(track.copy())
        self.commands.append(command.array())
        return track

    def state(self) -> State:
        return State.of(self.now.array())

    def achieved(self) -> Command:
        return Command.of(self.rates.array())

    def telemetry(self) -> dict[str, Array]:
        return {"roll_rad": np.zeros(self.n)}

    def faults(self) -> list[str]:
        return [""] * self.n


PLANT_LIES = (
    "none", "junk", "raise", "spoil", "short", "away", "late", "dt", "moves", "writes", "channels", "faults",
    "elsewhere", "missing", "maker", "made", "close", "rates",
)  # fmt: skip


class LyingPlant(Honest):
    """An honest plant with one lie."""

    def __init__(self, s: Scenario, wind: Array, lie: Lie) -> None:
        super().__init__(s, wind)
        self.lie, self.victim = lie, lie.pick(("step", "state", "achieved", "telemetry", "faults"))
        if lie.what == "maker":
            raise lie.error()
        if lie.what == "missing":
            setattr(self, self.victim, None)
        if lie.what == "dt" and lie.at == 0:
            self._other_dt()
        self.given: list[Array] = []
        self.before = np.zeros((self.n, 4))

    def _other_dt(self) -> None:
        others: list[Any] = [2 * self.dt, None, "0.02", float("nan"), -self.dt, 10**400, np.array([self.dt])]
        self.dt = others[self.lie.how % len(others)]

    def reset(self, state: State, rng: np.random.Generator) -> None:
        if self.lie.what == "raise" and self.lie.how % 5 == 0:
            raise self.lie.error()
        super().reset(state, rng)
        if self.lie.what == "elsewhere":
            self.now = State(self.now.x + 40.0, self.now.y, self.now.theta, self.now.z)

    def _told(self, method: str, honest: Any) -> Any:
        lie = self.lie
        if method != self.victim or lie.what not in ("junk", "raise", "spoil") or not lie.now():
            return honest
        if lie.what == "junk":
            return lie.junk()
        if lie.what == "raise":
            raise lie.error()
        if isinstance(honest, np.ndarray):
            return spoiled(honest, lie.how, lie.where)
        if isinstance(honest, State | Command):
            name = tuple(f.name for f in dataclasses.fields(honest))[lie.where % 3]
            object.__setattr__(honest, name, spoiled(getattr(honest, name), lie.how, lie.where))
            return honest
        if isinstance(honest, dict):
            return {"roll_rad": spoiled(honest["roll_rad"], lie.how, lie.where)}
        return [*honest, ""] if lie.how % 2 else honest[:-1]

    def step(self, command: Command, wind: Array, n: int) -> Array:
        lie, steps = self.lie, len(self.commands)
        if lie.what == "writes" and steps >= lie.at:
            asked = command.array()
            write(command.v), write(wind)
            command = Command.of(asked)
        if lie.what == "dt" and steps == lie.at:
            # The motion is that of the right period.
            dt = self.dt
            self._other_dt()
            other, self.dt = self.dt, dt if isinstance(dt, float) else 0.02
            track = super().step(command, wind, n)
            self.dt = other
            return track
        self.before = self.now.array()
        track = super().step(command, wind, n)
        if lie.what == "moves":
            for given in self.given:
                given += 100.0
            self.given.append(track)
        if lie.what == "short" and steps >= lie.at:
            cut = [
                track[-1:],
                track[:-1],
                np.concatenate([track, track[-1:]]),
                track.swapaxes(0, 1),
                track[0],
            ]
            return cut[lie.how % len(cut)]
        told: Array = self._told("step", track)
        return told

    def state(self) -> State:
        told: State = self._told("state", super().state())
        lie, steps = self.lie, len(self.commands)
        if lie.what == "away" and steps >= lie.at:
            return State(told.x, told.y + (1.0 + lie.how) * np.arange(self.n), told.theta, told.z)
        if lie.what == "late" and steps >= max(1, lie.at):
            return State.of(self.before)
        return told

    def achieved(self) -> Command:
        told: Command = self._told("achieved", super().achieved())
        return Command(told.v + 3.0, told.omega, told.zeta) if self.lie.what == "rates" else told

    def telemetry(self) -> dict[str, Array]:
        told: dict[Any, Any] = self._told("telemetry", super().telemetry())
        if self.lie.what == "channels" and self.lie.now():
            names: list[Any] = ["x_m", "t_s", 5, "two words", "", "qp_status", "wind_up_mps", "more"]
            told[names[self.lie.how % len(names)]] = np.zeros(self.n)
        return told

    def faults(self) -> list[str]:
        told: list[Any] = self._told("faults", super().faults())
        if self.lie.what == "faults" and self.lie.now():
            ways: list[Any] = ["bird\nstrike", 3, None, "x" * 10_000, "\x1b[2J"]
            told[0] = ways[self.lie.how % len(ways)]
        return told

    def close(self) -> None:
        if self.lie.what == "close":
            raise self.lie.error()


FILTER_LIES = (
    "none", "junk", "raise", "spoil", "nan", "outside", "status", "claims", "bold", "pairs", "writes",
    "maker", "made", "declares", "declaration",
)  # fmt: skip


class LyingFilter:
    """No filter, the scenario's, or a bolder one; with one lie."""

    def __init__(self, s: Scenario, barrier: Any, goal: Array, lie: Lie) -> None:
        self.lie, self.n = lie, s.vehicles
        if lie.what == "maker":
            raise lie.error()
        self.barrier = barrier
        self.made: Any = Passthrough() if lie.where % 2 else catalogue.filter_(s, barrier, goal)
        if lie.what == "bold":
            bolder = dataclasses.replace(barrier, d_safe=barrier.d_safe / 2)
            self.made = catalogue.filter_(s, bolder, goal)
        if lie.what == "writes":
            write(goal)
            for name, value in (("d_safe", 0.1), ("v", 1.0)):
                object.__setattr__(barrier, name, value)
            s.limits.__dict__["v_max_mps"] = 500.0
            s.__dict__["d_safe_m"] = 0.1

    @property
    def declaration(self) -> Any:
        lie = self.lie
        if lie.what == "declaration":
            raise lie.error()
        if lie.what == "declares":
            answers: list[Any] = [lambda view: None, lambda view: lie.junk(), lie.junk(), self._raise]
            return Declaration(constraints=answers[lie.how % 4], solves_qp=True, paper=True)
        return Declaration(barrier=self.barrier, solves_qp=True, paper=True)

    def _raise(self, view: View) -> Any:
        raise self.lie.error()

    def __call__(self, view: View, nominal: Command, limits: Any) -> Any:
        lie = self.lie
        if lie.what == "writes":
            for array in (view.state.y, view.rates.v, nominal.omega, limits.v_max, limits.omega_max):
                write(array)
            return Passthrough()(view, Command.of(np.nan_to_num(nominal.array())), limits)
        d: Decision = self.made(view, nominal, limits)
        if lie.what == "claims":
            status = np.full(self.n, 1 + lie.how % 3)
            p = self.n * (self.n - 1) // 2
            i, j = np.triu_indices(self.n, 1)
            fine = PairValues(i, j, np.full(p, 100.0), np.zeros((p, 8)))
            return dataclasses.replace(d, status=status, pairs=fine, hdot_predicted=np.full(p, 1e3))
        if lie.what == "outside":
            return dataclasses.replace(d, command=Command(d.command.v * 3.0, d.command.omega, d.command.zeta))
        if not lie.now():
            return d
        if lie.what == "junk":
            return lie.junk()
        if lie.what == "raise":
            raise lie.error()
        if lie.what == "nan":
            bad = spoiled(d.command.array(), 7 + lie.how % 4, lie.where)
            return dataclasses.replace(d, command=Command.of(bad))
        if lie.what == "status":
            return dataclasses.replace(d, status=np.full(self.n, (9, -1, 10**6)[lie.how % 3]))
        if lie.what == "spoil":
            name = lie.pick(("command", "status", "residual", "override", "deviation", "hdot_predicted"))
            value = lie.junk() if lie.how % 2 else spoiled(np.zeros(self.n), lie.how // 2, lie.where)
            return dataclasses.replace(d, **{name: value})
        if lie.what == "pairs" and d.pairs is not None:
            name = lie.pick(("i", "j", "h", "grad"))
            value = lie.junk() if lie.how % 2 else spoiled(getattr(d.pairs, name), lie.how // 2, lie.where)
            return dataclasses.replace(d, pairs=dataclasses.replace(d.pairs, **{name: value}))
        return d


GUIDANCE_LIES = ("none", "junk", "raise", "spoil", "writes", "maker", "made")


class LyingGuidance:
    """Straight on, or towards the others; with one lie."""

    def __init__(self, s: Scenario, goal: Array, barrier: Any, lie: Lie) -> None:
        self.lie, self.n = lie, s.vehicles
        if lie.what == "maker":
            raise lie.error()

    def __call__(self, t: float, state: State) -> Any:
        lie = self.lie
        wanted = np.tile([20.0 + 3.0 * (lie.where % 3), 0.1 * (lie.how % 3 - 1), 0.0], (self.n, 1))
        if lie.what == "writes":
            write(state.x), write(state.theta)
        if not lie.now():
            return Command.of(wanted)
        if lie.what == "junk":
            return lie.junk()
        if lie.what == "raise":
            raise lie.error()
        if lie.what == "spoil":
            made = Command.of(wanted)
            name = lie.pick(("v", "omega", "zeta"))
            object.__setattr__(made, name, spoiled(getattr(made, name), lie.how, lie.where))
            return made
        return Command.of(wanted)


ENVIRONMENT_LIES = (
    "none", "junk", "raise", "spoil", "sometimes", "observe junk", "observe raise", "view", "offset",
    "writes", "maker", "made", "mixed",
)  # fmt: skip


class LyingEnvironment:
    """A light wind, and the truth known; with one lie."""

    def __init__(self, s: Scenario, rngs: Any, lie: Lie) -> None:
        self.lie, self.n = lie, s.vehicles
        if lie.what == "maker":
            raise lie.error()

    def wind(self, t: float, state: State) -> Any:
        lie = self.lie
        if lie.what == "writes":
            write(state.x), write(state.y)
        air = np.tile([1.0, 0.5, 0.0], (self.n, 1))
        if lie.what not in ("junk", "raise", "spoil", "sometimes") or not lie.now():
            return air
        if lie.what == "junk":
            return lie.junk()
        if lie.what == "raise":
            raise lie.error()
        return None if lie.what == "sometimes" else spoiled(air, lie.how, lie.where)

    def observe(self, t: float, truth: State, rates: Command) -> Any:
        lie, view = self.lie, View(truth, rates)
        if lie.what == "writes":
            write(truth.x), write(rates.v)
        if lie.what == "offset":
            return View(State(truth.x + 5.0, truth.y, truth.theta, truth.z), rates)
        if lie.what == "mixed":
            own = State.of(np.tile(truth.array(), (self.n, 1, 1)))
            return View(own, rates)
        if lie.what not in ("observe junk", "observe raise", "view") or not lie.now():
            return view
        if lie.what == "observe junk":
            return lie.junk()
        if lie.what == "observe raise":
            raise lie.error()
        whose, name = (view.state, "theta") if lie.where % 2 else (view.rates, "omega")
        value = lie.junk() if lie.how % 2 else spoiled(getattr(whose, name), lie.how // 2, lie.where)
        changed = type(whose).of(whose.array())
        object.__setattr__(changed, name, value)
        return View(changed, rates) if whose is view.state else View(truth, changed)  # type: ignore[arg-type]
