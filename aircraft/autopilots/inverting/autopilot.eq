# The autopilot: ground speed, course rate and climb rate commands in, elevator, aileron and throttle out.
#
# `testbed aircraft autopilot x8` turns this file and the gains of that airframe.toml into systems/autopilot.xml.
# Every name is a property ap/NAME (underscores become dashes), so every gain and every state
# can be read and written; a name used before its line is a state and keeps its value between steps. States advance
# as x = x + dt f, so the algebra can be evaluated at dt = 0 without moving them. SI, course and omega
# counter-clockwise from east; roll, aileron and beta keep JSBSim's sign (right positive), elevator down positive.

use dt = simulation/dt
use true_airspeed_fps = velocities/vt-fps
use qbar_psf = aero/qbar-psf
use east_fps = velocities/v-east-fps
use north_fps = velocities/v-north-fps
use ground_fps = velocities/vg-fps
use climb_fps = velocities/h-dot-fps
use wind_east_fps = atmosphere/total-wind-east-fps
use wind_north_fps = atmosphere/total-wind-north-fps
use wind_down_fps = atmosphere/total-wind-down-fps
use alpha_rad = aero/alpha-rad
use beta_rad = aero/beta-rad
use side_load = accelerations/Ny
use roll_rad = attitude/phi-rad
use p_radps = velocities/p-rad_sec
use q_radps = velocities/q-rad_sec
use r_radps = velocities/r-rad_sec

input on = 0
input v_cmd_mps = 18
input omega_cmd_radps = 0
input zeta_cmd_mps = 0
# Added to the outputs: where a loop's frequency response is measured.
input elevator_probe = 0
input aileron_probe = 0
input throttle_probe = 0
input rudder_probe for rudder = 0
gain airframe_mass_kg [kg] 1 to 30: mass
gain airframe_wing_area_m2 [m2] 0.2 to 3: wing area
gain airframe_cl_0 [] 0 to 0.4: lift coefficient at no angle of attack, trimmed
gain airframe_cl_alpha [1/rad] 3 to 6: lift coefficient per angle of attack, trimmed
gain airframe_cl_q_m [m] -1 to 1: lift coefficient per pitch rate over airspeed
gain airframe_cd_0 [] 0.015 to 0.06: drag coefficient at no lift
gain airframe_cd_1 [] -0.03 to 0.03: drag coefficient per lift coefficient
gain airframe_cd_2 [] 0.03 to 0.15: drag coefficient per lift coefficient squared
gain airframe_elevator_0_rad [rad] -0.2 to 0.2: elevator of level flight at no angle of attack
gain airframe_elevator_per_alpha [] -3 to -0.5: elevator per angle of attack, trimmed
gain airframe_elevator_per_alpha2 [1/rad] -3 to 3: elevator per angle of attack squared
gain airframe_elevator_per_alphadot_m [m] -4 to 0: elevator against the moment of the rate of the angle of
  attack, times airspeed
gain airframe_elevator_per_q_m [m] -6 to -0.5: elevator against pitch damping, times airspeed
gain airframe_elevator_per_qdot_m [m] -4 to -0.3: elevator per pitch acceleration, times what a lift
  coefficient of one accelerates
gain airframe_elevator_max_rad [rad] 0.3 to 0.6: largest elevator that is asked for
gain airframe_elevator_norm_rad [rad] 0.3 to 0.6: elevator at full deflection
gain airframe_aileron_per_p_m [m] 2 to 8: aileron per roll rate, times airspeed
gain airframe_aileron_per_r_m [m] -3 to 0: aileron against the roll that yawing causes, times airspeed
gain airframe_aileron_per_beta [] -1 to 1: aileron against the roll that sideslip causes
gain airframe_aileron_max_rad [rad] 0.2 to 0.6: largest aileron that is asked for
gain airframe_aileron_norm_rad [rad] 0.2 to 0.6: aileron at full deflection
gain airframe_shared_max_rad [rad] 0.5 to 1.2: largest elevator and aileron together; of elevons the travel
  of one
gain airframe_roll_lag_m [m] 0.5 to 6: airspeed times the time constant of the roll mode
gain airframe_rudder_per_r_m [m] -8 to -1: rudder against yaw damping, times airspeed
gain airframe_rudder_per_rdot_m [m] -6 to -1: rudder per yaw acceleration, times what a lift coefficient of
  one accelerates
