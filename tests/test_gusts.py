"""Gusts: a Dryden field in space, the same for whoever flies through it. Wind: what the numbers say."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from filters.model import State
from testbed.components.initial_conditions import generators
from testbed.environment import gusts
from testbed.environment.wind import SteadyWind
from testbed.scenario.scenario import load

SIGMA, LENGTH = 1.5, 300.0
STILL = np.zeros(3)


def ensemble(points: np.ndarray, draws: int, t: float = 0.0) -> np.ndarray:
    """Gusts (draws, N, 3) of as many fields at the same `points` (N, 3)."""
    rng = np.random.default_rng(7)
    return np.stack([gusts.draw(rng, SIGMA, LENGTH, STILL)(t, points) for _ in range(draws)])


@pytest.mark.slow
def test_correlations_along_and_across_a_line_are_drydens() -> None:
    r = LENGTH * np.array([0.0, 0.02, 0.1, 0.3, 1.0, 2.0, 3.5])
    along = np.array([2.0, -1.0, 2.0]) / 3.0  # no axis of ours: the field is isotropic
    across = np.array([1.0, 2.0, 0.0]) / np.sqrt(5.0)
    u = ensemble(np.array([10.0, -40.0, 5.0]) + r[:, None] * along, 3000) / SIGMA
    f, g = np.exp(-r / LENGTH), (1 - r / (2 * LENGTH)) * np.exp(-r / LENGTH)
    for direction, exact in ((along, f), (across, g)):
        v = u @ direction
        products = v[:, :1] * v
        error = products.std(axis=0) / np.sqrt(len(v))
        # Four standard errors, 0.1 at most, at each of 14 points: 1 in 1100 by chance, and the seed is fixed.
        assert np.all(np.abs(products.mean(axis=0) - exact) < 4 * error)
    mixed = (u[:, 0] @ along) * (u[:, 4] @ across)
    assert abs(mixed.mean()) < 4 * mixed.std() / np.sqrt(len(mixed))


@pytest.mark.slow
def test_every_component_has_the_variance_asked_for_and_no_mean() -> None:
    u = ensemble(np.zeros((1, 3)), 4000)[:, 0]
    assert np.all(np.abs(u.mean(axis=0)) < 4 * SIGMA / np.sqrt(4000))
    assert np.all(np.abs(u.var(axis=0) / SIGMA**2 - 1) < 4 * np.sqrt(2 / 4000))  # healthy 2 %, bound 9 %
    covariance = np.cov(u.T) / SIGMA**2
    assert np.all(np.abs(covariance[~np.eye(3, dtype=bool)]) < 4 / np.sqrt(4000))


def test_the_energy_spectrum_is_drydens() -> None:
    """What the strata hold, against the quadrature of E(k); and E against the longitudinal spectrum."""
    kl = np.array([0.1, 0.5, 1.0, 2.0, 10.0, 100.0])
    x = np.geomspace(1e-4, 1e6, 400_001)
    e = 8 / np.pi * x**4 / (1 + x**2) ** 3
    assert np.trapezoid(e, x) == pytest.approx(1.5, rel=1e-5)
    for limit in kl:
        outside = np.trapezoid(e[x >= limit], x[x >= limit]) / 1.5
        assert gusts.energy_above(limit) == pytest.approx(outside, rel=1e-4, abs=2e-6)
    assert gusts.wave_number(gusts.energy_above(kl)) == pytest.approx(kl, rel=1e-9)
    # Batchelor's relation between E and the spectrum along a line, E11 = integral of E/k (1 - k1^2/k^2).
    for k1 in (0.2, 1.0, 5.0):
        tail = x >= k1
        along = np.trapezoid(e[tail] / x[tail] * (1 - (k1 / x[tail]) ** 2), x[tail])
        assert along == pytest.approx(2 / np.pi / (1 + k1**2), rel=1e-3)


@pytest.mark.slow
def test_spectra_along_a_flown_line_are_drydens() -> None:
    step, n, draws = 6.0, 1024, 60
    line = np.zeros((n, 3))
    line[:, 1] = step * np.arange(n)
    u = ensemble(line, draws)
    window = np.hanning(n)
    power = 2 * step / (2 * np.pi * np.sum(window**2)) * np.abs(np.fft.rfft(u * window[:, None], axis=1)) ** 2
    k = 2 * np.pi * np.fft.rfftfreq(n, step)
    x = (k * LENGTH) ** 2
    longitudinal = 2 * SIGMA**2 * LENGTH / np.pi / (1 + x)
    lateral = SIGMA**2 * LENGTH / np.pi * (1 + 3 * x) / (1 + x) ** 2
    edges = np.geomspace(2 / LENGTH, 60 / LENGTH, 7)
    for low, high in pairwise(edges):
        band = (k >= low) & (k < high)
        for component, exact in ((1, longitudinal), (0, lateral), (2, lateral)):
            drawn = power[:, band, component].sum(axis=1) / exact[band].sum()
            # Fields differ by 30 to 60 %; the mean of 60 by 4 to 8 %.
            assert abs(drawn.mean() - 1) < 4 * drawn.std() / np.sqrt(draws)
            assert drawn.std() / np.sqrt(draws) < 0.12


@pytest.mark.parametrize("fields", [1, 2])
def test_gusts_are_free_of_divergence(fields: int) -> None:
    field = gusts.draw(np.random.default_rng(1), SIGMA, LENGTH, STILL, fields)
    # Each mode is square to its wave vector, to rounding.
    for amplitude in (field.cosine, field.sine):
        dot = np.sum(field.k * amplitude, axis=-1)
        size = np.linalg.norm(field.k, axis=-1) * np.linalg.norm(amplitude, axis=-1)
        assert np.all(np.abs(dot) <= 1e-14 * size)
    # And by differences, in the field smoothed to wave numbers that 1 m resolves.
    smooth = np.linalg.norm(field.k, axis=-1)[..., None] < 0.05
    field = gusts.GustField(field.k, field.cosine * smooth, field.sine * smooth, STILL)
    at = np.tile([30.0, -20.0, 7.0], (fields, 1))
    gradient = np.stack([field(0.0, at + e / 2) - field(0.0, at - e / 2) for e in np.eye(3)], axis=-1)
    divergence = np.trace(gradient, axis1=1, axis2=2)
    assert np.all(np.abs(divergence) < 1e-3 * np.abs(gradient).max())  # healthy 2e-5, gradients 1


def test_the_frozen_field_is_carried_by_the_wind() -> None:
    wind = np.array([6.0, -3.0, 0.5])
    field = gusts.draw(np.random.default_rng(3), SIGMA, LENGTH, wind)
    at = np.array([[0.0, 0.0, 0.0], [50.0, -80.0, 10.0]])
    assert np.allclose(field(4.0, at + 4.0 * wind), field(0.0, at), atol=1e-8)
    assert not np.allclose(field(4.0, at), field(0.0, at), atol=1e-2)


def test_neighbours_share_gusts_unless_these_are_independent() -> None:
    near = np.array([[0.0, 0.0, 0.0], [0.0, 5.0, 0.0]])
    rng = np.random.default_rng(2)
    shared = np.stack([gusts.draw(rng, 1.0, LENGTH, STILL)(0.0, near) for _ in range(400)])
    apart = np.stack([gusts.draw(rng, 1.0, LENGTH, STILL, 2)(0.0, near) for _ in range(400)])
    for component in range(3):
        together = np.corrcoef(shared[:, 0, component], shared[:, 1, component])[0, 1]
        alone = np.corrcoef(apart[:, 0, component], apart[:, 1, component])[0, 1]
        assert together > 0.96  # exact: 0.983 along, 0.975 across
        assert abs(alone) < 4 / np.sqrt(400)


def test_the_first_of_many_fields_is_the_field_of_one_and_numbers_do_not_depend_on_the_sizes() -> None:
    at = np.array([[20.0, 30.0, 1.0], [0.0, 0.0, 0.0]])
    one = gusts.draw(np.random.default_rng(5), 1.0, LENGTH, STILL)
    two = gusts.draw(np.random.default_rng(5), 1.0, LENGTH, STILL, 2)
    scaled = gusts.draw(np.random.default_rng(5), 3.0, 2 * LENGTH, STILL)
    assert np.allclose(one(0.0, at)[0], two(0.0, at)[0], atol=1e-12)
    assert np.allclose(3.0 * one(0.0, at), scaled(0.0, 2 * at), atol=1e-12)


def test_at_300_m_the_milspec_is_isotropic_to_two_per_cent() -> None:
    # MIL-F-8785C, 3.7.3.4: sigma_u over sigma_w, and L_u where L_w is the height, 300 m.
    ratio = 0.177 + 0.823 * 300.0 / 304.8
    assert ratio**-0.4 == pytest.approx(1.0052, abs=1e-4)
    assert 300.0 * ratio**-1.2 == pytest.approx(304.7, abs=0.1)
    sigmas = [gusts.SIGMA_MPS[name] for name in ("none", "light", "moderate", "severe")]
    assert sigmas == pytest.approx([0.0, 0.7717, 1.5433, 2.315], abs=1e-4)


def test_gusts_are_the_streams_own_whatever_else_a_scenario_draws() -> None:
    a, b = (generators(4)["gust"] for _ in range(2))
    at = np.zeros((1, 3))
    assert np.array_equal(gusts.draw(a, 1, 300, STILL)(1.0, at), gusts.draw(b, 1, 300, STILL)(1.0, at))
    assert not np.allclose(
        gusts.draw(generators(5)["gust"], 1, 300, STILL)(1.0, at),
        gusts.draw(generators(4)["gust"], 1, 300, STILL)(1.0, at),
    )


def test_wind_blows_towards_its_direction_and_shears_with_height() -> None:
    z = np.array([0.0, 300.0, -150.0, -400.0])
    plain = SteadyWind(8.0, np.pi / 2, 0.5)(z)
    assert np.allclose(plain, [0.0, 8.0, 0.5])
    power = SteadyWind(8.0, 0.0, exponent=0.2)(z)
    assert power[:, 0] == pytest.approx([8.0, 8.0 * 2**0.2, 8.0 * 0.5**0.2, 0.0])
    linear = SteadyWind(8.0, np.pi, 0.5, gradient=0.02)(z)
    assert linear[:, 0] == pytest.approx([-8.0, -14.0, -5.0, 0.0])
    assert np.allclose(linear[:, 2], 0.5)


def test_a_scenarios_wind_is_the_steady_wind_and_the_gusts() -> None:
    from testbed.environment.environment import build

    state = State([0.0, 40.0], [0.0, 10.0], [0.0, 1.0], [0.0, 50.0])
    settings = ["wind.speed_mps=7", "wind.towards_deg=30", "shear_exponent=0.1", "intensity=light"]
    plain, sheared, gusty = (
        build(load("paper-2-turn", settings[:count]), generators(1)).wind(2.0, state) for count in (2, 3, 4)
    )
    assert np.allclose(plain, 7 * np.array([np.cos(np.pi / 6), 0.5, 0.0]))
    assert np.allclose(sheared[:, 0] / plain[:, 0], [1.0, (350 / 300) ** 0.1])
    assert 0.0 < np.abs(gusty - sheared).max() < 5 * gusts.SIGMA_MPS["light"]
    calm = build(load("paper-2-turn"), generators(1))
    assert calm.wind(0.0, state) is None
