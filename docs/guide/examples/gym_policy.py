"""A policy in the Gymnasium environment, without and with the filter: how many episodes lose Ds?

python docs/guide/examples/gym_policy.py
"""

import numpy as np

from testbed.gym.ego import EgoEnvironment

# Four vehicles that meet in the middle of a circle, from headings that differ by seed.
SCENARIO = ["vehicles=4", "start.radius_m=100", "duration_s=14", "heading_perturbation_deg=5"]
RATES = ["filter_dt_s=0.05", "record_dt_s=0.05", "manoeuvre_instants=0"]


def policy(seen: dict[str, float]) -> np.ndarray:
    """Fly to the goal at 20 m/s: the nearer it is to the left, the more turn to the left."""
    bearing = np.arctan2(seen["goal_left_m"], seen["goal_ahead_m"])
    return np.array([20.0, np.clip(0.5 * bearing, -0.2, 0.2), 0.1 * seen["goal_up_m"]])


def lost(env: EgoEnvironment, seeds: range) -> int:
    """How many episodes the ego lost Ds in."""
    count = 0
    for seed in seeds:
        observation, _ = env.reset(seed=seed)
        terminated = truncated = False
        while not (terminated or truncated):
            action = policy(dict(zip(env.names, observation, strict=True)))
            observation, _, terminated, truncated, _ = env.step(action)
        count += terminated
    return count


if __name__ == "__main__":
    for filtered in (False, True):
        env = EgoEnvironment("paper-2-turn", [*SCENARIO, *RATES], ego=2, filtered=filtered)
        print(f"filter {'on' if filtered else 'off'}: {lost(env, range(1, 11))} of 10 episodes lose Ds")
        env.close()