gain airframe_rudder_per_aileron [] -1 to 0.3: rudder against the ailerons' adverse yaw
gain airframe_rudder_max_rad [rad] 0.3 to 0.6: largest rudder that is asked for
gain airframe_rudder_norm_rad [rad] 0.3 to 0.6: rudder at full deflection
gain airframe_thrust_area_share [] 0.02 to 0.08: propeller disk area times its coefficient, over the wing area
gain airframe_motor_speed_mps [m/s] 25 to 60: air speed behind the propeller at full throttle
gain airframe_windmill_area_share [] 0.005 to 0.03: the same share of a windmilling propeller, which brakes
gain airframe_windmill_throttle [] 0.05 to 0.2: throttle below which the propeller windmills
gain level_v*_mps [m/s] 10 to 100: airspeeds of the measured tables, in rising order
gain level_cl* [] -0.2 to 0.5: lift coefficient at no angle of attack, at that airspeed
gain level_cd* [] 0.01 to 0.08: drag coefficient at no lift, at that airspeed
gain level_elevator*_rad [rad] -0.3 to 0.3: elevator of level flight at no angle of attack, at that airspeed
gain level_aileron*_rad [rad] -0.1 to 0.1: aileron of level flight, at that airspeed
gain level_rudder*_rad [rad] -0.1 to 0.1: rudder of level flight, at that airspeed
gain thrust_max*_mps2 [m/s2] 1 to 10: thrust over mass at full throttle, at that airspeed
gain thrust_min*_mps2 [m/s2] -2 to 1: thrust over mass at idle, at that airspeed
gain thrust_share*_* [] 0 to 1: share of the thrust range that each eighth of the throttle's range gives,
  at that airspeed
gain thrust_idle [] 0 to 0.2: least throttle
gain thrust_full [] 0.8 to 1: most throttle
gain envelope_airspeed_min_mps [m/s] 9 to 60: lowest airspeed, kept above all else
gain envelope_airspeed_max_mps [m/s] 25 to 150: highest airspeed, kept above all else
gain envelope_slack_mps [m/s] 0.3 to 1: speed error before climb rate pays for it
gain envelope_exchange_per_s [1/s] 0.3 to 2: climb rate given up per speed error, as acceleration
gain envelope_cl_turn [] 0.5 to 1.5: largest lift coefficient in turns and pull-ups
gain envelope_bank_tan_max [] 0.6 to 1.7: tangent of the largest bank
gain envelope_alpha_min_rad [rad] -0.2 to 0: lowest angle of attack asked for
gain envelope_alpha_max_rad [rad] 0.1 to 0.3: highest angle of attack asked for
gain turn_bandwidth_radps [rad/s] 2 to 12: bandwidth of the turn reference
gain turn_damping [] 0.8 to 1.5: damping of the turn reference
gain turn_aileron_rad [rad] 0.1 to 0.5: aileron travel that the roll acceleration of the reference may take
gain turn_model_lag_s [s] 0.02 to 0.3: lag of the course rate behind its reference that is taken as
  unavoidable
gain turn_feedback [] 0 to 0.5: course rate added per error in course rate
gain turn_integral_per_s [1/s] 0 to 1: course rate added per error in course rate and second
gain turn_bank_feedback_per_s [1/s] 3 to 10: roll rate per error in bank
gain turn_rate_feedback [] 0 to 1: roll rate added per error in roll rate
gain turn_side_share [] 0 to 1: share of a measured side force that bank answers
gain turn_servo_lead_s [s] 0 to 0.1: lead for the aileron servo's lag
gain turn_filter_s [s] 0.01 to 0.1: low-pass of the measured course rate
gain climb_bandwidth_radps [rad/s] 1 to 5: bandwidth of the climb reference
gain climb_filter_radps [rad/s] 5 to 25: natural frequency of the filter behind it
gain climb_filter_damping [] 0.7 to 1.2: damping of that filter
gain climb_elevator_rad [rad] 0.1 to 0.5: elevator travel that the pitch acceleration of the reference may
  take
gain climb_model_lag_s [s] 0.02 to 0.2: lag of the climb rate behind its reference that is taken as
  unavoidable
