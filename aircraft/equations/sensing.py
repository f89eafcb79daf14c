"""Puts sensors between JSBSim and an autopilot's equations, and servos behind them.

What the equations use of JSBSim becomes what the sensors give; what they drive goes through the servos. With
perfect sensors the equations stay as they are.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import asdict, replace
from pathlib import Path

from aircraft.airframes.sensors import Sensors
from aircraft.equations.language import Channel, Equation, Equations, names_in, parse

_FILE = Path(__file__).with_name("sensors.eq")
# What the sensors give of JSBSim's properties.
_GIVEN = {
    "velocities/v-east-fps": "seen_east_fps",
    "velocities/v-north-fps": "seen_north_fps",
    "velocities/vg-fps": "seen_ground_fps",
    "velocities/h-dot-fps": "seen_climb_fps",
    "velocities/vt-fps": "seen_airspeed_fps",
    "velocities/p-rad_sec": "seen_p_radps",
    "velocities/q-rad_sec": "seen_q_radps",
    "velocities/r-rad_sec": "seen_r_radps",
    "aero/qbar-psf": "seen_qbar_psf",
    "aero/alpha-rad": "seen_alpha_rad",
    "aero/beta-rad": "seen_beta_rad",
    "accelerations/Nx": "seen_nx",
    "accelerations/Ny": "seen_ny",
    "accelerations/Nz": "seen_nz",
    "position/h-sl-ft": "seen_height_ft",
    **{f"atmosphere/{kind}wind-{axis}-fps": f"seen_wind_{axis}_fps"
       for kind in ("total-", "") for axis in ("east", "north", "down")},
}  # fmt: skip
# What an autopilot knows of itself, or by an attitude estimate that is neither late nor noisy.
_KNOWN = ("attitude/", "simulation/", "fcs/")
_COMMANDS = {
    "v_cmd_mps": "sent_v_mps",
    "omega_cmd_radps": "sent_omega_radps",
    "zeta_cmd_mps": "sent_zeta_mps",
}
_DELAY_STEP_S = 0.02
_SERVO_OUTPUTS = ("fcs/elevator-cmd-norm", "fcs/aileron-cmd-norm", "fcs/rudder-cmd-norm")


def sensor_values(sensors: Sensors) -> dict[str, float]:
    """The values of the sensors as gains of their equations: sensor_gps_noise_mps."""
    return {f"sensor_{name}": value for name, value in asdict(sensors).items()}


def sensed(equations: Equations, sensors: Sensors) -> Equations:
    """The equations as they fly with these sensors and servos.

    Raises  ValueError for a property in use that no sensor gives
    """
    if sensors.perfect:
        return equations
    seen: dict[str, str] = {}
    for name, path in equations.uses.items():
        if path in _GIVEN:
            seen[name] = _GIVEN[path]
        elif not path.startswith(_KNOWN):
            raise ValueError(f"use {name} = {path}: no sensor gives it; fly with sensors = perfect")
    last = _registers(sensors)[-1:] or [""]
    commands = {name: f"{sent}{last[0]}" for name, sent in _COMMANDS.items() if name in equations.inputs}
    names = seen | commands
    flown = [
        replace(c, equations=[_renamed(e, names) for e in c.equations], condition=c.condition)
        for c in equations.channels
    ]
    source = parse(_text(sensors))
    before = _needed(source.channels, names.values())
    reads = set().union(*(names_in(e.formula) for c in before for e in c.equations))
    uses = {n: p for n, p in equations.uses.items() if n not in seen}
    uses |= {n: p for n, p in source.uses.items() if n in reads}
    after, flown = _servos(flown, sensors)
    uses |= {f"servo_{n}_now": path for n, path in _servo_names(after).items()}
    return replace(equations, uses=uses, channels=[*before, *flown, *after])


def _renamed(e: Equation, names: dict[str, str]) -> Equation:
    formula = e.formula
    for name in names_in(formula) & names.keys():
        formula = re.sub(rf"\b{name}\b", names[name], formula)
    return replace(e, formula=formula)


def _registers(sensors: Sensors) -> list[str]:
    """Suffixes of the places that a late command passes, 20 ms or less in each."""
    if not sensors.command_latency_s:
        return []
    return [f"_{k}" for k in range(1, max(1, round(sensors.command_latency_s / _DELAY_STEP_S)) + 1)]


def _text(sensors: Sensors) -> str:
    """The sensors' equations with their rates."""
    text = _FILE.read_text(encoding="utf-8")
    places = _registers(sensors)
    delay = ""
    if places:
        delay = f"== command_late at {len(places) / sensors.command_latency_s:g} Hz ==\n"
        for name, sent in _COMMANDS.items():
            for after, before in zip(places[::-1], [*places[-2::-1], ""], strict=True):
                delay += f"{sent}{after} = where(on, {sent}{before}, {name})\n"
    # Angle of attack from lift: load factor over what a lift coefficient of one gives.
    lift = "max(47.88025898 * seen_qbar_psf * airframe_wing_area_m2 / airframe_mass_kg, 1)"
    estimate = f"(9.80665 * seen_nz / {lift} - airframe_cl_0) / airframe_cl_alpha"
    alpha = "true_alpha_rad" if sensors.alpha_vane else f"where(on, {estimate}, true_alpha_rad)"
    beta = "true_beta_rad" if sensors.beta_vane else "0 * on"
    text = text.replace("{command_delay}\n", delay).replace("{alpha}", f"seen_alpha_rad = {alpha}")
    text = text.replace("{beta}", f"seen_beta_rad = {beta}")
    for name, value in asdict(sensors).items():
        text = text.replace(f" at {{{name}}} Hz", f" at {value:g} Hz" if value else "")
    return text


