"""The closed forms against an independent implementation's values (tests/reference/vectors.json)."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from filters.barriers.closed_form import StraightBarrier, TurnBarrier
from filters.model import State

VECTORS = json.loads((Path(__file__).parent / "reference" / "vectors.json").read_text())
PAIRS, QPS = VECTORS["pairs"], VECTORS["qp"]
FORMS = {"sq": "squared", "sqrt": "root"}


def turn(p, key):
    t = p["turn"]
    return TurnBarrier(
        t["v"], t["omega"], t["Ds"], delta=t["delta"], sigma=[t["sigma"], 1.0], form=FORMS[key]
    )


def straight(p, key):
    s = p["straight"]
    return StraightBarrier([s["v1"], s["v2"]], [s["zeta1"], s["zeta2"]], s["Ds"], form=FORMS[key])


@pytest.mark.parametrize("key", FORMS)
@pytest.mark.parametrize(("kind", "make"), [("turn", turn), ("straight", straight)])
@pytest.mark.parametrize("pair", PAIRS, ids=range(len(PAIRS)))
def test_values_gradient_and_lie_rows_equal_the_reference(pair, kind, make, key):
    state = State.of([pair["x1"], pair["x2"]])
    got = make(pair, key).values(state)
    want = pair[kind][key]
    # relative beyond 1 m or 1 m^2: squared forms reach 1e5 m^2, where one rounding is 1e-11
    assert got.h[0] == pytest.approx(want["h"], rel=1e-12 if key == "sq" else 1e-11, abs=1e-9)
    np.testing.assert_allclose(got.grad[0], want["grad"], rtol=1e-9, atol=1e-6)
    lie_i, lie_j = got.lie(state)
    np.testing.assert_allclose(lie_i[0], want["Lgh1"], rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(lie_j[0], want["Lgh2"], rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("qp", QPS, ids=[f"{q['name']}-{q['mode']}" for q in QPS])
def test_rows_of_the_reference_programs_are_reproduced(qp):
    gamma = np.asarray(qp["gamma"])
    form = "root" if qp["root"] else "squared"
    d_safe = VECTORS["constants"]["Ds"]
    if qp["kind"] == "turn":
        barrier = TurnBarrier(gamma[0, 0], gamma[0, 1], d_safe, delta=qp["delta"], form=form)
    else:
        barrier = StraightBarrier(gamma[:, 0], gamma[:, 2], d_safe, form)
    state = State.of(qp["X"])
    values = barrier.values(state)
    lie_i, lie_j = values.lie(state)
    np.testing.assert_allclose(barrier.manoeuvre(qp["k"]).array(), gamma, atol=1e-15)
    np.testing.assert_allclose(values.h, qp["h"], atol=1e-9)
    np.testing.assert_allclose(lie_i, qp["Lgh_i"], atol=1e-9)
    np.testing.assert_allclose(lie_j, qp["Lgh_j"], atol=1e-9)
