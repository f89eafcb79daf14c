"""What vehicles know of each other: measured with errors, late, or not at all."""

from __future__ import annotations

import numpy as np
import pytest

from filters.model import Command, State, View, step
from testbed.components.initial_conditions import generators
from testbed.environment.environment import Surroundings, build
from testbed.environment.network import Network
from testbed.environment.sensing import QUANTITIES, Sensing, pack
from testbed.errors import UserError
from testbed.scenario.scenario import load

DT = 0.05


def moving(t: float, n: int = 3, omega: float = 0.2) -> View:
    """N vehicles on arcs (straight if omega is 0) at constant rates, exactly."""
    start = State(np.arange(n) * 30.0, -np.arange(n) * 7.0, np.arange(n) * 0.9, np.arange(n) * 2.0)
    rates = Command(18.0 + np.arange(n), omega * (1 + np.arange(n)), np.linspace(-1, 1, n))
    return View(step(start, rates, t), rates)


def network(n: int = 3, seed: int = 1, **settings: object) -> Network:
    defaults = {"delay": 0.0, "latency": 0.0, "loss": 0.0, "stale": "hold", "central": False}
    return Network(n, DT, rng=np.random.default_rng(seed), **(defaults | settings))  # type: ignore[arg-type]


def sensing(
    seed: int = 1, n: int = 4, everyone: bool = False, persistence: float = 0.9, **sizes: float
) -> Sensing:
    sigmas = [np.full(len(QUANTITIES), sizes.get(name, 0.0)) for name in ("noise", "drift", "bias")]
    return Sensing(*sigmas, persistence, everyone, n, np.random.default_rng(seed))


def errors(measure: Sensing, steps: int) -> np.ndarray:
    truth = moving(0.0, measure.vehicles)
    return np.stack([pack(measure(truth)) - pack(truth) for _ in range(steps)])


# -- latency


@pytest.mark.parametrize("steps", [1.0, 4.0, 2.5, 0.3])
@pytest.mark.parametrize("central", [True, False])
def test_a_vehicle_flying_straight_is_seen_speed_times_latency_behind(steps: float, central: bool) -> None:
    late = network(latency=steps * DT, central=central)
    for k in range(12):
        truth = moving(k * DT, omega=0.0)
        seen = late(truth)
        assert seen.shared == central
        behind = np.hypot(truth.state.x - seen.state.x, truth.state.y - seen.state.y)
        exact = np.broadcast_to(truth.rates.v * steps * DT, behind.shape).copy()
        if not central:
            np.fill_diagonal(exact, 0.0)
        assert np.allclose(behind, exact, atol=1e-11)
        climbed = np.broadcast_to(truth.rates.zeta * steps * DT, behind.shape)
        assert np.allclose((truth.state.z - seen.state.z)[exact > 0], climbed[exact > 0], atol=1e-12)


def test_whole_steps_of_latency_repeat_what_was_measured_bit_by_bit() -> None:
    late = network(latency=3 * DT, central=True)
    path = [moving(k * DT) for k in range(10)]
    seen = [late(view) for view in path]
    for k in range(3, 10):
        assert np.array_equal(pack(seen[k]), pack(path[k - 3]))


def test_latency_counts_on_top_of_the_delay_that_a_vehicle_has_of_itself() -> None:
    late = network(delay=2 * DT, latency=3 * DT)
    path = [moving(k * DT) for k in range(10)]
    seen = [late(view) for view in path][-1]
    assert np.array_equal(pack(seen.own()), pack(path[7]))
    assert np.array_equal(pack(seen)[0, 1:], pack(path[4])[1:])
    both = network(delay=2 * DT)
    assert [both(view) for view in path][-1].shared


# -- loss


def test_packets_are_lost_at_the_rate_asked_for_on_every_link() -> None:
    n, steps, loss = 5, 2000, 0.3
    lossy, last, lost = network(n, loss=loss), None, np.zeros((n, n))
    for k in range(steps):
        seen = lossy(moving(k * DT, n)).state.x
        lost += 0.0 if last is None else seen == last
        last = seen
    links = ~np.eye(n, dtype=bool)
    assert not lost[~links].any()
    assert np.all(np.abs(lost[links] / (steps - 1) - loss) < 4 * np.sqrt(loss * (1 - loss) / steps))
    share, size = lost[links].mean() / (steps - 1), steps * links.sum()
    assert abs(share - loss) < 4 * np.sqrt(loss * (1 - loss) / size)
    assert len(set(lost[links])) > n  # links fail each for itself


