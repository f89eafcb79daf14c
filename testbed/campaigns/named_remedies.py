"""Lists remedies by name, each as fields of a scenario: for `testbed remedies` and for campaigns."""

from __future__ import annotations

from typing import Any

from testbed.scenario.barrier import Turn
from testbed.scenario.scenario import Scenario

Fields = dict[str, Any]


def catalogue(s: Scenario) -> dict[str, Fields]:
    """Remedies worth comparing: label -> fields of the scenario. The scenario's own is the first."""
    smooth: Fields = {"remedy.smoothing_m2": 30.0} if isinstance(s.barrier, Turn) else {}
    turns = s.barrier.kind in ("turn", "rollout")
    prediction: Fields = {"remedy.prediction_s": 0.45}
    lags: Fields = {"remedy.predict_lags": True}
    robust: Fields = {
        "remedy.robust_v_mps": 0.5,
        "remedy.robust_omega_degps": 1.5,
        "remedy.robust_zeta_mps": 0.3,
    }

    # The paper's remark: a linear alpha with a small coefficient overrides earlier.
    gentle: Fields = {"alpha.kind": "linear", "alpha.coefficient": 0.3}

    def buffer(metres: float) -> Fields:
        return {"remedy.ds_buffer_m": metres}

    made: dict[str, Fields] = {
        "none": {},
        "buffer 1 m": buffer(1.0),
        "buffer 3 m": buffer(3.0),
        "prediction 0.3 s": {"remedy.prediction_s": 0.3},
        "prediction 0.45 s": prediction,
        "prediction 0.6 s": {"remedy.prediction_s": 0.6},
        "prediction by lags": lags,
        "robust rows": robust,
        "ISSf rows": {"remedy.issf_epsilon": 10.0},
        ("derated 0.8" if turns else "slower 0.97"): {"remedy.derate": 0.8}
        if turns
        else {"remedy.derate_speed": 0.97},
        "prediction 0.45 s, buffer 0.5 m": prediction | buffer(0.5),
        "lags, buffer 0.5 m": lags | buffer(0.5),
        "lags, buffer 1 m": lags | buffer(1.0),
        "alpha linear 0.3": gentle,
        "lags, buffer 1 m, alpha 0.3": lags | buffer(1.0) | gentle,
    }
    if smooth:
        made["smoothed"] = smooth
        made["prediction 0.45 s, smoothed"] = prediction | smooth
        made["lags, buffer 3 m, smoothed"] = lags | buffer(3.0) | smooth
        made["lags, 1 m, smoothed, alpha 0.3"] = lags | buffer(1.0) | smooth | gentle
    if s.wind.speed_mps:
        made["lags, buffer 1 m, air mass"] = lags | buffer(1.0) | {"remedy.air_mass": True}
    return made
