"""Finds fields that have no effect because of what another table says, and what would take them.

A field at its default says nothing and is never refused. What depends on the kind of its own table is in
`testbed.scenario.kinds`; here is what depends on another field.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from testbed.scenario import fleet
from testbed.scenario.contents import Contents
from testbed.scenario.control import MODELS_LAGS
from testbed.scenario.fields import Section
from testbed.scenario.installed import PLANTS

Test = Callable[[Contents], bool]


@dataclass(frozen=True)
class Rule:
    """Fields that have an effect only where `heard` is true.

    fields  dotted paths; "navigation.*" is every field of a table
    said    why there is none, and what takes the fields; {plant} and {filter} are the scenario's
    """

    fields: tuple[str, ...]
    heard: Test
    said: str


def _own_plant(s: Contents) -> bool:
    return s.plant not in PLANTS  # an installed one: what it reads of the scenario is its own affair


def _solves(s: Contents) -> bool:
    return s.filter.kind in ("centralised", "limited")


def _gusts(s: Contents) -> bool:
    g = s.gusts
    return bool(g.sigma_mps) if g.sigma_mps is not None else g.intensity != "none"


def _errs(s: Contents, *kinds: str) -> bool:
    return any(
        value and name.split("_")[-2] in kinds
        for name, value in s.sensing
        if name.split("_")[-1] in ("m", "deg", "mps", "degps")
    )


def _knows_airframes(s: Contents) -> bool:
    lags = s.lags.source == "airframe" and (s.plant == "lagged" or _models_lags(s))
    return s.plant == "jsbsim" or lags or _own_plant(s)


def _knows_lags(s: Contents) -> bool:
    return s.plant == "lagged" or _own_plant(s) or (_models_lags(s) and s.plant != "jsbsim")


def _models_lags(s: Contents) -> bool:
    """Whether the filter knows how the vehicles' channels lag."""
    return s.remedy.predict_lags or s.filter.kind in MODELS_LAGS


def _late(s: Contents) -> bool:
    carried = s.network.stale == "extrapolate" and (s.network.latency_s or s.sensing.delay_s)
    # The flow filter carries on the flows that it has received, whatever the views say.
    return bool(s.network.loss or carried) and s.filter.kind != "flow"


def _every(s: Contents, field: str) -> bool:
    """Whether every vehicle says a field of its table, such as "limits.v_min_mps", for itself."""
    table, _, leaf = field.rpartition(".")
    tables = [getattr(v, table) if table else v for v in s.vehicle]
    return bool(tables) and all(getattr(one, leaf) is not None for one in tables)


def _evade_alone(s: Contents) -> bool:
    return any(v.manoeuvre for v in s.vehicle)


def _windy(s: Contents) -> bool:
    return bool(s.wind.speed_mps)


PLACING = (
    *("radius_m", "course_offset_deg", "places"),
    *("square_m", "goal_distance_m", "start_h_m"),
    *("crossing_deg", "ahead_m", "spacing_m"),
)
LIMITS = ("v_min_mps", "v_max_mps", "omega_max_degps", "zeta_max_mps")
MANOEUVRE = ("kind", "v_mps", "omega_degps", "zeta_mps", "sigma", "speed_step", "manoeuvres")

