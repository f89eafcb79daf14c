"""Scenarios as environments of Gymnasium and PettingZoo: their checkers, and the session beneath."""

from __future__ import annotations

import sys
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import testbed
from filters.model import Command, State, View
from testbed.errors import UserError
from testbed.gym import extra
from testbed.gym.observation import distance, names, observe
from testbed.gym.rewards import Transition, progress

pytest.importorskip("gymnasium")
pytest.importorskip("pettingzoo")
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_api_test

from testbed.gym.ego import EgoEnvironment
from testbed.gym.fleet import FleetEnvironment

BRIEF = ["duration_s=1", "filter_dt_s=0.05", "record_dt_s=0.05", "manoeuvre_instants=0"]
PERTURBED = [*BRIEF, "heading_perturbation_deg=5", "start.radius_m=100"]
NEAR = [*BRIEF, "start.radius_m=12"]  # 24 m apart and head-on
STRAIGHT = np.array([20.0, 0.0, 0.0])
KINDS = {
    "filter": PERTURBED,
    "none": [*PERTURBED, "filter.kind=none"],
    "noise": [
        *PERTURBED,
        "filter.kind=limited",
        "vehicles=3",
        "sensing.position_noise_m=0.5",
        "latency_s=0.1",
    ],
    "aircraft": [*PERTURBED, "plant=jsbsim", "lookahead_m=10", "duration_s=0.2"],
    "alone": [*PERTURBED, "vehicles=1"],
}


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "aircraft"])  # a dozen of resets
def test_gymnasium_finds_nothing_wrong(kind: str) -> None:
    with warnings.catch_warnings():
        # Recommendations of the checker: action spaces of -1 to 1, bounded observations, a registered name.
        warnings.simplefilter("ignore", UserWarning)
        check_env(EgoEnvironment("paper-2-turn", KINDS[kind], force=True))


@pytest.mark.parametrize("kind", KINDS)
def test_pettingzoo_finds_nothing_wrong(kind: str, recwarn: pytest.WarningsRecorder) -> None:
    parallel_api_test(FleetEnvironment("paper-2-turn", KINDS[kind], force=True), num_cycles=60)
    assert not [str(w.message) for w in recwarn]


def test_agents_that_lose_ds_leave_one_by_one_and_pettingzoo_finds_nothing_wrong() -> None:
    parallel_api_test(FleetEnvironment("paper-2-turn", [*NEAR, "vehicles=3"], filtered=False, force=True), 60)


def test_an_episode_is_the_session_with_these_commands() -> None:
    s = testbed.load_scenario("paper-2-turn", PERTURBED)
    env, session = EgoEnvironment(s, ego=2, filtered=True), testbed.assemble(s)
    seen, _ = env.reset()
    step, rng = session.reset(), np.random.default_rng(0)
    done = False
    while not done:
        assert seen[0] == step.rates.v[1] and seen[1] == step.rates.omega[1]
        action = rng.uniform(env.action_space.low, env.action_space.high)  # type: ignore[attr-defined]
        seen, _, terminated, truncated, info = env.step(action)
        step = session.step(Command.of(np.stack([0 * action, action])), of=np.array([False, True]))
        done = terminated or truncated
        assert info["t_s"] == step.t and truncated == step.done and not terminated
    assert env.judge().vehicles.equals(session.judge().vehicles)


