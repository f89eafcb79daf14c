"""Wraps a user's filter, guidance and environment, and checks what they return."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from filters.barriers.pairs import PairValues, all_pairs
from filters.constraints import Constraints
from filters.filter import Decision, Declaration, declaration
from filters.model import Array, Command, Limits, State, View
from filters.qp.single import Status
from testbed.components.border.contract import (
    LARGEST,
    Breach,
    Contract,
    copy_of,
    copy_of_limits,
    copy_of_view,
    locked,
)
from testbed.components.border.plant import parameters

# alpha(0) that counts as zero: round-off.
ZERO = 1e-9
NO_PAIRS = locked(np.zeros(0))
KNOWN = frozenset(int(status) for status in Status)


class OwnFilter:
    """A Filter over a user's.

    A command that is not finite is passed on as NaN, since it violates the limits: the judge counts it, and
    `refused` says why no plant can fly it. Of what it declares count the constraints, see `rows`, and the
    barrier with its alpha, see `barrier_values`; a filter that says it is the paper's is judged by the
    scenario's barrier alone.
    """

    refused: Breach | None = None

    def __init__(self, contract: Contract, choose: Any, limits: Limits) -> None:
        if not callable(choose):
            raise contract.breach(f"it is a {type(choose).__name__}, which cannot be called")
        self._contract, self._choose = contract, choose
        self._limits = copy_of_limits(limits)
        self._i, self._j = all_pairs(contract.vehicles)
        found = contract.call("declaration", declaration, choose)
        self._rows = found.constraints
        self.declares = found.constraints is not None
        if self.declares and not callable(found.constraints):
            kind = type(found.constraints).__name__
            raise contract.breach(f"its declared constraints are a {kind}, which cannot be called")
        self._values, self._alpha = None, None
        if found.barrier is not None and not found.paper:
            self._values = contract.method(found.barrier, "values", "its declared barrier")
            if found.alpha is not None:
                self._check_alpha(found.alpha)
                self._alpha = found.alpha
        self.declaration = Declaration(solves_qp=bool(found.solves_qp))

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision:
        """As `Filter.__call__`."""
        contract, n = self._contract, (self._contract.vehicles,)
        seen, wanted = copy_of_view(view), copy_of(nominal)
        d = contract.call("the call", self._choose, seen, wanted, self._limits)
        if not isinstance(d, Decision):
            raise contract.breach(f"it returned a {type(d).__name__}, not a Decision")
        command, fine = contract.fields("command", d.command, Command, n)
        self.refused = None
        if not fine:
            command = self._flyable(command)
        status = contract.integers("status", d.status, n)
        if not KNOWN.issuperset(status.tolist()):
            raise contract.breach(f"status {status.tolist()} has a value that filters.qp.Status has not")
        made = object.__new__(Decision)  # a frozen type's own way takes a microsecond more
        own = made.__dict__
        own["command"], own["status"] = command, status
        own["residual"] = contract.array("residual", d.residual, n)
        own["override"] = contract.booleans("override", d.override, n)
        own["deviation"] = contract.array("deviation", d.deviation, n)
        own["pairs"], own["hdot_predicted"] = self._pairs(d, view)
        return made

    def _flyable(self, command: Command) -> Command:
        """The command, NaN where it is not finite or too large; `refused` says so."""
        try:
            self._contract.check_finite("command", command)
        except Breach as breach:
            self.refused = breach
            said = command.array()
            command = Command.of(np.where(np.abs(said) <= LARGEST, said, np.nan))
        return command

    @property
    def declared(self) -> list[str]:
        """Which of barrier, alpha and constraints it declares; none without a barrier."""
        said = {"barrier": True, "alpha": self._alpha is not None, "constraints": self.declares}
        return [name for name, is_declared in said.items() if is_declared] if self._values else []

    def barrier_values(self, state: State) -> tuple[PairValues, Array | None]:
        """Values of the declared barrier at the true state (N,), and the declared alpha of its h (P,)."""
        contract = self._contract
        what = "values() of its declared barrier"
        assert self._values is not None
        found = contract.call(what, self._values, copy_of(state))
        pairs = self._checked(what, found)
        if self._alpha is None:
            return pairs, None
        h = pairs.h
        alpha_h = contract.call("its declared alpha", self._alpha, h.copy())
        alpha_h = contract.array("its declared alpha", alpha_h, h.shape)
        order = np.argsort(h)
        falls = np.diff(alpha_h[order]) < -ZERO * (1.0 + np.abs(alpha_h[order[1:]]))
        if falls.any() or (alpha_h * h < -ZERO).any():
            why = "it does not grow with h from alpha(0) = 0"
            raise contract.breach(f"its declared alpha is not of class K: {why}")
        return pairs, alpha_h

    def _check_alpha(self, alpha: Any) -> None:
        contract, what = self._contract, "its declared alpha"
        if not callable(alpha):
            raise contract.breach(f"{what} is a {type(alpha).__name__}, which cannot be called")
        at_zero = contract.array(what, contract.call(what, alpha, np.zeros(1)), (1,))[0]
        if abs(at_zero) > ZERO:
            raise contract.breach(f"{what} is not of class K: alpha(0) is {at_zero:g}")

    def rows(self, view: View) -> tuple[Constraints, ...]:
        """The rows that it declares for this view."""
        contract = self._contract
        found = contract.call("constraints()", self._rows, copy_of_view(view))
        if not isinstance(found, tuple | list) or not all(isinstance(b, Constraints) for b in found):
            raise contract.breach("constraints() is not a tuple of filters.constraints.Constraints")
        return tuple(self._block(block) for block in found)

    def _block(self, block: Constraints) -> Constraints:
        contract, n = self._contract, self._contract.vehicles
        try:
            count = len(block.h)
            k = len(block.vehicles)
            parts = list(zip(block.vehicles, block.lie, strict=True))
        except Exception:
            raise contract.breach("constraints() has a block without one lie per vehicle") from None
        vehicles = tuple(contract.integers("vehicles of constraints()", v, (count,)) for v, _ in parts)
        if not k or any(((v < 0) | (v >= n)).any() for v in vehicles):
            raise contract.breach(f"constraints() has rows over vehicles that are not 0 to {n - 1}")
        lie = tuple(contract.array("lie of constraints()", side, (count, 3)) for _, side in parts)
        h = contract.array("h of constraints()", block.h, (count,))
        return Constraints(vehicles, lie, h, contract.array("rhs of constraints()", block.rhs, (count,)))

    def _pairs(self, d: Decision, view: View) -> tuple[PairValues | None, Array]:
        contract, count = self._contract, len(self._i)
        if d.pairs is None:
            return None, NO_PAIRS
        if view.known is None:
            pairs = self._checked("pairs", d.pairs)
            return pairs, contract.array("hdot_predicted", d.hdot_predicted, (count,))
        apart = ~view.joined(self._i, self._j)
        pairs = self._checked("pairs", d.pairs, apart)
        predicted = contract.array("hdot_predicted", _where(apart, 0.0, d.hdot_predicted), (count,))
        return pairs, _where(apart, np.nan, predicted)

    def _checked(self, what: str, found: Any, apart: NDArray[np.bool_] | None = None) -> PairValues:
        """Read-only copies of values of all pairs i < j, without what they say is `known`.

        apart  (P,) pairs that do not know of each other: whatever is said of them becomes nan
        """
        contract, count = self._contract, len(self._i)
        if not isinstance(found, PairValues):
            raise contract.breach(f"{what} is a {type(found).__name__}, not PairValues")
        known = found.i is self._i and found.j is self._j
        for name, own in () if known else (("i", self._i), ("j", self._j)):
            if not np.array_equal(contract.integers(f"{what}.{name}", getattr(found, name), (count,)), own):
                raise contract.breach(f"{what}.{name} are not those of all pairs i < j, in row order")
        if apart is None:
            h = contract.array(f"{what}.h", found.h, (count,))
            return self._pair_values(h, contract.array(f"{what}.grad", found.grad, (count, 8)))
        h, grad = (_where(apart, 0.0, values) for values in (found.h, found.grad))
        h = contract.array(f"{what}.h", h, (count,))
        grad = contract.array(f"{what}.grad", grad, (count, 8))
        return self._pair_values(_where(apart, np.nan, h), _where(apart, np.nan, grad))

    def _pair_values(self, h: Array, grad: Array) -> PairValues:
        made = object.__new__(PairValues)  # as for Decision
        own = made.__dict__
        own["i"], own["j"], own["h"], own["grad"], own["known"] = self._i, self._j, h, grad, None
        return made


def _where(which: NDArray[np.bool_], value: float, values: Any) -> Any:
    """A copy of `values` (P,) or (P, ...) with `value` where `which` (P,); of another shape, as they are."""
    if type(values) is not np.ndarray or values.shape[:1] != which.shape:
        return values
    if values.dtype.kind != "f":
        return values
    changed = values.copy()
    changed[which] = value
    return changed


class OwnGuidance:
    """Guidance over a user's.

    One whose second parameter is not called `view` is called with the state (N,) instead, which each vehicle
    knows of itself.
    """

    def __init__(self, contract: Contract, law: Any) -> None:
        if not callable(law):
            raise contract.breach(f"it is a {type(law).__name__}, which cannot be called")
        self._contract, self._law = contract, law
        self._by_view = parameters(law)[0][1:2] == ["view"]

    def __call__(self, t: float, view: View) -> Command:
        """As `Guidance.__call__`."""
        seen = copy_of_view(view) if self._by_view else copy_of(view.state)
        return self._contract.command("its command", self._contract.call("the call", self._law, t, seen))


class OwnEnvironment:
    """An Environment over a user's."""

    def __init__(self, contract: Contract, environment: Any) -> None:
        self._contract = contract
        self._wind = contract.method(environment, "wind")
        self._observe = contract.method(environment, "observe")
        self._still: bool | None = None
        self._seen: tuple[State, State] | None = None

    def _copied(self, state: State) -> State:
        """A read-only copy; of the state that wind and observe are both asked about one for the two."""
        if self._seen is None or self._seen[0] is not state:
            self._seen = state, copy_of(state)
        return self._seen[1]

    def wind(self, t: float, state: State) -> Array | None:
        """As `Atmosphere.wind`."""
        contract = self._contract
        found = contract.call("wind()", self._wind, t, self._copied(state))
        still = found is None
        if self._still is None:
            self._still = still
        elif self._still is not still:
            raise contract.breach(
                "wind() is None at some times only; return zeros (N, 3) where air is still for a while"
            )
        return None if found is None else contract.array("wind()", found, (contract.vehicles, 3))

    def observe(self, t: float, truth: State, rates: Command) -> View:
        """As `Observation.observe`."""
        contract, n = self._contract, self._contract.vehicles
        found = contract.call("observe()", self._observe, t, self._copied(truth), copy_of(rates))
        if not isinstance(found, View):
            raise contract.breach(f"observe() is a {type(found).__name__}, not a View")
        shape = (n,) if getattr(getattr(found.state, "x", None), "ndim", 1) == 1 else (n, n)
        known = found.known
        if known is not None:
            known = contract.booleans("observe().known", known, (n,) if np.ndim(known) == 1 else (n, n))
        return View(
            contract.state("observe().state", found.state, shape),
            contract.command("observe().rates", found.rates, shape),
            known,
            None if found.age is None else contract.array("observe().age", found.age, (n, n)),
        )