gain climb_push_mps2 [m/s2] 3 to 8: largest vertical acceleration down
gain climb_pull_mps2 [m/s2] 3 to 12: largest vertical acceleration up
gain climb_feedback_per_s [1/s] 0.5 to 3: vertical acceleration per error in climb rate
gain climb_integral_per_s2 [1/s2] 0 to 3: vertical acceleration per error in climb rate and second
gain climb_alpha_feedback_mps2 [m/s2] 0 to 60: elevator per error in angle of attack, times what a lift
  coefficient of one accelerates
gain climb_q_feedback_mps [m/s] 0 to 5: elevator per error in pitch rate, times the same
gain climb_servo_lead_s [s] 0 to 0.1: lead for the elevator servo's lag
gain speed_bandwidth_radps [rad/s] 0.5 to 4: bandwidth of the speed reference
gain speed_filter_s [s] 0.05 to 0.5: low-pass of the acceleration of the reference
gain speed_feedback_per_s [1/s] 0.5 to 3: acceleration per error in speed
gain speed_integral_per_s2 [1/s2] 0 to 1: acceleration per error in speed and second
gain speed_model_lag_s [s] 0.02 to 0.3: lag of the speed behind its reference that is taken as unavoidable
gain speed_thrust_lead_s [s] 0 to 0.5: lead for the motor's lag
gain speed_release_per_s [1/s] 1 to 8: how fast the reference returns to the speed while the throttle is at
  its stop
gain speed_reserved_mps2 [m/s2] 0.1 to 0.5: acceleration always kept for speed
gain speed_window_mps [m/s] 1 to 3: how far the reference may be from the speed
gain rudder_feedback [] 0 to 1: rudder per sideslip
gain rudder_rate_feedback_m [m] 0 to 6: rudder per rate of sideslip, times airspeed

== measure ==
tracking = 1 - on
airspeed_mps = max(0.3048 * true_airspeed_fps, 5)
# Dynamic pressure times wing area over mass: what a lift coefficient of one accelerates.
lift_per_cl_mps2 = max(47.88025898 * qbar_psf * airframe_wing_area_m2 / airframe_mass_kg, 1)
v_mps = max(0.3048 * ground_fps, 1)
zeta_mps = 0.3048 * climb_fps
# Sine of the angle between the last ground velocity and this one over dt: no wrap, no division by zero.
omega_radps = omega_radps + min(dt / turn_filter_s, 1) *
  (0.3048 * (east_mps * north_fps - north_mps * east_fps) / (v_mps * v_mps * max(dt, 1e-6)) - omega_radps)
east_mps = 0.3048 * east_fps
north_mps = 0.3048 * north_fps
# Climb angle through the air.
climb_sin = clip((zeta_mps + 0.3048 * wind_down_fps) / airspeed_mps, -0.6, 0.6)
climb_cos = sqrt(1 - climb_sin * climb_sin)

== track if tracking ==
v_ref_mps = v_mps
v_plan_mps = v_mps
acceleration_ref_mps2 = 0
zeta_ref_mps = zeta_mps
zeta_dot_ref_mps2 = 0
zeta_jerk_ref_mps3 = 0
omega_ref_radps = omega_radps
omega_dot_ref_radps2 = 0
v_model_mps = v_mps
zeta_model_mps = zeta_mps
omega_model_radps = omega_radps
speed_integral_mps2 = 0
climb_integral_mps2 = 0
turn_integral_radps = 0
bank_cos = cos(roll_rad)

# Every eighth period: what changes no faster than speed, bank and heading.
== envelope if on every 8 ==
# Angle from the air-relative to the ground-relative velocity: the crab angle in a crosswind.
air_east_mps = east_mps - 0.3048 * wind_east_fps
air_north_mps = north_mps - 0.3048 * wind_north_fps
per_speeds = 1 / max(v_mps * sqrt(air_east_mps * air_east_mps + air_north_mps * air_north_mps), 5)
crab_cos = (air_east_mps * east_mps + air_north_mps * north_mps) * per_speeds
crab_sin = (air_east_mps * north_mps - air_north_mps * east_mps) * per_speeds
# Of an adopted aircraft: level flight and thrust, measured at five airspeeds, with straight lines between them.
for level: cl_0 = interp(airspeed_mps, level_v1_mps, level_cl1, level_v2_mps, level_cl2, level_v3_mps,
  level_cl3, level_v4_mps, level_cl4, level_v5_mps, level_cl5)
for level: cd_0 = interp(airspeed_mps, level_v1_mps, level_cd1, level_v2_mps, level_cd2, level_v3_mps,
  level_cd3, level_v4_mps, level_cd4, level_v5_mps, level_cd5)
