"""Names of elements that JSBSim 1.3 reads in models, systems and engines; it drops or refuses any other.

From its sources (the names that it looks for) and from the aircraft, systems and engines that come with it,
all of which a test reads.
"""

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
orient strut_force x_radius y_radius z_radius x_width y_width z_width licenseName licenseURL
semimajor_axis semiminor_axis rotation_rate equatorial_radius polar_radius GM J2 pointing earth_position_angle
planet_position_angle planet_rotation_rate
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
minthrottle sparkfaildrop volumetric-efficiency bsfc minmp maxmp milthrust maxthrust bypassratio tsfc
atsfc idlen1 idlen2 maxn1 maxn2 augmented diameter numblades gearratio minpitch maxpitch constspeed
reversepitch ct_factor cp_factor ixx area isp velocityconstant coilresistance noloadcurrent decay_factor
maxvolts torqueconstant compression-ratio bore stroke cylinders cylinder-head-mass
air-intake-impedance-factor ram-air-factor boost-loss-factor boostmanual boostoverride numboostspeeds
takeoffboost ratedaltitude1 ratedaltitude2 ratedaltitude3 ratedboost1 ratedboost2 ratedboost3 ratedpower1
ratedpower2 ratedpower3 ratedrpm1 ratedrpm2 ratedrpm3 peak-piston-speed static-fmep dynamic-fmep
cooling-factor man-press-lag starter-rpm starter-torque static-friction design-oil-temp-degK
oil-pressure-relief-valve-psi oil-pressure-rpm-max oil-viscosity-index augmethod bleed injected
injection-time injection-N1-inc injection-N2-inc disable-windmill ignitionn1 ignitionn2 n1spinup
n1spindown n2spinup n2spindown n1startrate n2startrate betarangeend idlefuelflow ielumaxtorque
inertia_factor itt_delay maxpower maxstartingtime n1idle_max_delay psfc reversemaxpower startern1
builduptime slfuelflowmax sloxiflowmax propflowmax mixtureratio thrust thrust_table total_isp variation pe
expr nzl_eff diam cp_factor ct_factor ExternalRPM cantangle cgroundeffect controlmap flappingmoment
groundeffectexp groundeffectshift hingeoffset inflowlag liftcurveslope massmoment nominalrpm polarmoment
shafttilt tailrotor tiplossfactor twist xhub yhub zhub
"""
ENGINE = MODEL | frozenset(_ENGINES.split())
