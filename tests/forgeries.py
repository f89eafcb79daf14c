"""Forgeries of telemetry, wind, units, texts, airframes and scenario fields: ways to change a run.

Each names the item of the run folder that it changes. The verification must differ, or list that item as not
covered; flown again, the run must differ.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from testbed.claims import registry
from tests.forgery import edit_entry, edit_manifest, edit_table, entry, read

# Runs to forge: name -> overrides of paper-2-turn.
SHORT = ["radius_m=60", "lookahead_m=10", "duration_s=2", "filter_dt_s=0.05", "record_dt_s=0.05"]
WIND = ["wind.speed_mps=4", "wind.towards_deg=70", "wind.updraft_mps=0.4", "wind.shear_exponent=0.14"]
RUNS = {
    "wind": [*SHORT, "plant=jsbsim", 'airframes=["x8", "rascal"]', *WIND, "manoeuvre_instants=0"],
    "gusts": [*SHORT, "plant=jsbsim", "gusts.intensity=moderate", "manoeuvre_instants=0"],
    "late": [*SHORT, "sensing.delay_s=0.1", "ds_buffer_m=0.5", "derate=0.9", "height_perturbation_m=1"],
    "limited": [
        *SHORT,
        "duration_s=3.5",
        "filter.kind=limited",
        "remedy.issf_epsilon=10",
        "remedy.robust_v_mps=0.2",
    ],
    "monitored": [*SHORT, "filter.monitor=true"],
    "flow": [*SHORT, "duration_s=3.5", "filter.kind=flow"],
    "lossy": [*SHORT, "duration_s=3.5", "filter.kind=limited", "network.loss=0.2"],
    "lagged": [*SHORT, "plant=lagged", "lags.source=table", "omega_time_constant_s=0.4", "alpha.kind=linear"],
}  # fmt: skip


@dataclass(frozen=True)
class Forgery:
    """One change.

    run    of RUNS
    items  what is changed, by the names of `testbed.verification.coverage`
    fly    whether flying the run again can show it: labels and names of packages change no flight
    """

    run: str
    items: tuple[str, ...]
    change: Callable[[Path], None]
    name: str
    fly: bool = True

    def __str__(self) -> str:
        return f"{self.run}: {self.name}"


def forgeries() -> list[Forgery]:
    return [*_telemetry(), *_wind(), *_units_and_texts(), *_airframes(), *_scenario(), *_unknown()]


def _cells(table: str, column: str, rows: slice, by: float, factor: float = 1.0) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        def edit(frame: Any) -> None:
            frame.loc[frame.index[rows], column] = frame[column].iloc[rows] * factor + by

        edit_table(folder, table, edit)

    return change


# Column -> what is added to a cell, and the factor that all are scaled with.
TELEMETRY = {
    "roll_rad": (0.02, 0.9), "pitch_rad": (0.001, 1.05), "heading_rad": (0.001, 0.99),
    "alpha_rad": (0.001, 1.05),
    "beta_rad": (0.001, 0.5), "airspeed_mps": (0.01, 1.01), "throttle": (-0.1, 0.9),
    "load_factor": (1.0, 1.2),
    "limited_v": (-1.0, 0.0), "limited_omega": (1.0, 0.0), "limited_zeta": (1.0, 0.0),
    "elevon_left_rad": (0.01, 0.9), "aileron_left_rad": (0.01, 0.9),
}  # fmt: skip


def _telemetry() -> Iterator[Forgery]:
    for column, (by, factor) in TELEMETRY.items():
        if column != "aileron_left_rad":
            yield Forgery(
                "gusts", (f"vehicles.{column}",), _cells("vehicles", column, slice(40, 41), by), f"a {column}"
            )
        if not column.startswith("elevon"):
            scaled = _cells("vehicles", column, slice(None), 0.3 * by, factor)
            run = "wind" if column != "aileron_left_rad" else ""
            if run:
                yield Forgery(run, (f"vehicles.{column}",), scaled, f"every {column}")
    for column, by in (("v_mps", 0.3), ("omega_radps", 0.2), ("zeta_mps", 0.3), ("zeta_command_mps", 0.05)):
        changed = _cells("vehicles", column, slice(30, 31), by)
        yield Forgery("wind", (f"vehicles.{column}",), changed, f"a {column}")
        yield Forgery("lagged", (f"vehicles.{column}",), changed, f"a {column}")
    for column, by in (("v_command_mps", 0.05), ("omega_command_radps", 0.002), ("zeta_command_mps", 0.05)):
        changed = _cells("vehicles", column, slice(50, 51), by)
        yield Forgery("limited", (f"vehicles.{column}",), changed, f"a {column}")
        yield Forgery("late", (f"vehicles.{column}",), changed, f"a {column}")


def _wind() -> Iterator[Forgery]:
    for column, by in (("wind_east_mps", 0.2), ("wind_north_mps", -0.2), ("wind_up_mps", 0.1)):
        for run in ("wind", "gusts"):
            items = (f"vehicles.{column}",)
            yield Forgery(run, items, _cells("vehicles", column, slice(20, 21), by), f"a {column}")
            yield Forgery(run, items, _cells("vehicles", column, slice(None), by), f"every {column}")
            yield Forgery(run, items, _cells("vehicles", column, slice(None), 0.0, 0.0), f"no {column}")
    for run in ("wind", "gusts"):
        columns = ["wind_east_mps", "wind_north_mps", "wind_up_mps"]
        dropped = _drop("vehicles", columns)
        yield Forgery(run, tuple(f"vehicles.{c}" for c in columns), dropped, "wind columns left out")


def _drop(table: str, columns: list[str]) -> Callable[[Path], None]:
    return lambda folder: edit_table(folder, table, lambda frame: frame.drop(columns=columns))


def _entry(name: str, **fields: Any) -> Callable[[Path], None]:
    return lambda folder: edit_entry(folder, name, **fields)


def _units_and_texts() -> Iterator[Forgery]:
    for claim in registry.CLAIMS.values():
        # Of claims that such a run has.
        if claim not in (*registry.PREMISES, *registry.GUARANTEES):
            continue
        unit = "ft" if claim.unit else "m"
        yield Forgery("wind", (f"{claim.id}.unit",), _entry(claim.id, unit=unit), f"unit of {claim.id}")
        said = _entry(claim.id, claim="every vehicle arrives")
        yield Forgery("wind", (f"{claim.id}.claim",), said, f"claim of {claim.id}")
    for field, value in (("source", "Theorem 9"), ("quantity", "mean distance"), ("number", "G9")):
        name = registry.SEPARATION.id
        yield Forgery("lagged", (f"{name}.{field}",), _entry(name, **{field: value}), f"{field} of {name}")
    for name in (registry.GOAL.id, registry.MANOEUVRE_FLYABLE.id):
        yield Forgery("wind", (f"{name}.why",), _entry(name, why="as it should be"), f"why of {name}")
    for name, fields in (
        (registry.START_SAFE.id, {"bound": 0.0}), (registry.SHARED_MANOEUVRE.id, {"vehicles": [1]}),
        (registry.INTERVENTION.id, {"margin": 1.0}), (registry.OFF_THE_KINK.id, {"bound": 0.5}),
    ):  # fmt: skip
        items = tuple(f"{name}.{key}" for key in fields)
        yield Forgery("wind", items, _entry(name, **fields), f"{next(iter(fields))} of {name}")
    yield Forgery("wind", ("command-limits.detail.share_at_stop",), _stops, "time at a stop")


def _stops(folder: Path) -> None:
    name = registry.COMMAND_LIMITS.id
    detail = entry(folder, name)["detail"]
    detail["share_at_stop"] = dict.fromkeys(detail["share_at_stop"], 0.0)
    edit_entry(folder, name, detail=detail)


def _manifest(**fields: Any) -> Callable[[Path], None]:
    return lambda folder: edit_manifest(folder, **fields)


def _airframes() -> Iterator[Forgery]:
    def renamed(folder: Path) -> None:
        flown = read(folder, "manifest.json")["airframes"]
        edit_manifest(folder, airframes={f"{name}-2": sha for name, sha in flown.items()})

    def another(folder: Path) -> None:
        flown = read(folder, "manifest.json")["airframes"]
        edit_manifest(folder, airframes=dict.fromkeys(flown, "0" * 64))

    for run in ("wind", "gusts"):
        yield Forgery(run, ("manifest.airframes",), renamed, "airframes renamed")
        yield Forgery(run, ("manifest.airframes",), another, "other airframe files")
        yield Forgery(run, ("manifest.airframes",), _manifest(airframes={}), "no airframe")
        yield Forgery(
            run, ("scenario.airframes",), _scenario_field("airframes", ["rascal"]), "other airframes"
        )
    yield Forgery("wind", ("manifest.versions",), _manifest(versions={"numpy": "1"}), "versions", fly=False)
    yield Forgery("wind", ("manifest.seed_streams",), _manifest(seed_streams=["start"]), "streams")
    yield Forgery("wind", ("manifest.worst_qp_residual",), _manifest(worst_qp_residual=0.5), "residual")
    yield Forgery(
        "wind", ("manifest.override_share",), _manifest(override_share=[0.0, 0.0]), "override share"
    )
    yield Forgery("monitored", ("manifest.qp_cost",), _manifest(qp_cost={"steps": 1}), "cost of the QPs")
    yield Forgery("wind", ("manifest.schema_version",), _manifest(schema_version=7), "schema")


def _scenario_field(path: str, value: Any) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        scenario = read(folder, "manifest.json")["scenario"]
        *tables, last = path.split(".")
        table = scenario
        for name in tables:
            table = table[name]
        assert last in table and table[last] != value, path
        table[last] = value
        edit_manifest(folder, scenario=scenario)

    return change


# Run -> field -> another value.
FIELDS: dict[str, dict[str, Any]] = {
    "wind": {
        "wind.speed_mps": 5.0, "wind.towards_deg": 60.0, "wind.updraft_mps": 0.0, "wind.shear_exponent": 0.3,
        "plant": "lagged", "duration_s": 2.5, "vehicles": 3, "d_safe_m": 4.5, "goal_radius_m": 25.0,
        "rates.fdm_dt_s": 0.01, "rates.filter_dt_s": 0.025, "rates.record_dt_s": 0.1,
        "limits.v_max_mps": 16.0,
        "limits.omega_max_degps": 12.0, "limits.zeta_max_mps": 3.0, "start.radius_m": 61.0,
        "start.speed_mps": 19.0,
        "start.course_offset_deg": 1.0, "guidance.lookahead_m": 9.0, "guidance.gain_per_s": 0.2,
        "barrier.v_mps": 17.0, "barrier.omega_degps": 11.0, "barrier.sigma": 1.1, "barrier.delta_m2": 0.5,
        "barrier.form": "squared", "alpha.coefficient": 0.2, "filter.kind": "limited", "filter.monitor": True,
    },
    "gusts": {
        "gusts.intensity": "severe", "gusts.length_scale_m": 200.0, "gusts.independent": True, "seed": 2,
        "gusts.jsbsim_turbulence": "light",
    },
    "late": {
        "sensing.delay_s": 0.05, "remedy.ds_buffer_m": 0.0, "remedy.derate": 1.0,
        "seed": 2, "plant": "lagged",
        "start.height_perturbation_m": 2.0, "network.latency_s": 0.1, "sensing.position_noise_m": 1.0,
    },
    "limited": {
        "remedy.issf_epsilon": 20.0, "remedy.robust_v_mps": 0.0, "remedy.issf_omega_degps": 4.0,
        "filter.kind": "centralised", "checks.manoeuvre_instants": 3,
    },
    # A filter that reports no h of what it saw; and fields that cannot be, beside the others.
    "flow": {
        "sensing.position_noise_m": 0.5, "sensing.delay_s": 0.1, "remedy.ds_buffer_m": 1.0,
        "rates.filter_dt_s": 0.155, "schema_version": 3, "barrier.shared": False,
    },
    "lossy": {"network.loss": 0.3, "network.latency_s": 0.1},
    "lagged": {
        "lags.omega_time_constant_s": 0.5, "plant": "unicycle", "alpha.coefficient": 0.3,
    },
}  # fmt: skip


def _scenario() -> Iterator[Forgery]:
    for run, fields in FIELDS.items():
        for path, value in fields.items():
            yield Forgery(run, (f"scenario.{path}",), _scenario_field(path, value), f"{path} = {value}")
    for path in ("name", "description"):
        yield Forgery("wind", (f"scenario.{path}",), _scenario_field(path, "x"), path, fly=False)


def _unknown() -> Iterator[Forgery]:
    for table in ("vehicles", "pairs"):
        added = _add(table)
        yield Forgery("wind", (f"{table}.score",), added, f"a column more in {table}")
    yield Forgery("wind", ("manifest.approved",), _manifest(approved=True), "a field more")
    yield Forgery(
        "wind", ("separation.approved",), _entry("separation", approved=True), "a claim's field more"
    )
    yield Forgery("lagged", ("goal.detail.mean_m",), _entry("goal", detail={"mean_m": 1.0}), "a detail more")
    yield Forgery("wind", ("vehicles.load_factor",), _drop("vehicles", ["load_factor"]), "no load factor")
    yield Forgery("wind", ("pairs.h_filter_m",), _drop("pairs", ["h_filter_m"]), "no h of the filter")


def _add(table: str) -> Callable[[Path], None]:
    return lambda folder: edit_table(folder, table, lambda frame: frame.assign(score=1.0))
