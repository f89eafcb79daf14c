"""alpha(h): odd polynomials with coefficients that make them class K."""

from __future__ import annotations

import numpy as np
import pytest

from filters.barriers.class_k import OddPolynomial, cubic, linear


def test_linear_and_cubic_are_what_they_say():
    h = np.array([-3.0, 0.0, 2.0])
    np.testing.assert_allclose(linear(0.5)(h), 0.5 * h)
    np.testing.assert_allclose(cubic(0.1)(h), 0.1 * h**3, rtol=1e-15)
    assert cubic(0.1)(2.0) == pytest.approx(0.8)


def test_a_longer_polynomial_and_its_derivative():
    alpha = OddPolynomial((1.0, 0.0, 0.25))
    h = np.linspace(-4, 4, 41)
    np.testing.assert_allclose(alpha(h), h + 0.25 * h**5, rtol=1e-14)
    np.testing.assert_allclose(alpha.derivative(h), 1 + 1.25 * h**4, rtol=1e-14)


def test_alpha_is_odd_increasing_and_zero_at_zero():
    alpha = OddPolynomial((0.2, 0.1, 0.01))
    h = np.linspace(-10, 10, 201)
    np.testing.assert_array_equal(alpha(-h), -alpha(h))
    assert np.all(np.diff(alpha(h)) > 0)
    assert alpha(0.0) == 0.0
    assert np.all(alpha.derivative(h) >= 0)


@pytest.mark.parametrize(
    ("coefficients", "reason"),
    [
        ((0.0, -0.1), "must not be negative"),
        ((0.0, 0.0), "all zero"),
        ((), "list of coefficients"),
        ((float("nan"),), "finite"),
        ((1.0, float("inf")), "finite"),
        (((1.0, 2.0),), "list of coefficients"),
    ],
)
def test_coefficients_that_are_not_class_k_are_refused_with_the_reason(coefficients, reason):
    with pytest.raises(ValueError, match=reason):
        OddPolynomial(coefficients)


def test_equal_alphas_compare_equal():
    assert cubic(0.1) == OddPolynomial((0, 0.1))


def test_coefficients_are_kept_as_a_tuple_of_floats_whatever_they_came_as():
    for coefficients in ([0, 1], np.array([0, 1]), (False, True)):
        kept = OddPolynomial(coefficients).coefficients
        assert kept == (0.0, 1.0) and isinstance(kept, tuple) and {type(c) for c in kept} == {float}
    assert hash(OddPolynomial([0, 1])) == hash(cubic(1.0))


def test_integers_are_taken_for_the_numbers_they_are():
    # 10^10 squared is beyond 64 bits
    h = np.array([10_000_000_000])
    assert cubic(0.5)(h) == pytest.approx(0.5e30) and cubic(1)(h) == pytest.approx(1e30)
    assert OddPolynomial((0.0, 0.0, 1.0)).derivative(h) == pytest.approx(5e40)
