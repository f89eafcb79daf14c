"""What an autopilot senses, and how its commands reach it and the servos: presets and a checked table.

Numbers are for small autopilots; docs/guide/autopilots.md gives the source of each. Times in s, rates in Hz;
0 switches an imperfection off.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

_MOST = {"hz": 1000.0, "s": 120.0, "mps": 20.0, "m": 50.0, "norm": 0.5, "per_s": 1000.0, "vane": 1.0}


@dataclass(frozen=True)
class Sensors:
    """The values of [sensors]; the defaults are perfect."""

    gyro_lag_s: float = 0.0  # first-order, of roll, pitch and yaw rate
    accelerometer_lag_s: float = 0.0
    airspeed_lag_s: float = 0.0
    airspeed_rate_hz: float = 0.0
    airspeed_noise_mps: float = 0.0
    gps_rate_hz: float = 0.0
    gps_latency_s: float = 0.0  # until a measurement arrives; the estimator knows of it
    gps_latency_error_s: float = 0.0  # how much older the measurement is than the estimator knows
    gps_noise_mps: float = 0.0
    ekf_lag_s: float = (
        0.0  # with which the estimate of velocity follows GPS; inertial sensors fill the time between
    )
    baro_lag_s: float = 0.0
    baro_rate_hz: float = 0.0
    baro_noise_m: float = 0.0
    wind_lag_s: float = 0.0
    alpha_vane: float = 1.0  # 1: angle of attack is measured; 0: estimated from lift
    beta_vane: float = 1.0  # 1: sideslip is measured; 0: taken as none
    command_latency_s: float = 0.0
    command_rate_hz: float = 0.0
    servo_rate_hz: float = 0.0  # of the pulses: a command is held between two
    servo_lag_s: float = 0.0  # besides the airframe's own actuators
    servo_speed_per_s: float = 0.0  # full deflections in a second; 0 is no limit
    servo_dead_band_norm: float = 0.0  # of full deflection

    @property
    def perfect(self) -> bool:
        return self == Sensors()

    @property
    def noisy(self) -> bool:
        return any(getattr(self, f.name) for f in fields(self) if "_noise_" in f.name)


def silent(table: Mapping[str, float | str]) -> dict[str, float | str]:
    """The same [sensors] without noise and dead band, under which what decays can be seen to decay."""
    made = sensors_of(table)
    off = [f.name for f in fields(made) if "_noise_" in f.name or "_dead_band_" in f.name]
    return {**table, **{name: 0.0 for name in off if getattr(made, name)}}


PRESETS = {
    "perfect": Sensors(),
    "typical": Sensors(
        gyro_lag_s=0.011, accelerometer_lag_s=0.011,
        airspeed_lag_s=0.28, airspeed_rate_hz=10.0, airspeed_noise_mps=0.1,
        gps_rate_hz=5.0, gps_latency_s=0.12, gps_latency_error_s=0.05, gps_noise_mps=0.1, ekf_lag_s=0.25,
        baro_lag_s=0.06, baro_rate_hz=10.0, baro_noise_m=0.2, wind_lag_s=15.0, alpha_vane=0.0, beta_vane=0.0,
        command_latency_s=0.06, command_rate_hz=20.0, servo_rate_hz=50.0, servo_dead_band_norm=0.005,
    ),
    "poor": Sensors(
        gyro_lag_s=0.03, accelerometer_lag_s=0.03,
        airspeed_lag_s=0.5, airspeed_rate_hz=10.0, airspeed_noise_mps=0.5,
        gps_rate_hz=5.0, gps_latency_s=0.2, gps_latency_error_s=0.1, gps_noise_mps=0.3, ekf_lag_s=0.5,
        baro_lag_s=0.25, baro_rate_hz=10.0, baro_noise_m=0.5, wind_lag_s=40.0, alpha_vane=0.0, beta_vane=0.0,
        command_latency_s=0.15, command_rate_hz=10.0, servo_rate_hz=50.0, servo_lag_s=0.05,
        servo_speed_per_s=4.0, servo_dead_band_norm=0.02,
    ),
}  # fmt: skip


def sensors_of(table: Mapping[str, float | str]) -> Sensors:
    """The sensors of a table [sensors]: a preset, by default perfect, and values that differ from it.

    Raises  ValueError naming the field that is unknown or out of range
    """
    preset = table.get("preset", "perfect")
    if preset not in PRESETS:
        raise ValueError(f"sensors.preset: {preset!r} is none of {', '.join(PRESETS)}")
    known = [f.name for f in fields(Sensors)]
    given: dict[str, float] = {}
    for name, value in table.items():
        if name == "preset":
            continue
        if name not in known:
            near = difflib.get_close_matches(name, known, 3)
            raise ValueError(f"sensors.{name}: unknown field; near: {', '.join(near) or 'none'}")
        most = next(m for unit, m in _MOST.items() if name.endswith(f"_{unit}"))
        if isinstance(value, str) or not (0 <= value <= most and math.isfinite(value)):
            raise ValueError(f"sensors.{name}: must be a number from 0 to {most:g}, got {value!r}")
        given[name] = float(value)
    made = replace(PRESETS[str(preset)], **given)
    if made.gps_rate_hz and made.gps_latency_s > 1 / made.gps_rate_hz:
        raise ValueError(
            f"sensors.gps_latency_s: {made.gps_latency_s:g} s is longer than the {1 / made.gps_rate_hz:g} s"
            " between two measurements; lower one of the two"
        )
    return made


def label(table: Mapping[str, float | str]) -> str:
    """The sensors in a name: "@typical" for a preset, "@sensors" for values of one's own, "" for perfect."""
    made = sensors_of(table)
    known = next((name for name, preset in PRESETS.items() if preset == made), "sensors")
    return "" if known == "perfect" else f"@{known}"
