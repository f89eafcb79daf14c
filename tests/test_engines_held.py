"""Starting and settling engines, on engines whose states are formulas, in place of JSBSim's."""

from types import SimpleNamespace

import numpy as np
import pytest

from aircraft.airframes.setup import Engines
from aircraft.jsbsim.engines import FORCES, is_captive, run_held, running, settle, spools
from aircraft.jsbsim.errors import FdmError
from tests.paper_plane import INTEGRATORS, Node

THROTTLE = "fcs/throttle-cmd-norm"


class Bench:
    """`engines.Held`: engines whose shafts near 100 rpm times the throttle by a share `rate` a period.

    count     of engines;  burns  whether they burn fuel: then they need `cranks` periods of the starter
    forgets   whether an evaluation at rest leaves them at a tenth of their speed
    """

    def __init__(
        self, rate=0.05, count=1, burns=False, cranks=0, forgets=False, captive=False, states=True, rpm=0.0
    ):
        self.rate, self.burns, self.cranks, self.amnesia = rate, burns, cranks, forgets
        self.forgets = None
        self.airframe = SimpleNamespace(
            name="bench", engines=Engines(count=count, mixture=0.8, propeller=0.7),
            setup=SimpleNamespace(captive=captive, fuel_freeze=False),
        )  # fmt: skip
        self.paths = {path: Node() for path in FORCES}
        self.paths |= {f"simulation/integrator/{path}": Node(k + 1.0) for k, path in enumerate(INTEGRATORS)}
        self.paths |= {"propulsion/fuel_freeze": Node(), THROTTLE: Node(0.6)}
        self.index = ["", *(f"[{k}]" for k in range(1, count))]
        for k in self.index:
            self.paths |= {f"fcs/{lever}-cmd-norm{k}": Node(-1.0) for lever in ("mixture", "advance")}
            self.paths.setdefault(f"{THROTTLE}{k}", Node(-1.0))
            if burns:
                self.paths |= {
                    f"propulsion/engine{k}/set-running": Node(),
                    f"propulsion/engine{k}/map-pa": Node(),
                }
        if burns:
            self.paths |= {"propulsion/magneto_cmd": Node(), "propulsion/starter_cmd": Node()}
        self.engine_states = [Node(rpm) for _ in self.index] if states else []
        self.log, self.time, self.trim_status, self.cranked, self.periods = [], 7.0, None, 0, 0
        self.executive = self

    # what `engines` asks of JSBSim
    def node(self, path):
        return self.paths[path]

    def get_property_manager(self):
        return SimpleNamespace(get_node=self.paths.get)

    def get_propulsion(self):
        return self

    def init_running(self, which):
        self.log.append(("init_running", which, self.levers()))
        for k in self.index:  # as JSBSim does
            self.paths[f"{THROTTLE}{k}"].value = self.paths[f"fcs/mixture-cmd-norm{k}"].value = 1.0
            self.paths[f"fcs/advance-cmd-norm{k}"].value = 1.0
            if self.burns and self.cranks == 0:
                self.paths[f"propulsion/engine{k}/set-running"].value = 1.0
        for state in self.engine_states:
            state.value = max(state.value, 5.0)

    def set_trim_status(self, status):
        self.trim_status = status

    def get_sim_time(self):
        return self.time

    def set_sim_time(self, time):
        self.time = time

    def run_ic(self):
        self.log.append("run_ic")
        if self.amnesia:
            for state in self.engine_states:
                state.value *= 0.1

    def levers(self):
        names = (THROTTLE, "fcs/mixture-cmd-norm", "fcs/advance-cmd-norm")
        return [tuple(self.paths[name + k].value for name in names) for k in self.index]

    def run(self):
        """A period, as it should be while the body is held."""
        held = [self.paths[f"simulation/integrator/{path}"].value for path in INTEGRATORS]
        assert held == [0.0] * 4 and self.paths["propulsion/fuel_freeze"].value == 1.0
        self.time += 0.005
        self.periods += self.paths[THROTTLE].value == 0.5
        if self.burns and [self.paths[f"propulsion/{k}_cmd"].value for k in ("starter", "magneto")] == [
            1.0,
            3.0,
        ]:
            self.cranked += 1
            if self.cranked >= self.cranks > 0:
                for k in self.index:
                    self.paths[f"propulsion/engine{k}/set-running"].value = 1.0
        if not self.log or self.log[-1] != (self.trim_status, self.levers()):
            self.log.append((self.trim_status, self.levers()))
        self.move()

    def move(self):
        wanted = 100.0 * self.paths[THROTTLE].value
        for k, state in zip(self.index, self.engine_states, strict=False):
            going = not self.burns or self.paths[f"propulsion/engine{k}/set-running"].value
            state.value += self.rate * ((wanted if going else 0.0) - state.value)
        self.paths[FORCES[0]].value = 3.0 * sum(state.value for state in self.engine_states)


