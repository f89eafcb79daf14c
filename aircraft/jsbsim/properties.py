"""The JSBSim properties that the wrapper reads and writes, in JSBSim's own units."""

from __future__ import annotations

import math

from aircraft.airframes.setup import Setup
from aircraft.jsbsim.geodesy import M_PER_FT

# What the wrapper reads and writes in every airframe, by the name it has here.
NODES = {
    "latitude_ic": "ic/lat-geod-rad",
    "longitude_ic": "ic/long-gc-rad",
    "altitude_ic": "ic/h-sl-ft",
    "ground_ic": "ic/terrain-elevation-ft",
    "roll_ic": "ic/phi-rad",
    "pitch_ic": "ic/theta-rad",
    "yaw_ic": "ic/psi-true-rad",
    "u_ic": "ic/u-fps",
    "v_ic": "ic/v-fps",
    "w_ic": "ic/w-fps",
    "p_ic": "ic/p-rad_sec",
    "q_ic": "ic/q-rad_sec",
    "r_ic": "ic/r-rad_sec",
    "x": "position/ecef-x-ft",
    "y": "position/ecef-y-ft",
    "z": "position/ecef-z-ft",
    "altitude": "position/geod-alt-ft",
    "roll": "attitude/phi-rad",
    "u": "velocities/ecef-x-fps",
    "v": "velocities/ecef-y-fps",
    "w": "velocities/ecef-z-fps",
    "climb": "velocities/h-dot-fps",
    "wind_east": "atmosphere/wind-east-fps",
    "wind_north": "atmosphere/wind-north-fps",
    "wind_down": "atmosphere/wind-down-fps",
    "udot": "accelerations/udot-ft_sec2",
    "vdot": "accelerations/vdot-ft_sec2",
    "wdot": "accelerations/wdot-ft_sec2",
    "pdot": "accelerations/pdot-rad_sec2",
    "qdot": "accelerations/qdot-rad_sec2",
    "rdot": "accelerations/rdot-rad_sec2",
    "alpha": "aero/alpha-rad",
    "beta": "aero/beta-rad",
    "elevator": "fcs/elevator-cmd-norm",
    "aileron": "fcs/aileron-cmd-norm",
    "throttle": "fcs/throttle-cmd-norm",
    "rudder": "fcs/rudder-cmd-norm",
    "velocity_integrator": "simulation/integrator/rate/translational",
    "on": "ap/on",
    "v_command": "ap/v-cmd-mps",
    "omega_command": "ap/omega-cmd-radps",
    "zeta_command": "ap/zeta-cmd-mps",
    "omega": "ap/omega-radps",
}

# What the start settles the inverting autopilot by: see `initialisation`. Other autopilots settle themselves.
INTEGRALS = {
    "elevator_wanted": "ap/elevator-norm",
    "aileron_wanted": "ap/aileron-norm",
    "throttle_wanted": "ap/throttle-wanted",
    "climb_integral": "ap/climb-integral-mps2",
    "speed_integral": "ap/speed-integral-mps2",
    "turn_integral": "ap/turn-integral-radps",
}

# Telemetry: name with unit -> property, factor to SI and offset. The airframe's surfaces come on top.
TELEMETRY = {
    "roll_rad": ("attitude/phi-rad", 1.0, 0.0),
    "pitch_rad": ("attitude/theta-rad", 1.0, 0.0),
    "heading_rad": ("attitude/psi-rad", -1.0, math.pi / 2),  # counter-clockwise from east, as the course
    "alpha_rad": ("aero/alpha-rad", 1.0, 0.0),
    "beta_rad": ("aero/beta-rad", 1.0, 0.0),
    "airspeed_mps": ("velocities/vt-fps", M_PER_FT, 0.0),
    "load_factor": ("accelerations/Nz", 1.0, 0.0),
    "throttle": ("fcs/throttle-pos-norm", 1.0, 0.0),
    "limited_v": ("ap/limited-v", 1.0, 0.0),
    "limited_omega": ("ap/limited-omega", 1.0, 0.0),
    "limited_zeta": ("ap/limited-zeta", 1.0, 0.0),
}

# Properties of an engine whose thrust depends on a state of its own.
ENGINE_STATES = ("propeller-rpm", "engine-rpm", "n1", "n2", "map-pa")


def setup_values(setup: Setup) -> dict[str, float]:
    """What [setup] of an airframe writes: property -> value."""
    values = dict(setup.properties)
    if setup.gear is not None:
        values["gear/gear-cmd-norm"] = setup.gear
    if setup.flaps is not None:
        values["fcs/flap-cmd-norm"] = setup.flaps
    if setup.fuel_freeze:
        values["propulsion/fuel_freeze"] = 1.0
    return values