for level: elevator_0_rad = interp(airspeed_mps, level_v1_mps, level_elevator1_rad, level_v2_mps,
  level_elevator2_rad, level_v3_mps, level_elevator3_rad, level_v4_mps, level_elevator4_rad, level_v5_mps,
  level_elevator5_rad)
for level: aileron_0_rad = interp(airspeed_mps, level_v1_mps, level_aileron1_rad, level_v2_mps,
  level_aileron2_rad, level_v3_mps, level_aileron3_rad, level_v4_mps, level_aileron4_rad, level_v5_mps,
  level_aileron5_rad)
for level: share_1 = interp(airspeed_mps, level_v1_mps, thrust_share1_1, level_v2_mps, thrust_share2_1,
  level_v3_mps, thrust_share3_1, level_v4_mps, thrust_share4_1, level_v5_mps, thrust_share5_1)
for level: share_2 = interp(airspeed_mps, level_v1_mps, thrust_share1_2, level_v2_mps, thrust_share2_2,
  level_v3_mps, thrust_share3_2, level_v4_mps, thrust_share4_2, level_v5_mps, thrust_share5_2)
for level: share_3 = interp(airspeed_mps, level_v1_mps, thrust_share1_3, level_v2_mps, thrust_share2_3,
  level_v3_mps, thrust_share3_3, level_v4_mps, thrust_share4_3, level_v5_mps, thrust_share5_3)
for level: share_4 = interp(airspeed_mps, level_v1_mps, thrust_share1_4, level_v2_mps, thrust_share2_4,
  level_v3_mps, thrust_share3_4, level_v4_mps, thrust_share4_4, level_v5_mps, thrust_share5_4)
for level: share_5 = interp(airspeed_mps, level_v1_mps, thrust_share1_5, level_v2_mps, thrust_share2_5,
  level_v3_mps, thrust_share3_5, level_v4_mps, thrust_share4_5, level_v5_mps, thrust_share5_5)
for level: share_6 = interp(airspeed_mps, level_v1_mps, thrust_share1_6, level_v2_mps, thrust_share2_6,
  level_v3_mps, thrust_share3_6, level_v4_mps, thrust_share4_6, level_v5_mps, thrust_share5_6)
for level: share_7 = interp(airspeed_mps, level_v1_mps, thrust_share1_7, level_v2_mps, thrust_share2_7,
  level_v3_mps, thrust_share3_7, level_v4_mps, thrust_share4_7, level_v5_mps, thrust_share5_7)
# Thrust available and drag in level flight at this bank, as accelerations.
for level: thrust_max_mps2 = interp(airspeed_mps, level_v1_mps, thrust_max1_mps2, level_v2_mps,
  thrust_max2_mps2, level_v3_mps, thrust_max3_mps2, level_v4_mps, thrust_max4_mps2, level_v5_mps,
  thrust_max5_mps2)
for level: thrust_min_mps2 = interp(airspeed_mps, level_v1_mps, thrust_min1_mps2, level_v2_mps,
  thrust_min2_mps2, level_v3_mps, thrust_min3_mps2, level_v4_mps, thrust_min4_mps2, level_v5_mps,
  thrust_min5_mps2)
without level: thrust_per_speed2_per_m = airframe_thrust_area_share * lift_per_cl_mps2 /
  (airspeed_mps * airspeed_mps)
without level: thrust_max_mps2 = thrust_per_speed2_per_m * airframe_motor_speed_mps *
  (airframe_motor_speed_mps - airspeed_mps)
without level: thrust_min_mps2 = -1 * airframe_windmill_area_share * lift_per_cl_mps2
level_cl = 9.80665 / (lift_per_cl_mps2 * bank_cos)
without level: level_drag_mps2 = lift_per_cl_mps2 * (airframe_cd_0 + level_cl *
  (airframe_cd_1 + level_cl * airframe_cd_2))
for level: level_drag_mps2 = lift_per_cl_mps2 * (cd_0 + level_cl * (airframe_cd_1 + level_cl * airframe_cd_2))
# Speed before climb rate: what thrust cannot pay for is taken from zeta once the speed has strayed by the slack,
# and at once when the airspeed comes near its limits.
speed_high_mps = v_mps - v_plan_mps
zeta_max_mps = airspeed_mps / 9.80665 * (thrust_max_mps2 - level_drag_mps2 + envelope_exchange_per_s *
  min(envelope_slack_mps + speed_high_mps, airspeed_mps - envelope_airspeed_min_mps))