def rpm(bench):
    return [state.value for state in bench.engine_states]


@pytest.mark.parametrize("count", [1, 3])
def test_engines_are_started_at_half_throttle_and_settled_at_the_one_asked(count):
    bench = Bench(count=count)
    settle(bench)
    assert rpm(bench) == pytest.approx([60.0] * count, rel=1e-8)
    assert bench.forgets is False and spools(bench) == []
    # Levers are set before and after JSBSim lets the engines run, which opens them.
    start = [(0.5 if k == 0 else -1.0, 0.8, 0.7) for k in range(count)]
    assert bench.log[0] == ("init_running", -1, start)
    assert bench.log[1] == (True, [(0.5, 0.8, 0.7)] * count)
    asked = [(0.6 if k == 0 else 0.5, 0.8, 0.7) for k in range(count)]
    # Settled, put back to its place, looked at after a period, settled and put back again.
    assert bench.log[2:] == [(True, asked), "run_ic", (True, asked), "run_ic"]
    assert bench.trim_status is False and bench.time == 7.0
    assert [bench.node(f"simulation/integrator/{path}").value for path in INTEGRATORS] == [1.0, 2.0, 3.0, 4.0]
    assert bench.node("propulsion/fuel_freeze").value == 0.0


def test_engines_known_to_keep_their_state_are_settled_once():
    bench = Bench(rpm=30.0)
    bench.forgets = False
    settle(bench)
    assert bench.log == [(True, bench.levers()), "run_ic"] and rpm(bench) == pytest.approx([60.0], rel=1e-8)


def test_engines_that_forget_at_rest_are_left_as_they_run():
    bench = Bench(forgets=True)
    settle(bench)
    assert bench.forgets is True and rpm(bench) == pytest.approx([60.0], rel=1e-7)
    assert bench.log.count("run_ic") == 1 and bench.log[-1] != "run_ic"
    assert spools(bench) == [(bench.engine_states[0], rpm(bench)[0])]
    bench.log.clear()
    settle(bench)
    assert "run_ic" not in bench.log


@pytest.mark.parametrize(("change", "forgets"), [(0.9e-3, False), (1.2e-3, True)])
def test_a_thousandth_of_its_state_is_what_an_engine_may_lose_at_rest(change, forgets):
    bench = Bench(rate=0.5)
    bench.run_ic = lambda: [s.set_double_value(s.value * (1 - 2 * change)) for s in bench.engine_states]
    settle(bench)  # the period that is run before the look halves the loss
    assert bench.forgets is forgets


def test_what_has_no_state_is_left_alone_unless_it_is_captive():
    bench = Bench(states=False)
    settle(bench)
    assert bench.log == [] and not is_captive(bench) and bench.forgets is None
    bench = Bench(states=False, captive=True)
    settle(bench)
    assert is_captive(bench) and bench.log[-1] == "run_ic" and bench.forgets is False
    assert "init_running" not in str(bench.log)
    assert is_captive(Bench())