def test_hold_keeps_the_last_state_heard_and_extrapolation_is_exact_at_constant_rates() -> None:
    hold, carry = network(loss=0.7), network(loss=0.7, stale="extrapolate-lost")
    oldest = 0.0
    for k in range(60):
        truth = moving(k * DT)
        held, carried = hold(truth), carry(truth)
        assert np.allclose(pack(carried), pack(truth), atol=1e-10)
        age = (truth.state.z - held.state.z)[:, 0] / truth.rates.zeta[0]
        assert np.allclose(pack(held)[:, 0], [pack(moving(k * DT - a))[0] for a in age], atol=1e-9)
        assert np.allclose(age / DT, np.round(age / DT), atol=1e-9)
        oldest = max(oldest, age.max())
    assert oldest > 2 * DT


def test_what_extrapolation_carries_over() -> None:
    settings = {"delay": DT, "latency": 3 * DT, "loss": 0.5}
    lost = network(**settings, stale="extrapolate-lost")
    age = network(**settings, stale="extrapolate")
    for k in range(40):
        truth = moving(k * DT)
        seen = pack(lost(truth))
        assert np.allclose(pack(age(truth)), pack(truth), atol=1e-10)
        assert np.allclose(seen[0, 1], pack(moving((k - 4) * DT))[1], atol=1e-10)
        assert np.allclose(seen[1, 1], pack(moving((k - 1) * DT))[1], atol=1e-10)


def test_losing_everything_leaves_the_start_and_greater_loss_loses_the_same_packets_and_more() -> None:
    never = network(loss=1.0)
    seen = [never(moving(k * DT)) for k in range(20)][-1]
    assert np.array_equal(pack(seen)[0, 1:], pack(moving(0.0))[1:])
    some, more = network(loss=0.2), network(loss=0.6)
    for k in range(200):
        truth = moving(k * DT)
        climbing = truth.rates.zeta != 0.0
        fewer, later = (
            (truth.state.z - seen(truth).state.z)[:, climbing] / truth.rates.zeta[climbing]
            for seen in (some, more)
        )
        assert np.all(later >= fewer - 1e-9)


# -- measurement


def test_noise_has_its_deviation_and_no_memory() -> None:
    e = errors(sensing(noise=2.0), 4000)
    assert np.all(np.abs(e.mean(axis=0)) < 4.5 * 2.0 / np.sqrt(4000))  # 28 means: 1 in 5000 by chance
    assert e.std() == pytest.approx(2.0, rel=0.02)  # standard error 0.2 %
    memory = np.mean(e[1:] * e[:-1]) / 4.0
    assert abs(memory) < 4 / np.sqrt(e.size)
    between = np.corrcoef(e.reshape(len(e), -1).T)
    assert np.abs(between[~np.eye(len(between), dtype=bool)]).max() < 5 / np.sqrt(4000)


def test_drift_is_gauss_markov_from_the_first_step_on() -> None:
    e = np.concatenate([errors(sensing(seed, drift=1.5, persistence=0.8), 60) for seed in range(150)], axis=1)
    count = e[0].size
    for k in (0, 30, 59):
        assert e[k].std() == pytest.approx(1.5, abs=4 * 1.5 / np.sqrt(2 * count))
    for lag in (1, 3, 8):
        # Standard error of a correlation, one pair per track: below 1 / sqrt(tracks).
        assert np.mean(e[20] * e[20 + lag]) / 1.5**2 == pytest.approx(0.8**lag, abs=4 * 1.3 / np.sqrt(count))


def test_bias_stays() -> None:
    e = errors(sensing(bias=3.0, n=400), 3)
    assert np.array_equal(e[0], e[2])
    assert e[0].std() == pytest.approx(3.0, abs=4 * 3.0 / np.sqrt(2 * e[0].size))