zeta_min_mps = airspeed_mps / 9.80665 * (thrust_min_mps2 - level_drag_mps2 - envelope_exchange_per_s *
  min(envelope_slack_mps - speed_high_mps, envelope_airspeed_max_mps - airspeed_mps))
limited_zeta = clip(zeta_cmd_mps, zeta_min_mps, zeta_max_mps) != zeta_cmd_mps
# Turn rate is clipped before bank: the bank that the wing can carry at this airspeed, with a load factor in reserve.
load_max = max(lift_per_cl_mps2 * envelope_cl_turn / 9.80665, 1.02)
omega_max_radps = 9.80665 * min(sqrt(load_max * load_max - 1), envelope_bank_tan_max) / v_mps
limited_omega = abs(omega_cmd_radps) > omega_max_radps
# Climb and turn references ask for no more pitch and roll acceleration than a given travel of elevator and aileron
# causes.
zeta_dot_max_mps2 = min(climb_pull_mps2, 9.80665 * (load_max - 1))
zeta_jerk_dot_max_mps4 = -1 * climb_elevator_rad * lift_per_cl_mps2 * lift_per_cl_mps2 * airframe_cl_alpha *
  bank_cos / airframe_elevator_per_qdot_m
omega_ddot_max_radps3 = 9.80665 * turn_aileron_rad * airspeed_mps /
  (airframe_aileron_per_p_m * airframe_roll_lag_m)
# Acceleration: what thrust leaves after the climb, some always kept for speed.
acceleration_min_mps2 = min(thrust_min_mps2 - level_drag_mps2 - 9.80665 * zeta_ref_mps / airspeed_mps,
  -speed_reserved_mps2)
acceleration_max_mps2 = max(thrust_max_mps2 - level_drag_mps2 - 9.80665 * zeta_ref_mps / airspeed_mps,
  speed_reserved_mps2)
# Where the throttle begins to drive the propeller.
without level: knee_mps = airframe_windmill_throttle * (airframe_motor_speed_mps - airspeed_mps)
without level: thrust_knee_mps2 = thrust_per_speed2_per_m * (airspeed_mps + knee_mps) * knee_mps
roll_lead_s = turn_servo_lead_s + airframe_roll_lag_m / airspeed_mps
# Angle of attack that a lift costs.
alpha_per_mps2 = 1 / (bank_cos * lift_per_cl_mps2 * airframe_cl_alpha)

== reference if on ==
zeta_allowed_mps = clip(zeta_cmd_mps, zeta_min_mps, zeta_max_mps)
omega_allowed_radps = clip(omega_cmd_radps, -omega_max_radps, omega_max_radps)
zeta_jerk_dot_mps4 = clip(climb_filter_radps * (climb_filter_radps *
  (clip(climb_bandwidth_radps * (zeta_allowed_mps - zeta_ref_mps), -climb_push_mps2, zeta_dot_max_mps2) -
  zeta_dot_ref_mps2) - 2 * climb_filter_damping * zeta_jerk_ref_mps3), -zeta_jerk_dot_max_mps4,
  zeta_jerk_dot_max_mps4)
zeta_jerk_ref_mps3 = zeta_jerk_ref_mps3 + dt * zeta_jerk_dot_mps4
zeta_dot_ref_mps2 = zeta_dot_ref_mps2 + dt * zeta_jerk_ref_mps3
zeta_ref_mps = zeta_ref_mps + dt * zeta_dot_ref_mps2
omega_ddot_ref_radps3 = clip(turn_bandwidth_radps * (turn_bandwidth_radps *
  (omega_allowed_radps - omega_ref_radps) - 2 * turn_damping * omega_dot_ref_radps2), -omega_ddot_max_radps3,
  omega_ddot_max_radps3)
omega_dot_ref_radps2 = omega_dot_ref_radps2 + dt * omega_ddot_ref_radps3
omega_ref_radps = omega_ref_radps + dt * omega_dot_ref_radps2
# Acceleration within what thrust leaves, and airspeed limits above all.
acceleration_wanted_mps2 = speed_bandwidth_radps * (v_cmd_mps - v_ref_mps)
acceleration_target_mps2 = clip(clip(acceleration_wanted_mps2, acceleration_min_mps2, acceleration_max_mps2),
  envelope_exchange_per_s * (envelope_airspeed_min_mps - airspeed_mps), envelope_exchange_per_s *
  (envelope_airspeed_max_mps - airspeed_mps))
