"""Every number of some short runs, kept and compared: a change for speed alone must change none of them.

    cd tests && python -m benchmarks.reference keep /tmp/before.npz       # before the change
    cd tests && python -m benchmarks.reference compare /tmp/before.npz    # after it; exit code 1 beyond 1e-9

Numbers are compared on one machine: another processor rounds otherwise, and encounters amplify rounding. The
worst instant may be another one where that is as bad: such ties are counted apart.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from testbed.scenario import scenario
from testbed.simulation import simulate

TOLERANCE = 1e-9

SLOW = ["filter_dt_s=0.05", "record_dt_s=0.05"]
TWO = ["duration_s=2", "start.radius_m=60"]
TWENTY = ["duration_s=1", "start.radius_m=120"]
STORM = [
    "wind.speed_mps=4",
    "wind.updraft_mps=0.5",
    "gusts.sigma_mps=1",
    "sensing.position_noise_m=0.3",
    "sensing.course_drift_deg=1",
    "network.latency_s=0.03",
    "network.loss=0.2",
]
AIRCRAFT = ["plant=jsbsim", "lookahead_m=10"]
PREDICTED = ["remedy.predict_lags=true", "remedy.ds_buffer_m=0.5", "start.heading_perturbation_deg=3"]

# name -> (built-in scenario, what is changed)
RUNS: dict[str, tuple[str, list[str]]] = {
    "turn": ("paper-2-turn", TWO),
    "turn-altitude": ("paper-2-turn-altitude", TWO),
    "turn-limited": ("paper-2-turn", [*TWO, "filter.kind=limited", "filter.monitor=true"]),
    "straight": ("paper-2-straight", [*TWO, "filter.monitor=true"]),
    "straight-limited": ("paper-2-straight-altitude", [*TWO, "filter.kind=limited"]),
    "published": ("published-2-turn", TWO),
    "published-straight": ("published-2-straight", TWO),
    "motivating": ("paper-motivating", ["duration_s=1"]),
    "counterexample": ("paper-counterexample", ["duration_s=1"]),
    "rollout": (
        "paper-2-turn",
        [*TWO, *SLOW, "barrier.kind=rollout", "barrier.manoeuvres=[{v_mps=16, omega_degps=11.7}]"],
    ),
    "squared": ("paper-2-turn", [*TWO, "barrier.form=squared", "alpha.kind=linear"]),
    "osqp": ("paper-2-turn", [*TWO, *SLOW, "solver=osqp"]),
    "delayed": ("paper-2-turn", [*TWO, "delay_steps=3", "controller=manoeuvre"]),
    "at-once": ("paper-2-turn", ["duration_s=0"]),
    "alone": ("paper-2-turn", ["vehicles=1", "duration_s=1"]),
    "unfiltered": ("paper-2-turn", [*TWO, "filter.kind=none"]),
    "navigation": ("paper-20-navigation", TWENTY),
    "twenty": ("paper-20-turn", TWENTY),
    "twenty-centralised": ("paper-20-turn", [*TWENTY, "filter.kind=centralised"]),
    "twenty-smoothed": ("paper-20-turn", [*TWENTY, "barrier.smoothing_m2=30", "delta_m2=0", *STORM]),
    "twenty-straight": ("paper-20-straight", TWENTY),
    "fifty": ("paper-50-turn", ["duration_s=0.25"]),
    "lagged": ("paper-2-turn", [*TWO, "plant=lagged", *STORM, "record_dt_s=0.02"]),
    "lagged-identified": ("paper-20-turn", [*TWENTY, "plant=lagged", *PREDICTED]),
    "x8": ("paper-2-turn", [*TWO, *AIRCRAFT]),
    "x8-slow": ("paper-2-turn", [*TWO, *AIRCRAFT, *SLOW, "filter.kind=limited"]),
    "x8-remedies": ("paper-2-turn", [*TWO, *AIRCRAFT, *PREDICTED, "robust_v_mps=0.1", "robust_zeta_mps=0.1"]),
    "x8-storm": ("paper-2-turn", [*TWO, *AIRCRAFT, *SLOW, *STORM, "remedy.air_mass=true", "issf_epsilon=5"]),
    "x8-sensors": (
        "paper-2-turn",
        [*TWO, *AIRCRAFT, *SLOW, *STORM, "filter.kind=limited", "sensing.source=sensors"],
    ),
    "mixed-fleet": ("paper-20-turn", [*TWENTY, *AIRCRAFT, *SLOW, 'airframes=["x8", "rascal"]']),
    "turbulence": ("paper-2-turn", [*TWO, *AIRCRAFT, *SLOW, "gusts.jsbsim_turbulence=light"]),
}


def numbers(name: str) -> dict[str, np.ndarray]:
    """Every recorded column, and every number of the verdicts and the manifest, of one run."""
    source, changes = RUNS[name]
    run = simulate.run(scenario.load(source, changes), force=True)
    found = {
        f"{table}.{column}": values
        for table, columns in run.tables.items()
        for column, values in columns.items()
    }
    for key in ("filter_steps", "worst_qp_residual", "override_share", "qp_cost"):
        found |= dict(_leaves(f"manifest.{key}", run.manifest.get(key)))
    for verdict in run.guarantees:
        found |= dict(_leaves(f"verdict.{verdict.id}", verdict.to_json()))
    return {f"{name}/{key}": value for key, value in found.items()}


def _leaves(path: str, value: Any) -> Iterator[tuple[str, np.ndarray]]:
    """Numbers and words of nested dictionaries and lists, by path; not sentences, which round numbers."""
    if isinstance(value, dict):
        for key, inner in value.items():
            if key not in ("why", "claim", "source"):
                yield from _leaves(f"{path}.{key}", inner)
    elif isinstance(value, list | tuple) and any(isinstance(v, dict | list | tuple) for v in value):
        for k, inner in enumerate(value):
            yield from _leaves(f"{path}.{k}", inner)
    elif value is not None:
        found = np.asarray(value)
        yield path, found.astype(str) if found.dtype == object else found


def difference(before: np.ndarray, after: np.ndarray) -> float:
    """The largest change, of numbers beyond 1 as a share of them; infinite for another shape, word, or place
    without a number."""
    if before.shape != after.shape:
        return float("inf")
    if before.dtype.kind not in "fc" or after.dtype.kind not in "fc":
        return 0.0 if np.array_equal(before, after) else float("inf")
    finite = np.isfinite(before)
    if not np.array_equal(before[~finite], after[~finite], equal_nan=True):
        return float("inf")
    change = np.abs(before[finite] - after[finite]) / np.maximum(1.0, np.abs(before[finite]))
    return float(change.max(initial=0.0))


def compare(before: dict[str, np.ndarray], after: dict[str, np.ndarray]) -> dict[str, dict[str, Any]]:
    """Per run its numbers, the largest change, which it was, ties, and what was there and is no longer."""
    report: dict[str, dict[str, Any]] = {}
    for key, was in before.items():
        name, _, what = key.partition("/")
        row = report.setdefault(name, {"numbers": 0, "largest": 0.0, "where": "", "ties": 0, "gone": []})
        if key not in after:
            row["gone"].append(what)
            continue
        row["numbers"] += int(was.size)
        change = difference(was, after[key])
        if change > TOLERANCE and key.endswith(".t_s") and _as_bad(key, before, after):
            row["ties"] += 1
            continue
        if change > row["largest"]:
            row["largest"], row["where"] = change, what
    return report


def _as_bad(instant: str, before: dict[str, np.ndarray], after: dict[str, np.ndarray]) -> bool:
    """Whether the value of the verdict whose instant this is has stayed what it was."""
    value = instant.removesuffix(".t_s") + ".value"
    return value in before and value in after and difference(before[value], after[value]) <= TOLERANCE


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("action", choices=("keep", "compare"))
    parser.add_argument("file", type=Path, help="numpy archive of all numbers")
    parser.add_argument("--only", nargs="+", choices=list(RUNS), default=list(RUNS), help="these runs")
    parser.add_argument("--out", type=Path, help="compare: write the comparison as JSON")
    asked = parser.parse_args()
    found: dict[str, np.ndarray] = {}
    for name in asked.only:
        print(name, file=sys.stderr)
        found |= numbers(name)
    if asked.action == "keep":
        np.savez_compressed(asked.file, **found)
        return 0
    with np.load(asked.file) as kept:
        report = compare({k: kept[k] for k in kept.files if k.partition("/")[0] in asked.only}, found)
    for name, row in report.items():
        gone = f"; gone: {', '.join(row['gone'])}" if row["gone"] else ""
        what = f"largest change {row['largest']:.1e} {row['where']}" + f", {row['ties']} ties"
        print(f"{name:20} {row['numbers']:8d} numbers, {what}{gone}")
    if asked.out:
        asked.out.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    return int(any(row["largest"] > TOLERANCE or row["gone"] for row in report.values()))


if __name__ == "__main__":
    sys.exit(main())