def test_broadcast_errors_are_everyones_and_sensors_err_each_for_itself() -> None:
    assert sensing(noise=1.0)(moving(0.0, 4)).shared
    e = np.stack([errors(sensing(seed, everyone=True, bias=1.0), 1)[0] for seed in range(300)])
    assert e.shape == (300, 4, 4, 7)
    one, other = e[:, 0, 2].ravel(), e[:, 1, 2].ravel()
    assert abs(np.corrcoef(one, other)[0, 1]) < 4 / np.sqrt(one.size)


def test_sizes_do_not_change_the_numbers_drawn() -> None:
    small, large = errors(sensing(noise=1.0), 5), errors(sensing(noise=2.0, drift=0.0), 5)
    assert np.allclose(2 * small, large, atol=1e-10)
    mixed = errors(sensing(noise=1.0, drift=1.0, bias=1.0), 5)
    parts = sum(errors(sensing(**{name: 1.0}), 5) for name in ("noise", "drift", "bias"))
    assert np.allclose(mixed, parts, atol=1e-10)


# -- in a scenario


def test_every_setting_reaches_its_quantity_in_si() -> None:
    cases = {
        "position": ("m", 1.0, ("x", "y", "z")),
        "course": ("deg", np.pi / 180, ("theta",)),
        "speed": ("mps", 1.0, ("v", "zeta")),
        "turn_rate": ("degps", np.pi / 180, ("omega",)),
    }
    truth = moving(0.0, 40)
    for name, (unit, factor, quantities) in cases.items():
        for kind in ("noise", "drift", "bias"):
            s = load("paper-2-turn", ["vehicles=40", f"{name}_{kind}_{unit}=0.5"])
            view = build(s, generators(1)).observe(0.0, truth.state, truth.rates)
            spread = (pack(view) - pack(truth)).std(axis=0)
            for column, quantity in enumerate(QUANTITIES):
                if quantity in quantities:
                    # Of 40 numbers: 11 %.
                    assert spread[column] == pytest.approx(0.5 * factor, rel=0.45), (name, kind, quantity)
                else:
                    assert spread[column] < 1e-10, (name, kind, quantity)


def test_without_disturbance_the_truth_itself_is_what_is_known() -> None:
    truth = moving(0.0)
    for calm in (Surroundings(), build(load("paper-2-turn"), generators(1))):
        view = calm.observe(0.0, truth.state, truth.rates)
        assert view.state is truth.state and view.rates is truth.rates
        assert calm.wind(0.0, truth.state) is None


@pytest.mark.parametrize(
    ("override", "line"),
    {
        "network.latency_s=-0.1": "network.latency_s: input should be greater than or equal to 0, got -0.1",
        "delay_s=-1": "sensing.delay_s: input should be greater than or equal to 0, got -1",
        "loss=1.01": "network.loss: input should be less than or equal to 1, got 1.01",
        "loss=-0.5": "network.loss: input should be greater than or equal to 0",
        "stale=guess": "network.stale: input should be 'hold', 'extrapolate-lost' or 'extrapolate'",
        "position_noise_m=-1": "sensing.position_noise_m: input should be greater than or equal to 0",
        "drift_time_s=0": "sensing.drift_time_s: input should be greater than 0",
        "sensing.source=radar": "sensing.source: input should be 'broadcast' or 'sensors'",
        "intensity=hurricane": "gusts.intensity: input should be 'none', 'light', 'moderate' or 'severe'",
        "gusts.sigma_mps=-1": "gusts.sigma_mps: input should be greater than or equal to 0",
        "wind.speed_mps=-3": "wind.speed_mps: input should be greater than or equal to 0",
        "wind.towards_deg=nan": "wind.towards_deg: input should be a finite number",
        "sensing.latency=1": "--set sensing.latency: unknown field; did you mean",
    }.items(),
)
def test_a_mistaken_setting_is_one_line(override: str, line: str) -> None:
    with pytest.raises(UserError) as error:
        load("paper-2-turn", [override])
    assert line in str(error.value)
    assert "\n" not in str(error.value)


def test_two_laws_of_shear_are_refused() -> None:
    with pytest.raises(UserError, match="wind: shear_exponent and shear_per_s are two laws of one thing"):
        load("paper-2-turn", ["shear_exponent=0.1", "shear_per_s=0.1"])