def test_names_say_what_is_observed_and_it_is_so() -> None:
    """Vehicle 1 flies north at (10, 20, 5); vehicle 3 is 30 m east, flies west, 4 m below."""
    state = State([10.0, 0.0, 40.0], [20.0, 0.0, 20.0], [np.pi / 2, 0.0, np.pi], [5.0, 0.0, 1.0])
    rates = Command([15.0, 10.0, 12.0], [0.1, 0.0, -0.2], [0.5, 0.0, -1.0])
    goal = np.array([[10.0, 120.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    said = dict(zip(names(1, 3), observe(View(state, rates), 0, goal), strict=True))
    expected = {
        "v_mps": 15.0,
        "omega_radps": 0.1,
        "zeta_mps": 0.5,
        "goal_ahead_m": 100.0,
        "goal_left_m": 0.0,
        "goal_up_m": -5.0,
        "3_known": 1.0,
        "3_ahead_m": 0.0,
        "3_left_m": -30.0,
        "3_up_m": -4.0,
        "3_v_ahead_mps": -15.0,
        "3_v_left_mps": 12.0,
        "3_v_up_mps": -1.5,
        "3_omega_radps": -0.2,
    }
    assert {name: said[name] for name in expected} == pytest.approx(expected, abs=1e-12)
    assert [name for name in said if name.startswith("1_")] == [] and len(said) == 6 + 2 * 8


def test_observations_do_not_change_when_the_world_is_turned_and_moved() -> None:
    rng = np.random.default_rng(3)
    n, turn, shift = 4, 1.1, np.array([100.0, -40.0, 3.0])
    place, goal = rng.normal(0, 50, (2, n, 3))
    theta, rates = rng.uniform(-3, 3, n), Command(*rng.uniform(10, 20, (3, n)))
    c, s = np.cos(turn), np.sin(turn)
    turned = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    moved, there = place @ turned + shift, goal @ turned + shift
    for k in range(n):
        here = observe(View(State(*place[:, :2].T, theta, place[:, 2]), rates), k, goal)
        gone = observe(View(State(*moved[:, :2].T, theta + turn, moved[:, 2]), rates), k, there)
        assert here == pytest.approx(gone, abs=1e-9)


def test_each_vehicle_observes_its_own_version_of_the_world() -> None:
    env = FleetEnvironment("paper-2-turn", [*PERTURBED, "sensing.position_noise_m=5"], force=True)
    seen, _ = env.reset()
    ahead = [
        seen[a][env.names[a].index(f"{other}_ahead_m")] for a, other in (("vehicle_1", 2), ("vehicle_2", 1))
    ]
    assert ahead[0] != ahead[1] and min(ahead) > 150.0


def test_a_seed_is_the_scenarios_and_later_episodes_are_drawn_from_it() -> None:
    def starts(env: EgoEnvironment, *seeds: int | None) -> list[tuple[int, float]]:
        return [(int(info["seed"]), float(seen[7])) for seen, info in (env.reset(seed=k) for k in seeds)]

    env = EgoEnvironment("paper-2-turn", [*PERTURBED, "seed=5"])
    first = starts(env, None, None, None)
    assert first[0][0] == 5 and len(set(first)) == 3
    again = starts(env, 5, None, None, 7)
    assert again[:3] == first and again[3][0] == 7
    fleet = FleetEnvironment("paper-2-turn", [*PERTURBED, "seed=5"])
    assert [fleet.reset()[1]["vehicle_1"]["seed"] for _ in range(3)] == [seed for seed, _ in first]
    run = testbed.run(testbed.load_scenario("paper-2-turn", [*PERTURBED, "seed=7"]))
    assert (
        run.vehicles.theta_rad[0]
        != testbed.run(env_scenario := testbed.load_scenario("paper-2-turn", PERTURBED)).vehicles.theta_rad[0]
    )
    assert env_scenario.seed == 1


def test_the_end_is_truncation_and_a_loss_is_termination() -> None:
    env = EgoEnvironment("paper-2-turn", NEAR, filtered=False, force=True)
    env.reset()
    steps = 0
    while True:
        _, reward, terminated, truncated, info = env.step(STRAIGHT)
        steps += 1
        if terminated or truncated:
            break
    # The goal is near, so the other flies as slowly as it may: 19 m at 20 m/s + v_min.
    expected = int(np.ceil(19.0 / (20.0 + env.action_space.low[0]) / 0.05))  # type: ignore[attr-defined]
    assert (terminated, truncated, steps) == (True, False, expected)
    assert info["distance_m"] < 5.0 and reward < -90.0
    on = EgoEnvironment("paper-2-turn", NEAR, filtered=False, force=True, end_at_loss=False)
    on.reset()
    ends = [on.step(STRAIGHT)[2:4] for _ in range(20)]
    assert ends == [(False, False)] * 19 + [(False, True)]
    run = on.judge()
    assert run.manifest["ended_early"] is None and run.guarantee("separation")["verdict"] != "holds"


def test_the_filter_alters_what_is_asked_for() -> None:
    env = EgoEnvironment("paper-2-turn", [*BRIEF, "start.radius_m=40"])
    env.reset()
    infos = [env.step(STRAIGHT)[4] for _ in range(20)]
    assert any(info["override"] for info in infos)
    assert any(abs(info["command"][1]) > 0.01 for info in infos)


def test_a_fault_terminates_and_is_named() -> None:
    class Falling:
        def __init__(self, s: Any, wind: Any) -> None:
            from aircraft.kinematic import KinematicFleet

            self.fleet, self.steps = KinematicFleet(s.vehicles, s.rates.fdm_dt_s), 0
            self.dt = self.fleet.dt
            for name in ("reset", "state", "achieved", "telemetry"):
                setattr(self, name, getattr(self.fleet, name))

        def step(self, command: Any, wind: Any, n: int) -> Any:
            self.steps += 1
            return self.fleet.step(command, wind, n)

        def faults(self) -> list[str]:
            return ["", "wing lost"] if self.steps > 3 else ["", ""]

    fleet = FleetEnvironment("paper-2-turn", PERTURBED, parts=testbed.Parts(plant=Falling))
    fleet.reset()
    for _ in range(4):
        _, _, terminated, truncated, infos = fleet.step(dict.fromkeys(fleet.agents, STRAIGHT))
    assert terminated == dict.fromkeys(fleet.possible_agents, True) and not any(truncated.values())
    assert fleet.agents == [] and infos["vehicle_1"]["fault"].startswith("vehicle 2: wing lost")
    with pytest.raises(RuntimeError, match=r"no agent takes part: reset\(\) starts an episode"):
        fleet.step({})


def test_a_vehicle_whose_agent_is_done_flies_on_by_its_guidance() -> None:
    """Vehicles 1 and 2 lose Ds at once; the third is 300 m away and its episode goes on."""
    places = "places=[" + ", ".join(
        f"{{x_m={x}, y_m={y}, course_deg=0, goal_x_m=900, goal_y_m={y}}}"
        for x, y in ((0, 0), (0, 4), (0, 300))
    )
    env = FleetEnvironment(
        "paper-2-turn", [*BRIEF, "start.pattern=list", places + "]", "vehicles=3"], filtered=False, force=True
    )
    env.reset()
    _, rewards, terminated, _, _ = env.step(dict.fromkeys(env.agents, STRAIGHT))
    assert terminated == {"vehicle_1": True, "vehicle_2": True, "vehicle_3": False}
    assert env.agents == ["vehicle_3"] and rewards["vehicle_3"] == pytest.approx(1.0, abs=0.01)
    while env.agents:
        env.step({"vehicle_3": STRAIGHT})
    table = env.judge().vehicles
    wanted = table[(table.vehicle == 1) & (table.t_s == 0.5)]
    assert float(wanted.v_nominal_mps.iloc[0]) != 20.0  # its goal is 900 m away: guidance wants more


def test_the_default_reward_is_progress_less_a_hundred_at_a_loss() -> None:
    seen: list[Transition] = []
    env = EgoEnvironment("paper-2-turn", PERTURBED, reward=lambda t: seen.append(t) or progress(t))  # type: ignore[func-returns-value]
    env.reset(seed=2)
    _, reward, *_ = env.step(STRAIGHT)
    assert reward == pytest.approx(1.0, abs=0.02)  # 20 m/s towards the goal for 0.05 s, some degrees off
    assert progress(replace(seen[0], distance_m=4.9)) == pytest.approx(reward - 100.0)
    assert progress(replace(seen[0], distance_m=5.0)) == reward


def test_a_reward_of_ones_own_is_handed_the_transition() -> None:
    seen: list[Transition] = []

    def reward(t: Transition) -> float:
        seen.append(t)
        return float(t.after.decision.command.omega[t.vehicle])  # type: ignore[union-attr]

    env = EgoEnvironment("paper-2-turn", PERTURBED, ego=2, reward=reward)
    env.reset()
    _, value, *_ = env.step(np.array([15.0, 0.05, 0.0]))
    assert value == pytest.approx(0.05) and seen[0].vehicle == 1
    assert (seen[0].before.t, seen[0].after.t) == pytest.approx((0.0, 0.05))
    assert seen[0].distance_m == pytest.approx(198, abs=1.0) and seen[0].d_safe_m == 5.0


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), None, "1", [1.0], 1j])
def test_a_reward_that_is_no_finite_number_is_refused(bad: Any) -> None:
    env = EgoEnvironment("paper-2-turn", PERTURBED, ego=2, reward=lambda t: bad)
    env.reset()
    with pytest.raises(
        UserError, match=r"reward <lambda>: it returned .* for vehicle 2 at 0.050 s; return a finite"
    ):
        env.step(STRAIGHT)