def _needed(channels: Iterable[Channel], wanted: Iterable[str]) -> list[Channel]:
    """The channels with the equations on which the wanted names depend."""
    channels, known = list(channels), set(wanted)
    while True:
        kept = [e for c in channels for e in c.equations if e.name in known]
        more = known.union(*(names_in(e.formula) for e in kept))
        if more == known:
            break
        known = more
    needed = [replace(c, equations=[e for e in c.equations if e.name in known]) for c in channels]
    return [c for c in needed if c.equations]


def _servos(channels: list[Channel], sensors: Sensors) -> tuple[list[Channel], list[Channel]]:
    """The servos' channels, and the autopilot's, which drive the servos in place of the surfaces."""
    if not any((sensors.servo_rate_hz, sensors.servo_lag_s, sensors.servo_speed_per_s,
                sensors.servo_dead_band_norm)):  # fmt: skip
        return [], channels
    driven = [e for c in channels for e in c.equations if e.output in _SERVO_OUTPUTS]
    flown = [
        replace(
            c, equations=[replace(e, output=None) if e.output in _SERVO_OUTPUTS else e for e in c.equations]
        )
        for c in channels
    ]
    rate = sensors.servo_rate_hz or None
    pulses = Channel("pulses", None, None, 1, rate)
    servos = Channel("servos", None, "on")
    for e in driven:
        name = e.name.removesuffix("_norm")
        pulse = f"where(abs({e.name} - pulse_{name}) > sensor_servo_dead_band_norm, {e.name}, pulse_{name})"
        pulses.equations.append(Equation(f"pulse_{name}", f"where(on, {pulse}, servo_{name}_now)", None))
        lag = "period / (period + sensor_servo_lag_s + 1e-9)"
        step = f"{lag} * (pulse_{name} - servo_{name}_now)"
        if sensors.servo_speed_per_s:
            most = "period * sensor_servo_speed_per_s"
            step = f"clip({step}, -{most}, {most})"
        formula = f"servo_{name}_now + {step}"
        if not sensors.servo_lag_s and not sensors.servo_speed_per_s:
            formula = f"pulse_{name}"
        servos.equations.append(Equation(f"servo_{name}", formula, e.output))
    return [pulses, servos], flown


def _servo_names(after: Iterable[Channel]) -> dict[str, str]:
    """What each servo drives."""
    return {e.name.removeprefix("servo_"): e.output for c in after for e in c.equations if e.output}
