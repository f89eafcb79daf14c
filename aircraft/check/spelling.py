"""Names of elements that JSBSim 1.3 reads in a model and in a system; anything else is dropped or refused."""

from __future__ import annotations

_DOCUMENT = """
fdm_config fileheader author email organization license copyright filecreationdate version description note
limitation limitations reference sensitivity documentation planet LocalPlanet metrics wingarea wingspan
wing_incidence chord htailarea htailarm vtailarea vtailarm location x y z mass_balance ixx iyy izz ixy ixz
iyz emptywt pointmass weight form radius length ground_reactions contact orientation pitch roll yaw
static_friction dynamic_friction rolling_friction spring_coeff damping_coeff damping_coeff_rebound max_steer
brake_group retractable steerability relaxation_velocity stiffness force_y rolling moment_coeff cornering
stiffness curve castered propulsion engine thruster feed tank capacity contents temperature standpipe
density priority type drain_location unusable-volume grain_config bore_diameter variation refuel sense
p_factor fuel-transfer refuel-rate dump-rate external_reactions force moment direction magnitude
buoyant_forces gas_cell ballonet dimensions contents overpressure valve_coefficient fullness heat
blower_input max_overpressure atmosphere aerodynamics axis function coefficient alphalimits
hysteresis_limits aero_ref_pt_shift_x min max flight_control autopilot system channel property output input
rate simulation massprops aerosurfaces rates velocities forces moments position fcs coefficients trim
"""
_COMPONENTS = """
summer pure_gain scheduled_gain aerosurface_scale lag_filter lead_lag_filter washout_filter
second_order_filter integrator pid switch kinematic fcs_function deadband dead_band hysteresis distributor
waypoint_heading waypoint_distance angle actuator linear_actuator sensor gyro accelerometer magnetometer
gain clipto c1 c2 c3 c4 c5 c6 kp ki kd trigger pvdot default test lag rate_limit bias deadband_width
hysteresis_width domain traverse setting time width noise quantization bits drift_rate drift delay lookup
target_latitude target_longitude source_latitude source_longitude source_angle target_angle case range
zero_centered units set versus linked saturation detent scale fail_zero delta frequency unit from_latitude
to_latitude detents position
"""
_FUNCTIONS = """
product sum difference quotient pow exp log2 ln log10 abs sign sin cos tan asin acos atan atan2 sqrt mod
fmod avg fraction integer toradians todegrees lt le gt ge eq nq ne and or not ifthen switch random urandom
pi interpolate1d floor ceil rotation_alpha_local rotation_beta_local rotation_gamma_local rotation_bf_to_wf
rotation_wf_to_bf table t tableData independentVar p v n value property roundmultiple lookup
"""

MODEL = frozenset((_DOCUMENT + _COMPONENTS + _FUNCTIONS).split())

_ENGINES = """
electric_engine brushless_dc_motor piston_engine turbine_engine turboprop_engine rocket_engine direct
propeller nozzle rotor power maximumtorque displacement maxhp cycles idlerpm maxrpm minrpm maxthrottle
minthrottle sparkfaildrop volumetric-efficiency bsfc minmp maxmp milthrust maxthrust bypassratio tsfc atsfc
idlen1 idlen2 maxn1 maxn2 augmented diameter numblades gearratio minpitch maxpitch constspeed reversepitch
ct_factor cp_factor ixx area isp velocityconstant coilresistance noloadcurrent decay_factor maxvolts
torqueconstant
"""
ENGINE = MODEL | frozenset(_ENGINES.split())