limited_v = acceleration_target_mps2 != acceleration_wanted_mps2
acceleration_dot_mps3 = (acceleration_target_mps2 - acceleration_ref_mps2) / speed_filter_s
acceleration_ref_mps2 = acceleration_ref_mps2 + dt * acceleration_dot_mps3
# What speed should be by now: it does not wait, so that climb rate pays when the aircraft cannot follow.
v_plan_mps = clip(v_plan_mps + dt * clip(speed_bandwidth_radps * (v_cmd_mps - v_plan_mps),
  acceleration_min_mps2, acceleration_max_mps2), v_mps - speed_window_mps, v_mps + speed_window_mps)
# The reference waits for an aircraft whose throttle has reached its stop.
v_ref_mps = clip(v_ref_mps + dt * (acceleration_ref_mps2 - speed_release_per_s * (1 - throttle_free) *
  (v_ref_mps - v_mps)), v_mps - speed_window_mps, v_mps + speed_window_mps)

== fly if on ==
# Corrections act on the model's error, reference minus measured.
# The reference passes the lag that the airframe cannot avoid first, or integrators would answer it with overshoot.
omega_model_radps = omega_model_radps + min(dt / turn_model_lag_s, 1) * (omega_ref_radps - omega_model_radps)
zeta_model_mps = zeta_model_mps + min(dt / climb_model_lag_s, 1) * (zeta_ref_mps - zeta_model_mps)
v_model_mps = v_model_mps + min(dt / speed_model_lag_s, 1) * (v_ref_mps - v_model_mps)
v_error_mps = v_model_mps - v_mps
zeta_error_mps = zeta_model_mps - zeta_mps
omega_error_radps = omega_model_radps - omega_radps
climb_integral_mps2 = clip(climb_integral_mps2 + dt * climb_integral_per_s2 * zeta_error_mps, -3, 3)
without level: turn_integral_radps = clip(turn_integral_radps + dt * turn_integral_per_s * omega_error_radps,
  -0.15, 0.15)
# Of an adopted aircraft the integral waits for ailerons at their stop, and may cost 3 m/s^2 across the path.
for level: turn_integral_radps = clip(turn_integral_radps + dt * turn_integral_per_s * aileron_free *
  omega_error_radps, -3 / v_mps, 3 / v_mps)
zeta_dot_mps2 = zeta_dot_ref_mps2 + climb_feedback_per_s * zeta_error_mps + climb_integral_mps2
speed_integral_mps2 = clip(speed_integral_mps2 + dt * throttle_free * speed_integral_per_s2 * v_error_mps, -2,
  2)
# The horizontal acceleration asked for, along and to the left of the air-relative path: in wind a steady turn over
# the ground needs both.
along_mps2 = acceleration_ref_mps2 + speed_feedback_per_s * v_error_mps + speed_integral_mps2
across_mps2 = v_mps * (omega_ref_radps + turn_feedback * omega_error_radps + turn_integral_radps)
ahead_mps2 = along_mps2 * crab_cos - across_mps2 * crab_sin
# A measured side force pushes in or out of the turn: bank answers its share.
left_mps2 = across_mps2 * crab_cos + along_mps2 * crab_sin + turn_side_share * 9.80665 * side_load * bank_cos
# Lift normal to the path, over m and before banking; then the bank that turns it sideways enough.
lift_mps2 = max((9.80665 + zeta_dot_mps2) * climb_cos - ahead_mps2 * climb_sin, 3)
bank_tan = clip(-left_mps2 / lift_mps2, -envelope_bank_tan_max, envelope_bank_tan_max)
bank_cos = 1 / sqrt(1 + bank_tan * bank_tan)
# Roll rate of the reference, for the turn and for the changing lift; it is led by the servo's and the roll mode's lags.
roll_per_mps2 = bank_cos * bank_cos / lift_mps2
bank_rate_radps = -roll_per_mps2 * (v_mps * omega_dot_ref_radps2 + acceleration_ref_mps2 * omega_ref_radps +
  bank_tan * zeta_jerk_ref_mps3)