def test_a_piston_that_stands_is_cranked():
    bench = Bench(burns=True, cranks=900, count=2)
    settle(bench)
    assert rpm(bench) == pytest.approx([60.0] * 2, rel=1e-8)
    assert (
        bench.node("propulsion/magneto_cmd").value == 3.0
        and bench.node("propulsion/starter_cmd").value == 0.0
    )
    assert bench.cranked == 1000  # periods by starter, and 200 before and after it
    assert bench.periods == 1400
    started = Bench(burns=True)
    settle(started)
    assert started.cranked == 0 and started.node("propulsion/magneto_cmd").value == 0.0
    assert started.periods == 200


@pytest.mark.parametrize("starter", [True, False])
def test_an_engine_that_does_not_start_is_an_error(starter):
    bench = Bench(burns=True, cranks=2000)
    if not starter:  # JSBSim makes these properties for some engines only
        del bench.paths["propulsion/magneto_cmd"]
        bench.paths["propulsion/starter_cmd"].value = 0.0
        bench.move = lambda: None
        bench.burns = False
    told = "^bench: the engine does not run at half throttle; look at its fuel and sizes$"
    with pytest.raises(FdmError, match=told):
        settle(bench)
    assert bench.node(THROTTLE).value == 0.6  # as it was asked


def test_an_electric_engine_without_starter_that_stands_is_an_error():
    bench = Bench(rate=0.0)
    bench.init_running = lambda which: None
    with pytest.raises(FdmError, match="does not run at half throttle"):
        settle(bench)
    assert "propulsion/starter_cmd" not in bench.paths


def test_an_engine_runs_if_its_shaft_turns_and_its_fire_burns():
    bench = Bench(burns=True, count=2, rpm=50.0)
    lit = [bench.node(f"propulsion/engine{k}/set-running") for k in ("", "[1]")]
    for first, second, answer in ((0.0, 0.0, False), (1.0, 0.0, False), (0.0, 1.0, False), (1.0, 1.0, True)):
        lit[0].value, lit[1].value = first, second
        assert running(bench) is answer
    for turns, answer in ((0.99, False), (1.0, True)):
        bench.engine_states[0].value = turns
        assert running(bench) is answer
    # A turbine has n1 instead of a manifold; an electric engine neither, and no fire.
    bench.engine_states[0].value, lit[1].value = 50.0, 0.0
    del bench.paths["propulsion/engine[1]/map-pa"]
    assert running(bench)
    bench.paths["propulsion/engine[1]/n1"] = Node(20.0)
    assert not running(bench)


@pytest.mark.parametrize("frozen", [True, False])
def test_periods_with_the_body_held_change_nothing_but_engines(frozen):
    """Fuel is frozen afterwards where [setup] says so: JSBSim reads the property as 0 always."""
    bench = Bench(rpm=30.0)
    bench.airframe.setup.fuel_freeze = frozen
    run_held(bench, 3, at_once=False)
    assert rpm(bench) == pytest.approx([60 - 30 * 0.95**3])
    assert bench.log[0][0] is False and bench.trim_status is False and bench.time == 7.0
    assert bench.node("propulsion/fuel_freeze").value == float(frozen)
    run_held(bench, 1)
    assert bench.log[-1][0] is True and bench.trim_status is False


