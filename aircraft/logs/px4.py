"""Reads PX4's ULog files (.ulg): the only import of pyulog."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from aircraft.logs.autopilot_log import G_MPS2, Logged, flight
from aircraft.logs.record import FlightLog, LogError, Signal, wrapped

_TOPICS = [
    "vehicle_local_position",
    "vehicle_attitude",
    "vehicle_attitude_setpoint",
    "fixed_wing_lateral_status",
    "tecs_status",
    "wind",
]


def read(path: Path) -> FlightLog:
    """The flight of a ULog file.

    The lateral command is fixed_wing_lateral_status.lateral_acceleration_setpoint, or else the roll of
    vehicle_attitude_setpoint; airspeed and climb rate come from tecs_status, the velocity from
    vehicle_local_position, the wind from wind.
    Raises  LogError naming the topic or field that is missing; ImportError without pyulog
    """
    topics = _topics(path)

    def of(topic: str, field: str) -> Any:
        if topic not in topics:
            raise LogError(f"there is no topic {topic}")
        if field not in topics[topic]:
            raise LogError(f"topic {topic} has no field {field}")
        return topics[topic][field]

    def signal(topic: str, field: str, sign: float = 1.0) -> Signal:
        return Signal.of(f"{topic}.{field}", _time(topics, topic), sign * of(topic, field))

    of("tecs_status", "true_airspeed_sp")
    of("vehicle_local_position", "vx")
    notes: list[str] = []
    heading = None
    if "vehicle_attitude" in topics:
        q = _quaternion(topics["vehicle_attitude"], "q")
        _, yaw = _roll_yaw(q)
        heading = wrapped(_time(topics, "vehicle_attitude"), np.pi / 2 - yaw)
    wind = None
    if "wind" in topics:
        wind = (signal("wind", "windspeed_east"), signal("wind", "windspeed_north"))
    return flight(
        path,
        "px4",
        Logged(
            _lateral(topics),
            signal("tecs_status", "true_airspeed_sp"),
            signal("tecs_status", "height_rate_setpoint"),
            signal("vehicle_local_position", "vy"),
            signal("vehicle_local_position", "vx"),
            signal("vehicle_local_position", "vz", -1.0),
            heading,
            wind,
        ),
        notes,
    )


def _lateral(topics: dict[str, dict[str, Any]]) -> Signal:
    """The lateral acceleration asked for, to the left."""
    name = "fixed_wing_lateral_status"
    if "lateral_acceleration_setpoint" in topics.get(name, {}):
        right = topics[name]["lateral_acceleration_setpoint"]
    elif "vehicle_attitude_setpoint" in topics:
        name = "vehicle_attitude_setpoint"
        roll, _ = _roll_yaw(_quaternion(topics[name], "q_d"))
        right = G_MPS2 * np.tan(roll)
    else:
        raise LogError("there is neither topic fixed_wing_lateral_status nor vehicle_attitude_setpoint")
    return Signal.of(name, _time(topics, name), -np.asarray(right, dtype=float))


def _time(topics: dict[str, dict[str, Any]], topic: str) -> Any:
    return np.asarray(topics[topic]["timestamp"], dtype=float) * 1e-6


def _quaternion(data: dict[str, Any], name: str) -> Any:
    try:
        return np.stack([np.asarray(data[f"{name}[{k}]"], dtype=float) for k in range(4)])
    except KeyError as error:
        raise LogError(f"the log lacks the attitude's field {error.args[0]}") from None


def _roll_yaw(q: Any) -> tuple[Any, Any]:
    """Roll and yaw [rad] of quaternions (4, k) from north-east-down to the body."""
    w, x, y, z = q
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return roll, yaw


def _topics(path: Path) -> dict[str, dict[str, Any]]:
    """Topic -> field -> values of its first instance."""
    from pyulog import ULog

    try:
        log = ULog(str(path), _TOPICS)
    except Exception as error:
        raise LogError(f"is no ULog file: {error}") from None
    found = {}
    for data in sorted(log.data_list, key=lambda d: d.multi_id, reverse=True):
        found[data.name] = data.data
    return found