roll_rate_radps = turn_bank_feedback_per_s * (atan(bank_tan) - roll_rad) + bank_rate_radps +
  turn_rate_feedback * (bank_rate_radps - p_radps) - roll_per_mps2 * roll_lead_s *
  (v_mps * omega_ddot_ref_radps3 + bank_tan * zeta_jerk_dot_mps4)
# Angle of attack for the lift, elevator to trim it, to pitch along the path and to change it.
lift_cl = lift_mps2 / (bank_cos * lift_per_cl_mps2)
alpha_dot_ref_radps = alpha_per_mps2 * zeta_jerk_ref_mps3
q_ref_radps = alpha_dot_ref_radps + (lift_mps2 / bank_cos - 9.80665 * climb_cos * bank_cos) / airspeed_mps
q_dot_ref_radps2 = alpha_per_mps2 * zeta_jerk_dot_mps4 + zeta_jerk_ref_mps3 / airspeed_mps
without level: alpha_ref_rad = clip((lift_cl - airframe_cl_0 - airframe_cl_q_m * q_ref_radps / airspeed_mps) /
  airframe_cl_alpha, envelope_alpha_min_rad, envelope_alpha_max_rad)
for level: alpha_ref_rad = clip((lift_cl - cl_0 - airframe_cl_q_m * q_ref_radps / airspeed_mps) /
  airframe_cl_alpha, envelope_alpha_min_rad, envelope_alpha_max_rad)
without level: elevator_rad = clip(airframe_elevator_0_rad +
  (airframe_elevator_per_alpha + airframe_elevator_per_alpha2 * alpha_ref_rad) * alpha_ref_rad +
  climb_servo_lead_s * airframe_elevator_per_alpha * alpha_dot_ref_radps +
  (airframe_elevator_per_q_m * (q_ref_radps + climb_servo_lead_s * q_dot_ref_radps2) +
  airframe_elevator_per_alphadot_m * alpha_dot_ref_radps) / airspeed_mps +
  (airframe_elevator_per_qdot_m * q_dot_ref_radps2 - climb_alpha_feedback_mps2 * (alpha_ref_rad - alpha_rad) -
  climb_q_feedback_mps * (q_ref_radps - q_radps)) / lift_per_cl_mps2, -airframe_elevator_max_rad,
  airframe_elevator_max_rad)
for level: elevator_rad = clip(elevator_0_rad + (airframe_elevator_per_alpha + airframe_elevator_per_alpha2 *
  alpha_ref_rad) * alpha_ref_rad + climb_servo_lead_s * airframe_elevator_per_alpha * alpha_dot_ref_radps +
  (airframe_elevator_per_q_m * (q_ref_radps + climb_servo_lead_s * q_dot_ref_radps2) +
  airframe_elevator_per_alphadot_m * alpha_dot_ref_radps) / airspeed_mps +
  (airframe_elevator_per_qdot_m * q_dot_ref_radps2 - climb_alpha_feedback_mps2 * (alpha_ref_rad - alpha_rad) -
  climb_q_feedback_mps * (q_ref_radps - q_radps)) / lift_per_cl_mps2, -airframe_elevator_max_rad,
  airframe_elevator_max_rad)
# Where pitch and roll share surfaces, pitch comes first: roll gets the travel that the elevator leaves.
aileron_max_rad = min(airframe_aileron_max_rad, airframe_shared_max_rad - abs(elevator_rad))
without level: aileron_rad = clip((airframe_aileron_per_p_m * roll_rate_radps + airframe_aileron_per_r_m *
  r_radps) / airspeed_mps + airframe_aileron_per_beta * beta_rad, -aileron_max_rad, aileron_max_rad)
for level: aileron_wanted_rad = aileron_0_rad + (airframe_aileron_per_p_m * roll_rate_radps +
  airframe_aileron_per_r_m * r_radps) / airspeed_mps + airframe_aileron_per_beta * beta_rad
for level: aileron_rad = clip(aileron_wanted_rad, -aileron_max_rad, aileron_max_rad)
for level: aileron_free = aileron_rad == aileron_wanted_rad
# Thrust for the acceleration along the air-relative path, for drag, for weight; led by the motor's lag.
without level: thrust_mps2 = lift_per_cl_mps2 * (airframe_cd_0 + lift_cl *
  (airframe_cd_1 + lift_cl * airframe_cd_2)) + (9.80665 + zeta_dot_mps2) * climb_sin + ahead_mps2 *
  climb_cos + speed_thrust_lead_s * (acceleration_dot_mps3 * crab_cos + 9.80665 * zeta_dot_ref_mps2 /
  airspeed_mps)