@pytest.mark.parametrize("good", [1, np.float32(0.5), np.int64(3), True])
def test_any_finite_number_is_a_reward(good: Any) -> None:
    env = EgoEnvironment("paper-2-turn", PERTURBED, reward=lambda t: good)
    env.reset()
    assert env.step(STRAIGHT)[1] == float(good)


@pytest.mark.parametrize(
    "bad", [np.zeros(2), np.zeros((1, 3)), 1.0, [20.0, np.nan, 0.0], [np.inf, 0.0, 0.0], "abc", None]
)
def test_an_action_that_is_none_is_refused_and_the_episode_goes_on(bad: Any) -> None:
    env = EgoEnvironment("paper-2-turn", PERTURBED)
    env.reset()
    with pytest.raises(ValueError, match="action of vehicle 1: give three finite numbers, ground speed"):
        env.step(bad)
    assert env.step([20, 0, 0])[4]["t_s"] == pytest.approx(0.05)  # type: ignore[arg-type]


def test_an_action_beyond_the_limits_is_flown_at_them() -> None:
    env = EgoEnvironment("paper-2-turn", PERTURBED, filtered=False)
    env.reset()
    info = env.step(np.array([99.0, -9.0, 0.1]))[4]
    low, high = env.action_space.low, env.action_space.high  # type: ignore[attr-defined]
    assert info["command"] == pytest.approx([high[0], low[1], 0.1])


