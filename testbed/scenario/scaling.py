"""Scales a scenario to an airframe's speeds, so that any aircraft can fly it.

Speeds grow by k, turn rates fall by 1/k, times grow by k and lengths by k^2: the same flight in a larger
world, at the same bank. The filter's QP alone weighs m/s against rad/s as before. A turn rate that the
airframe cannot hold makes the world larger still.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from testbed.errors import Mistake, UserError
from testbed.scenario.scenario import Scenario, settled

if TYPE_CHECKING:
    from aircraft.airframes.schema import Airframe

_SCALED = ("d_safe_m", "goal_radius_m", "duration_s", "limits", "start", "guidance", "barrier", "fence")
_HEIGHTS = ("floor_m", "ceiling_m")


@dataclass(frozen=True)
class Factors:
    """What speeds, climb rates, turn rates, times and lengths are multiplied by."""

    speed: float
    climb: float
    turn: float
    time: float
    length: float

    def of(self, name: str) -> float:
        """The factor of a field, by the unit in its name; 1 where it has none of these units."""
        if name.startswith("zeta"):
            return self.climb
        units = {
            "_m2": self.length**2,
            "_mps": self.speed,
            "_degps": self.turn,
            "_per_s": 1.0 / self.time,
            "_m": self.length,
            "_s": self.time,
        }
        return next((factor for unit, factor in units.items() if name.endswith(unit)), 1.0)

    def __str__(self) -> str:
        return (
            f"speeds x {self.speed:.3g}, climb rates x {self.climb:.3g}, turn rates x {self.turn:.3g},"
            f" lengths x {self.length:.3g}, times x {self.time:.3g}"
        )


def scaled(s: Scenario, airframes: Sequence[Airframe]) -> Scenario:
    """`s` for its airframes, one a vehicle; its description says by what it was scaled.

    Vehicles of different airframes get [[vehicle]] tables with speeds and limits of their own; lengths are
    those of the fastest.
    Raises  UserError for a scenario that has [[vehicle]] tables, or a filter that cannot be scaled
    """
    if s.vehicle:
        raise UserError(Mistake("a scenario with [[vehicle]] tables states its own speeds", "vehicle"))
    if s.filter.kind == "navigation":
        raise UserError(Mistake("the navigation function's settings cannot be scaled", "filter.kind"))
    v0 = s.start.speed_mps
    ratios = [a.speeds.start_mps / v0 for a in airframes]
    turn = min(1.0 / max(ratios), *(_turn_ratio(s, a) for a in airframes))
    climbs = [_climb_ratio(s, a, k) for a, k in zip(airframes, ratios, strict=True)]
    whole = Factors(max(ratios), min(climbs), turn, 1.0 / turn, max(ratios) / turn)
    data = s.model_dump(mode="json")
    every = max(1, round(whole.time))
    for name in ("filter_dt_s", "record_dt_s"):
        data["rates"][name] = round(data["rates"][name] * every, 9)
    for name in _SCALED:
        if name in data:
            data[name] = _grown(data[name], name, whole)
    _settle_alpha(data, s, whole)
    data["remedy"]["ds_buffer_m"] = data["remedy"]["ds_buffer_m"] * whole.length
    period = data["rates"]["filter_dt_s"]
    data["duration_s"] = round(math.ceil(data["duration_s"] / period - 1e-9) * period, 9)
    data["limits"] |= _limits(s, airframes[0], whole)
    said = f"scaled to {', '.join(dict.fromkeys(a.name for a in airframes))}: {whole}"
    if len({a.speeds.start_mps for a in airframes}) > 1:
        _own_tables(data, s, airframes, whole)
    data["description"] = f"{s.description} ({said})" if s.description else said
    return settled(data, s.name)[0]


def _turn_ratio(s: Scenario, a: Airframe) -> float:
    """By what the scenario's turn may grow until the airframe cannot hold it."""
    asked = abs(getattr(s.barrier, "omega_degps", 0.0)) or s.limits.omega_max_degps
    held = math.degrees(a.speeds.turn_radps) if a.speeds.turn_radps else math.inf
    return held / asked


def _climb_ratio(s: Scenario, a: Airframe, k: float) -> float:
    asked = s.limits.zeta_max_mps
    held = a.speeds.climb_mps or math.inf
    return min(k, held / asked) if asked else k


def _grown(value: Any, name: str, by: Factors) -> Any:
    """Plain data with every number scaled by the unit in its name."""
    if isinstance(value, Mapping):
        return {key: _grown(inner, key, by) for key, inner in value.items()}
    if isinstance(value, list):
        return [_grown(inner, name, by) for inner in value]
    if isinstance(value, bool) or not isinstance(value, int | float) or name in ("i", "j"):
        return value
    factor = by.of(name)
    return value if factor == 1.0 else value * factor


def _settle_alpha(data: dict[str, Any], s: Scenario, by: Factors) -> None:
    """Class-K functions of a larger h per longer second: a h^n becomes a / (time h_length^(n - 1)) h^n."""
    of_h = by.length if getattr(s.barrier, "form", "root") == "root" else by.length**2
    alpha = data["alpha"]
    power = {"linear": 1, "cubic": 3}.get(alpha["kind"])
    if power is not None:
        alpha["coefficient"] = alpha["coefficient"] / (by.time * of_h ** (power - 1))
    if "coefficients" in alpha:
        alpha["coefficients"] = [a / (by.time * of_h ** (2 * k)) for k, a in enumerate(alpha["coefficients"])]


def _limits(s: Scenario, a: Airframe, by: Factors) -> dict[str, float]:
    """The input set of one airframe, within its speeds."""
    k = a.speeds.start_mps / s.start.speed_mps
    low, high = s.limits.v_min_mps * k, s.limits.v_max_mps * k
    return {
        "v_min_mps": round(max(low, a.speeds.v_min_mps), 3),
        "v_max_mps": round(min(high, a.speeds.v_max_mps), 3),
        "omega_max_degps": s.limits.omega_max_degps * by.turn,
        "zeta_max_mps": round(s.limits.zeta_max_mps * by.climb, 3),
    }


def _own_tables(data: dict[str, Any], s: Scenario, airframes: Sequence[Airframe], whole: Factors) -> None:
    """[[vehicle]] tables of speeds and limits, and the barrier's speeds in their ratios."""
    names = [s.airframes[k % len(s.airframes)] for k in range(s.vehicles)]
    tables, ratios = [], []
    for name, a in zip(names, airframes, strict=True):
        own = _limits(s, a, whole)
        tables.append({"airframe": name, "speed_mps": a.speeds.start_mps, "limits": own})
        ratios.append(a.speeds.start_mps / s.start.speed_mps / whole.speed)
    data["vehicle"] = tables
    if data["barrier"]["kind"] != "turn" or isinstance(data["barrier"].get("sigma"), list):
        raise UserError(
            Mistake("only a turn barrier can be scaled to airframes of different speeds", "barrier.kind")
        )
    data["barrier"]["sigma"] = [round(ratio * data["barrier"]["sigma"], 6) for ratio in ratios]