class Wobbling(Bench):
    """A governor: its force swings for ever by `size` about a mean, for `settles` periods."""

    def __init__(self, size, settles=10**9, **more):
        super().__init__(rpm=60.0, **more)
        self.forgets, self.size, self.settles, self.periods = False, size, settles, 0

    def move(self):
        self.periods += 1
        swing = self.size if self.periods < self.settles else 0.0
        sign = 1.0 if (self.periods // 20) % 2 else -1.0
        self.paths[FORCES[3]].value = 100.0 * (1.0 + 0.5 * sign * swing)


@pytest.mark.parametrize(
    ("size", "periods"),
    # settled at once; after 40 looks without progress and one; at the end of the patience
    [(0.9e-9, 40), (1.1e-9, 20 * 43), (0.9e-7, 20 * 43), (1.1e-7, 8000), (0.9e-4, 8000)],
)
def test_how_much_a_governor_may_hunt(size, periods):
    bench = Wobbling(size)
    settle(bench)
    assert bench.periods == periods


@pytest.mark.parametrize("states", [True, False])
def test_engines_that_never_settle_are_an_error(states):
    bench = Wobbling(1.1e-4, states=states, captive=True)
    what = "engines are" if states else "the model's own flight control is"
    with pytest.raises(FdmError, match=f"^bench: {what} not steady after 8000 periods at rest$"):
        settle(bench)


def test_changes_are_shares_of_each_state_and_of_the_largest_force():
    """A state of 1e-4 counts as one of 1e-3, a small moment beside a large force as the force."""
    for state, force, moment, steady_ in (
        (60.0, 100.0, 9e-8, True),  # of 100: 9e-10
        (60.0, 0.1, 9e-8, False),
        (60.0 * (1 + 9e-10), 100.0, 0.0, True),
        (60.0 * (1 + 1.3e-9), 100.0, 0.0, False),
        (60.0, 100.0 * (1 + 2e-9), 0.0, False),
    ):
        bench = Wobbling(0.0)
        looks = []

        def move(bench=bench, looks=looks, after=(state, force, moment)):
            bench.periods += 1
            moved = bench.periods > 20
            bench.engine_states[0].value = after[0] if moved else 60.0
            bench.paths[FORCES[3]].value = after[1] if moved or after[1] == 0.1 else 100.0
            bench.paths[FORCES[8]].value = after[2] if moved else 0.0

        bench.move = move
        settle(bench)
        # Twenty periods make the first values; forces come from nothing then, so one look more at least.
        assert bench.periods == (40 if steady_ else 60), (state, force, moment)


@pytest.mark.parametrize(("change", "periods"), [(0.9e-12, 40), (2e-12, 60)])
def test_a_small_state_counts_as_a_thousandth(change, periods):
    """A change of 0.9e-12 is a share of 9e-9 of a state of 1e-4, and of 9e-10 of the least that counts."""
    bench = Wobbling(0.0)
    bench.engine_states[0].value = 1e-4

    def move():
        bench.periods += 1
        if bench.periods > 20:
            bench.engine_states[0].value = 1e-4 + change
        bench.paths[FORCES[3]].value = 100.0

    bench.move = move
    settle(bench)
    assert bench.periods == periods


def test_forces_and_moments_of_propulsion_and_of_all_are_looked_at():
    names = [f"forces/fb{axis}-{part}-lbs" for part in ("prop", "total") for axis in "xyz"]
    names += [f"moments/{axis}-{part}-lbsft" for part in ("prop", "total") for axis in "lmn"]
    assert list(FORCES) == names
    for k, path in enumerate(FORCES):
        bench = Wobbling(0.0)

        def move(bench=bench, path=path):
            bench.periods += 1
            bench.paths[path].value = float(np.floor(bench.periods / 20) == 1)

        bench.move = move
        settle(bench)
        assert bench.periods == 60, k


def test_while_engines_come_nearer_patience_lasts():
    """A slow decay makes progress, of a tenth and more: it ends by its size, not by patience."""
    bench = Wobbling(0.0)

    def move():
        bench.periods += 1
        bench.paths[FORCES[3]].value = 100.0 * (1.0 + 1e-3 * 0.994**bench.periods)

    bench.move = move
    settle(bench)
    # 1e-3 (0.994^-20 - 1) 0.994^n < 1e-9 after 1,954 periods: beyond 40 looks
    assert bench.periods == 1960
