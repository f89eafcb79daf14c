"""h and its answer to inputs by flying on: the closed forms' values, and the differences of its own."""

from __future__ import annotations

import numpy as np
import pytest

from filters.model import State
from testbed.components import catalogue
from testbed.components.initial_conditions import generators, places
from testbed.scenario.scenario import Scenario, load
from testbed.verification.future import Flown, Pose, barrier, fly_on, future
from testbed.verification.settings import start

KINDS = [
    [],
    ["barrier.smoothing_m2=30", "delta_m2=0"],
    ["barrier.form=squared"],
    ["sigma=[1.0, 1.2]"],
    ["omega_degps=-8"],
    ["barrier.kind=straight", "zeta_mps=[0.5, -0.5]"],
    ["barrier.kind=euclidean"],
]
I, J = np.array([0]), np.array([1])


def scattered(overrides: list[str], radius_m: float) -> Scenario:
    return load(
        "paper-2-turn",
        [*overrides, "heading_perturbation_deg=180", "height_perturbation_m=3", f"radius_m={radius_m}"],
    )


def pose_of(s: Scenario, seed: int) -> tuple[Pose, object]:
    state, _ = places(s, generators(seed)["start"])
    return Pose(state.position[None], state.theta[None]), state


def flown(s: Scenario, pose: Pose) -> Flown:
    made = fly_on(s.model_dump(mode="json"), pose, I, J)
    assert made is not None
    return made


@pytest.mark.parametrize("overrides", KINDS, ids=str)
@pytest.mark.parametrize("radius_m", [3, 20, 200])
def test_it_is_the_closed_form_within_its_own_error(overrides: list[str], radius_m: float) -> None:
    s = scattered(overrides, radius_m)
    for seed in range(1, 40):
        pose, state = pose_of(s, seed)
        own, due = flown(s, pose), catalogue.barrier(s).values(state)  # type: ignore[arg-type]
        lie = np.stack(due.lie(state))[:, 0]  # type: ignore[arg-type]
        # Healthy: a tenth of the error it states, and that is nothing beside what a verdict allows.
        assert abs(own.h[0, 0] - due.h[0]) <= 0.3 * own.off[0, 0]
        assert (np.abs(own.lie[:, :, 0, 0] - lie) <= 0.3 * own.lie_off[:, :, 0, 0]).all()
        assert own.off[0, 0] < 1e-6


@pytest.mark.parametrize("overrides", KINDS, ids=str)
def test_its_answer_to_inputs_is_that_of_its_own_differences(overrides: list[str]) -> None:
    s = scattered(overrides, 20)
    plain = s.model_dump(mode="json")
    made = future(plain, I, J)
    assert made is not None
    step = 1e-5
    for seed in range(1, 20):
        pose, _ = pose_of(s, seed)
        own = flown(s, pose)
        for side in range(2):
            for k in range(3):
                ends = []
                for sign in (1, -1):
                    position, theta = pose.position.copy(), pose.theta.copy()
                    ahead = [np.cos(theta[0, side]), np.sin(theta[0, side]), 0.0], [0.0] * 3, [0.0, 0.0, 1.0]
                    position[0, side] += sign * step * np.array(ahead[k])
                    theta[0, side] += sign * step * (k == 1)
                    h = barrier(plain, position, theta, I, J)
                    assert h is not None
                    ends.append(h[0, 0])
                # Central differences of numbers of some hundred metres.
                slope = (ends[0] - ends[1]) / (2 * step)
                assert own.lie[side, k, 0, 0] == pytest.approx(slope, rel=1e-4, abs=1e-4)


def test_at_the_kink_the_turn_answers_as_if_it_had_none() -> None:
    """Equal headings abreast: the harmonic is 0, and so is its share of the answer."""
    s = load("paper-2-turn", ["delta_m2=0"])
    pose = Pose(np.array([[[0.0, 0.0, 0.0], [0.0, 30.0, 0.0]]]), np.zeros((1, 2)))
    own = flown(s, pose)
    assert own.harmonic is not None and abs(own.harmonic[0, 0]) < 1e-9
    assert own.h[0, 0] == pytest.approx(25.0)
    assert np.allclose(own.lie[:, 0, 0, 0], 0.0, atol=1e-9)


MIXED = (
    "barrier.manoeuvres=[{v_mps=16, omega_degps=11.7}, {v_mps=21, omega_degps=23.4, zeta_mps=1},"
    " {v_mps=18, omega_degps=-11.7}, {v_mps=18, omega_degps=5.85}, {v_mps=20}]"
)


def test_different_manoeuvres_are_flown_as_the_general_construction_does() -> None:
    s = load("paper-2-turn", ["vehicles=5", "barrier.kind=rollout", MIXED])
    made, rng, n = catalogue.barrier(s), np.random.default_rng(2), 5
    position = np.stack([*rng.uniform(-150, 150, (2, 12, n)), rng.uniform(-20, 20, (12, n))], axis=-1)
    theta = rng.uniform(-4, 4, (12, n))
    own = fly_on(s.model_dump(mode="json"), Pose(position, theta), *np.triu_indices(n, 1))
    assert own is not None
    for k in range(12):
        state = State(*position[k, :, :2].T.copy(), theta[k], position[k, :, 2].copy())
        due = made.values(state)
        np.testing.assert_allclose(own.h[k], due.h, atol=1e-9)
        for side, lie in enumerate(due.lie(state)):
            assert (np.abs(own.lie[side, :, k] - lie.T) <= own.lie_off[side, :, k]).all()
    assert np.median(own.lie_off) < 1e-4


@pytest.mark.parametrize(
    "overrides",
    [
        [], ["round_decimals=2", "course_offset_deg=2"], ["vehicles=7", "heights_m=[1, 2]"],
        ["lateral_perturbation_m=5", "heading_perturbation_deg=9", "height_perturbation_m=2", "seed=7"],
        ["lateral_offsets_m=[1, -2]", "heading_offsets_deg=[3, 4]", "height_offsets_m=[0.5, 0]"],
    ],
    ids=str,
)  # fmt: skip
def test_the_start_is_the_scenarios(overrides: list[str]) -> None:
    s = load("paper-2-turn", overrides)
    state, _ = places(s, generators(s.seed)["start"])
    own = start(s.model_dump(mode="json"))
    assert np.allclose(own.position, state.position, rtol=0, atol=1e-10)
    assert np.allclose(own.theta, state.theta, rtol=0, atol=1e-12)