for level: thrust_mps2 = lift_per_cl_mps2 * (cd_0 + lift_cl * (airframe_cd_1 + lift_cl * airframe_cd_2)) +
  (9.80665 + zeta_dot_mps2) * climb_sin + ahead_mps2 * climb_cos + speed_thrust_lead_s *
  (acceleration_dot_mps3 * crab_cos + 9.80665 * zeta_dot_ref_mps2 / airspeed_mps)
# The throttle that gives it: T = k Vd (Vd - Va) solved for Vd, and a straight line to the windmilling propeller.
without level: throttle_wanted = where(thrust_mps2 > thrust_knee_mps2,
  (sqrt(airspeed_mps * airspeed_mps + 4 * max(thrust_mps2, 0) / thrust_per_speed2_per_m) - airspeed_mps) /
  (2 * (airframe_motor_speed_mps - airspeed_mps)), airframe_windmill_throttle *
  (thrust_mps2 - thrust_min_mps2) / (thrust_knee_mps2 - thrust_min_mps2))
# Of an adopted aircraft: the share of the thrust range, and the throttle that gave it at this airspeed.
for level: thrust_share = (thrust_mps2 - thrust_min_mps2) / max(thrust_max_mps2 - thrust_min_mps2, 0.01)
for level: throttle_wanted = thrust_idle + (thrust_full - thrust_idle) *
  (interp(thrust_share, 0, 0, share_1, 0.125, share_2, 0.25, share_3, 0.375, share_4, 0.5, share_5, 0.625,
  share_6, 0.75, share_7, 0.875, 1, 1) + min(thrust_share, 0) + max(thrust_share - 1, 0))
without level: throttle = clip(throttle_wanted, 0, 1)
for level: throttle = clip(throttle_wanted, thrust_idle, thrust_full)
throttle_free = throttle == throttle_wanted
elevator_norm = elevator_rad / airframe_elevator_norm_rad + elevator_probe -> fcs/elevator-cmd-norm
aileron_norm = aileron_rad / airframe_aileron_norm_rad + aileron_probe -> fcs/aileron-cmd-norm
throttle_norm = throttle + throttle_probe -> fcs/throttle-cmd-norm

== beginning for rudder if on every 8 ==
for level: rudder_0_rad = interp(airspeed_mps, level_v1_mps, level_rudder1_rad, level_v2_mps,
  level_rudder2_rad, level_v3_mps, level_rudder3_rad, level_v4_mps, level_rudder4_rad, level_v5_mps,
  level_rudder5_rad)
# Rudder that starts the yaw rate of a turn which a roll rate begins.
rudder_per_p_s = airframe_rudder_per_rdot_m * 9.80665 * bank_cos / (airspeed_mps * lift_per_cl_mps2)

== coordinate for rudder if on ==
# Yaw rate of a turn without sideslip under the side force felt; less the one measured, it is the sideslip's rate.
yaw_rate_radps = alpha_rad * p_radps + 9.80665 * (sin(roll_rad) * climb_cos + side_load) / airspeed_mps
# Rudder to yaw so, to begin to, and against the ailerons' adverse yaw; feedback of sideslip and of its rate.
without level: rudder_rad = clip((airframe_rudder_per_r_m * yaw_rate_radps - rudder_rate_feedback_m *
  (yaw_rate_radps - r_radps)) / airspeed_mps + rudder_per_p_s * p_radps + airframe_rudder_per_aileron *
  aileron_rad - rudder_feedback * beta_rad, -airframe_rudder_max_rad, airframe_rudder_max_rad)
for level: rudder_rad = clip(rudder_0_rad + (airframe_rudder_per_r_m * yaw_rate_radps -
  rudder_rate_feedback_m * (yaw_rate_radps - r_radps)) / airspeed_mps + rudder_per_p_s * p_radps +
  airframe_rudder_per_aileron * aileron_rad - rudder_feedback * beta_rad, -airframe_rudder_max_rad,
  airframe_rudder_max_rad)
rudder_norm = rudder_rad / airframe_rudder_norm_rad + rudder_probe -> fcs/rudder-cmd-norm