MISTAKES: dict[str, tuple[dict[str, Any], str]] = {
    "ego 0": ({"ego": 0}, "ego 0: the scenario's vehicles are numbered 1 to 2"),
    "ego 3": ({"ego": 3}, "ego 3: the scenario's vehicles are numbered 1 to 2"),
    "ego half": ({"ego": 1.5}, "ego 1.5: the scenario's"),
    "ego yes": ({"ego": True}, "ego True: the scenario's"),
    "reward": ({"reward": 1.0}, "reward: give a function of a Transition, not 1.0"),
    "scenario": ({"scenario": "paper-2-trun"}, "did you mean paper-2-turn"),
    "override": ({"overrides": ["d_saef_m=3"]}, "d_safe_m"),
    "given": (
        {"scenario": testbed.load_scenario("paper-2-turn"), "overrides": ["d_safe_m=3"]},
        "overrides: they change a scenario that is read",
    ),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_one_line(name: str) -> None:
    given, said = MISTAKES[name]
    with pytest.raises(UserError) as error:
        EgoEnvironment(**({"scenario": "paper-2-turn"} | given))
    assert said in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("seed", [-1, 1.5, "1", True, 2**64])
def test_a_seed_that_is_none_is_refused(seed: Any) -> None:
    with pytest.raises(ValueError, match="give a whole number, 0 to"):
        FleetEnvironment("paper-2-turn", PERTURBED).reset(seed=seed)


def test_what_cannot_start_is_said_at_reset() -> None:
    with pytest.raises(UserError, match="outside the safe set"):
        EgoEnvironment("paper-2-turn", [*BRIEF, "start.radius_m=3"]).reset()
    with pytest.raises(UserError, match="duration_s: 0 s leaves nothing to fly"):
        EgoEnvironment("paper-2-turn", [*BRIEF, "duration_s=0"]).reset()
    none = testbed.Parts(filter=lambda s, barrier, goal: 3)
    with pytest.raises(UserError, match="filter"):
        EgoEnvironment("paper-2-turn", PERTURBED, parts=none).reset()
    env = EgoEnvironment("paper-2-turn", PERTURBED)
    for use in (env.judge, lambda: env.step(STRAIGHT)):
        with pytest.raises(RuntimeError, match=r"reset\(\) starts one"):
            use()
    env.close()


def test_an_agent_without_an_action_is_named() -> None:
    fleet = FleetEnvironment("paper-2-turn", PERTURBED)
    fleet.reset()
    with pytest.raises(
        ValueError, match="actions: none for vehicle_2; give one for each of vehicle_1, vehicle_2"
    ):
        fleet.step({"vehicle_1": STRAIGHT})


@pytest.mark.parametrize(("module", "package"), [("ego", "gymnasium"), ("fleet", "pettingzoo")])
def test_without_the_extra_one_line_says_what_to_install(
    module: str, package: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = extra.find_spec
    monkeypatch.setattr(extra, "find_spec", lambda name: None if name == package else found(name))
    monkeypatch.delitem(sys.modules, f"testbed.gym.{module}")
    with pytest.raises(UserError) as error:
        __import__(f"testbed.gym.{module}")
    assert str(error.value) == (
        f"testbed.gym: {package} is not installed; pip install 'cbf-jsbsim-testbed[gym]'"
    )


@pytest.mark.parametrize(
    "known", [[True, False, True], [[True, False, True], [True, True, True], [True, True, True]]]
)
def test_one_that_is_not_known_is_observed_as_zeros(known: Any) -> None:
    state = State([0.0, 3.0, 100.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    rates = Command([15.0, 10.0, 12.0], [0.1, 0.2, 0.3], [0.5, 0.0, -1.0])
    view = View(state, rates, np.array(known))
    seen = dict(zip(names(1, 3), observe(view, 0, np.zeros((3, 3))), strict=True))
    assert all(value == 0.0 for name, value in seen.items() if name.startswith("2_"))
    assert (seen["3_known"], seen["3_ahead_m"], seen["3_omega_radps"]) == (1.0, 100.0, 0.3)


class Leaving:
    """Everybody sees the truth; after 0.2 s the second vehicle has left."""

    def __init__(self, s: Any, rngs: Any) -> None:
        pass

    def wind(self, t: float, state: State) -> None:
        return None

    def observe(self, t: float, truth: State, rates: Command) -> View:
        return View(truth, rates, np.array([True, t < 0.19]))


def test_who_has_left_is_terminated_and_its_agent_does_not_come_back() -> None:
    parts = testbed.Parts(disturbance=Leaving)
    fleet = FleetEnvironment("paper-2-turn", PERTURBED, parts=parts)
    fleet.reset()
    ends = [fleet.step(dict.fromkeys(fleet.agents, STRAIGHT)) for _ in range(20)]
    assert [terminated for _, _, terminated, _, _ in ends][3] == {"vehicle_1": False, "vehicle_2": True}
    assert all(list(seen) == ["vehicle_1"] for seen, *_ in ends[4:])
    assert ends[4][4]["vehicle_1"]["distance_m"] == float("inf")
    assert ends[4][0]["vehicle_1"][fleet.names["vehicle_1"].index("2_known")] == 0.0
    parallel_api_test(FleetEnvironment("paper-2-turn", PERTURBED, parts=parts), 60)
    ego = EgoEnvironment("paper-2-turn", PERTURBED, parts=parts, ego=2)
    ego.reset()
    assert [ego.step(STRAIGHT)[2] for _ in range(4)] == [False, False, False, True]


def test_who_has_left_is_no_longer_near() -> None:
    state = State([0.0, 3.0, 100.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    assert distance(state, 0, np.array([True, True, True])) == pytest.approx(3.0)
    assert distance(state, 0, np.array([True, False, True])) == pytest.approx(100.0)
    assert distance(state, 1, np.array([True, False, True])) == float("inf")
    assert distance(state, 0, np.array([True, False, False])) == float("inf")