RULES = (
    Rule(
        ("rates.workers",),
        lambda s: s.plant == "jsbsim" or _own_plant(s),
        "plant {plant!r} is one computation for all vehicles; plant = 'jsbsim' takes it",
    ),
    Rule(
        ("airframes",),
        lambda s: not _every(s, "airframe"),
        "every [[vehicle]] table names its own; leave it out",
    ),
    Rule(
        ("start.pattern", *(f"start.{name}" for name in PLACING)),
        lambda s: not (_every(s, "x_m") and _every(s, "goal_x_m")),
        "every [[vehicle]] table has its own start and goal; leave it out",
    ),
    Rule(
        ("start.heights_m",),
        lambda s: not all(v.placed or v.z_m is not None for v in s.vehicle) or not s.vehicle,
        "every [[vehicle]] table has its own start; leave it out",
    ),
    Rule(
        ("start.speed_mps",),
        lambda s: not _every(s, "speed_mps"),
        "every [[vehicle]] table has its own speed; leave it out",
    ),
    *(
        Rule(
            (f"limits.{name}",),
            lambda s, name=name: not _every(s, f"limits.{name}"),  # type: ignore[misc]
            "every [vehicle.limits] table says it; leave it out",
        )
        for name in LIMITS
    ),
    Rule(
        tuple(f"barrier.{name}" for name in MANOEUVRE),
        lambda s: not _every(s, "manoeuvre"),
        "every vehicle has a manoeuvre of its own; leave it out",
    ),
    Rule(
        ("barrier.delta_m2", "barrier.smoothing_m2"),
        lambda s: not _evade_alone(s),
        "vehicles have manoeuvres of their own, and the rollout barrier rounds no kink; leave it out",
    ),
    Rule(
        ("intruders.assume",),
        lambda s: bool(fleet.intruders(s)) and (_solves(s) or s.filter.kind == "optimal-decay"),
        "no QP is solved beside an intruder; filter = false in a [[vehicle]] table makes one",
    ),
    Rule(
        ("airframes", "airframes_folder", "sensors", "vehicle.*.airframe"),
        _knows_airframes,
        "no airframe flies; plant = 'jsbsim' takes it, and plant = 'lagged' with lags.source = 'airframe'",
    ),
    Rule(
        ("navigation.*",),
        lambda s: s.filter.kind == "navigation",
        "the filter is {filter!r}; filter.kind = 'navigation' takes it",
    ),
    Rule(
        tuple(
            f"lags.{name}"
            for name in (
                "limits",
                "v_rise_max_mps2",
                "v_fall_max_mps2",
                "omega_change_max_degps2",
                "zeta_change_max_mps2",
            )
        ),
        lambda s: s.plant == "lagged",
        "plant {plant!r} has no such limits; plant = 'lagged' takes it",
    ),
    Rule(
        ("lags.*",),
        _knows_lags,
        "plant {plant!r} has no such lags; plant = 'lagged' takes it, and so do remedy.predict_lags = true"
        " and filter.kind = 'flow', 'backup', 'gatekeeper' or 'receding-horizon' on any plant but 'jsbsim'",
    ),
    Rule(
        ("wind.towards_deg",),
        lambda s: bool(s.wind.speed_mps or s.wind.shear_per_s),
        "the air does not move; set wind.speed_mps or wind.shear_per_s",
    ),
    Rule(("wind.shear_exponent", "remedy.air_mass"), _windy, "the air does not move; set wind.speed_mps"),
    Rule(
        ("gusts.intensity",),
        lambda s: s.gusts.sigma_mps is None,
        "gusts.sigma_mps replaces it; leave out one of them",
    ),
    Rule(
        ("gusts.length_scale_m", "gusts.independent"),
        _gusts,
        "there are no gusts; set gusts.intensity or gusts.sigma_mps",
    ),
    Rule(
        ("gusts.jsbsim_turbulence",),
        lambda s: s.plant == "jsbsim",
        "plant {plant!r} has none; gusts.intensity suits every plant",
    ),
    Rule(
        ("sensing.drift_time_s",),
        lambda s: _errs(s, "drift"),
        "nothing drifts; set sensing.position_drift_m or another drift",
    ),
    Rule(
        ("sensing.source",),
        lambda s: _errs(s, "noise", "drift", "bias"),
        "every measurement is exact; set sensing.position_noise_m or another error",
    ),
    Rule(
        ("network.stale",),
        _late,
        "nothing is late or lost, or the filter is 'flow'; set network.loss, or with 'extrapolate'"
        " network.latency_s",
    ),
    Rule(
        ("barrier.gradient", "barrier.gradient_step"),
        _solves,
        "filter {filter!r} solves no QP; filter.kind = 'centralised' or 'limited' takes it",
    ),
    Rule(
        ("barrier.gradient_step",),
        lambda s: s.barrier.gradient == "forward",
        "the gradient is analytic; barrier.gradient = 'forward' takes it",
    ),
)


def idle(s: Contents) -> dict[str, str]:
    """Fields that are not at their defaults and have no effect: dotted path -> why, and the remedy."""
    found: dict[str, str] = {}
    for rule in RULES:
        for path in (p for field in rule.fields for p in _expand(s, field)):
            if path not in found and not rule.heard(s) and _said(s, path):
                why = rule.said.format(plant=s.plant, filter=s.filter.kind)
                found[path] = f"has no effect: {why}"
    return found


def _expand(s: Contents, field: str) -> Iterator[str]:
    table, _, leaf = field.partition(".")
    if leaf.startswith("*."):
        yield from (f"{table}.{k}{leaf[1:]}" for k in range(1, len(getattr(s, table)) + 1))
        return
    if leaf != "*":
        yield field
        return
    yield from (f"{table}.{name}" for name in type(getattr(s, table)).model_fields)


def said(s: Contents) -> set[str]:
    """Dotted paths of all fields that are not at their defaults."""
    found = set()
    for name, value in s:
        fields = type(value).model_fields if isinstance(value, Section) else None
        paths = [f"{name}.{leaf}" for leaf in fields] if fields is not None else [name]
        found |= {path for path in paths if _said(s, path)}
    return found


def _said(s: Contents, path: str) -> bool:
    """Whether a field is there and not at its default."""
    here: Any = s
    *tables, leaf = path.split(".")
    for table in tables:
        here = here[int(table) - 1] if isinstance(here, list) else getattr(here, table)
    field = type(here).model_fields.get(leaf)
    return field is not None and getattr(here, leaf) != field.default
