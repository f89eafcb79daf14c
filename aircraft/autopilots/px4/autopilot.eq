# PX4's fixed-wing loops, written anew from its documentation: attitude, rates, lateral and TECS, at PX4's rates.
#
# Parameters have PX4's names, units and defaults. Roll is positive to the right, pitch and pitch rate are positive
# nose up; course and omega are counter-clockwise from east, as everywhere in the testbed. True airspeed stands for
# equivalent airspeed: at 300 m they differ by 1.5 %.

use east_fps = velocities/v-east-fps
use north_fps = velocities/v-north-fps
use ground_fps = velocities/vg-fps
use climb_fps = velocities/h-dot-fps
use true_airspeed_fps = velocities/vt-fps
use wind_east_fps = atmosphere/total-wind-east-fps
use wind_north_fps = atmosphere/total-wind-north-fps
use roll_rad = attitude/phi-rad
use pitch_rad = attitude/theta-rad
use p_radps = velocities/p-rad_sec
use q_radps = velocities/q-rad_sec
use r_radps = velocities/r-rad_sec
use elevator_now = fcs/elevator-cmd-norm
use aileron_now = fcs/aileron-cmd-norm
use throttle_now = fcs/throttle-cmd-norm

input on = 0
input v_cmd_mps = 18
input omega_cmd_radps = 0
input zeta_cmd_mps = 0
input elevator_probe = 0
input aileron_probe = 0
input throttle_probe = 0
input rudder_probe for rudder = 0

parameter FW_R_TC = 0.4 [s] 0.2 to 1: time constant of the error in roll
parameter FW_P_TC = 0.4 [s] 0.2 to 1: time constant of the error in pitch
parameter FW_R_RMAX = 70 [deg/s] 0 to 180: largest roll rate asked for
parameter FW_P_RMAX_POS = 60 [deg/s] 0 to 180: largest pitch rate up
parameter FW_P_RMAX_NEG = 60 [deg/s] 0 to 180: largest pitch rate down
parameter FW_Y_RMAX = 50 [deg/s] 0 to 180: largest yaw rate asked for
parameter FW_RR_P = 0.05 [] 0 to 10: aileron per error in roll rate
parameter FW_RR_I = 0.1 [1/s] 0 to 10: aileron per error in roll rate and second
parameter FW_RR_FF = 0.5 [] 0 to 10: aileron per roll rate asked for
parameter FW_RR_IMAX = 0.2 [] 0 to 1: largest integral
parameter FW_PR_P = 0.08 [] 0 to 10: elevator per error in pitch rate
parameter FW_PR_I = 0.1 [1/s] 0 to 10: elevator per error in pitch rate and second
parameter FW_PR_FF = 0.5 [] 0 to 10: elevator per pitch rate asked for
parameter FW_PR_IMAX = 0.4 [] 0 to 1: largest integral
parameter FW_YR_P = 0.05 [] 0 to 10: rudder per error in yaw rate
parameter FW_YR_I = 0.1 [1/s] 0 to 10: rudder per error in yaw rate and second
parameter FW_YR_FF = 0.3 [] 0 to 10: rudder per yaw rate asked for
parameter FW_YR_IMAX = 0.2 [] 0 to 1: largest integral
parameter FW_R_LIM = 50 [deg] 35 to 75: largest bank
parameter FW_P_LIM_MAX = 30 [deg] 0 to 60: highest pitch
parameter FW_P_LIM_MIN = -30 [deg] -60 to 0: lowest pitch
parameter FW_PSP_OFF = 0 [deg] -90 to 90: pitch of level flight
parameter FW_PN_R_SLEW_MAX = 90 [deg/s] 0 to 180: fastest bank asked for
parameter FW_AIRSPD_STALL = 7 [m/s] 0.5 to 40: stall speed
parameter FW_AIRSPD_MIN = 10 [m/s] 0.5 to 40: lowest airspeed asked for
parameter FW_AIRSPD_TRIM = 15 [m/s] 0.5 to 40: airspeed at which the gains are as given
parameter FW_AIRSPD_MAX = 20 [m/s] 0.5 to 40: highest airspeed asked for
parameter FW_THR_MIN = 0 [] 0 to 1: least throttle
parameter FW_THR_MAX = 1 [] 0 to 1: most throttle
parameter FW_THR_TRIM = 0.6 [] 0 to 1: throttle of level flight
parameter FW_THR_ASPD_MIN = 0 [] 0 to 1: throttle of level flight at FW_AIRSPD_MIN; 0 takes FW_THR_TRIM
parameter FW_THR_ASPD_MAX = 0 [] 0 to 1: throttle of level flight at FW_AIRSPD_MAX; 0 takes FW_THR_TRIM
parameter FW_THR_SLEW_MAX = 0 [1/s] 0 to 1: fastest throttle; 0 is no limit
parameter FW_T_CLMB_MAX = 5 [m/s] 1 to 15: climb at full throttle
parameter FW_T_SINK_MIN = 2 [m/s] 1 to 5: sink at idle
parameter FW_T_SINK_MAX = 5 [m/s] 1 to 15: fastest sink asked for
parameter FW_T_TAS_TC = 5 [s] 2 to 15: time constant of airspeed
parameter FW_T_PTCH_DAMP = 0.1 [] 0 to 2: pitch against the rate of balance
parameter FW_T_I_GAIN_PIT = 0.1 [1/s] 0 to 2: integral gain of pitch
parameter FW_T_THR_DAMPING = 0.05 [] 0 to 1: throttle against the rate of energy
parameter FW_T_THR_INTEG = 0.02 [1/s] 0 to 1: integral gain of throttle
parameter FW_T_STE_R_TC = 0.4 [s] 0 to 2: low-pass of the rate of energy
parameter FW_T_SEB_R_FF = 1 [] 0.5 to 3: pitch per rate of balance asked for
parameter FW_T_RLL2THR = 15 [m2/s3] 0 to 20: throttle for the drag of a turn
parameter FW_T_VERT_ACC = 7 [m/s2] 1 to 10: largest vertical acceleration
parameter FW_T_SPDWEIGHT = 1 [] 0 to 2: pitch for speed (2), for height (0) or for both

== measure ==
tracking = 1 - on
v_mps = max(0.3048 * ground_fps, 1)
omega_radps = omega_radps + min(period / 0.02, 1)
  * (0.3048 * (east_mps * north_fps - north_mps * east_fps) / (v_mps * v_mps * max(period, 1e-6)) - omega_radps)
east_mps = 0.3048 * east_fps
north_mps = 0.3048 * north_fps

== air at 50 Hz ==
airspeed_mps = max(0.3048 * true_airspeed_fps, 3)
zeta_mps = 0.3048 * climb_fps
scaler = FW_AIRSPD_TRIM / clip(airspeed_mps, FW_AIRSPD_STALL, FW_AIRSPD_MAX)
cos_roll = max(cos(roll_rad), 0.17)

# States follow the aircraft until the autopilot is engaged, integrators what the trim commands.
== track if tracking at 50 Hz ==
speed_mps = airspeed_mps
speed_dot_mps2 = 0
speed_slewed_mps = airspeed_mps
height_dot_mps = zeta_mps
energy_rate_low = 0
throttle_out = throttle_now
pitch_demand_rad = pitch_rad
balance_integral_rad = pitch_rad - FW_PSP_OFF / 57.29578
roll_demand_rad = 0
roll_integral = aileron_now / (scaler * scaler)
pitch_integral = -elevator_now / (scaler * scaler)
aileron_out = aileron_now
elevator_out = elevator_now

== level at 50 Hz ==
# Throttle of level flight over airspeed, where the ends are given.
throttle_low = where(FW_THR_ASPD_MIN > 0, FW_THR_ASPD_MIN, FW_THR_TRIM)
throttle_high = where(FW_THR_ASPD_MAX > 0, FW_THR_ASPD_MAX, FW_THR_TRIM)
throttle_slow = FW_THR_TRIM + (throttle_low - FW_THR_TRIM) * clip((FW_AIRSPD_TRIM - speed_slewed_mps) / max(FW_AIRSPD_TRIM - FW_AIRSPD_MIN, 0.1), 0, 1)
throttle_trim = throttle_slow + (throttle_high - FW_THR_TRIM)
  * clip((speed_slewed_mps - FW_AIRSPD_TRIM) / max(FW_AIRSPD_MAX - FW_AIRSPD_TRIM, 0.1), 0, 1)

== track_throttle if tracking at 50 Hz ==
throttle_integral = throttle_now - throttle_trim

== guidance if on at 50 Hz ==
# Airspeed through the wind triangle: the wanted velocity over the ground less the wind.
course_east = east_mps / v_mps
course_north = north_mps / v_mps
air_east_mps = v_cmd_mps * course_east - 0.3048 * wind_east_fps
air_north_mps = v_cmd_mps * course_north - 0.3048 * wind_north_fps
airspeed_asked_mps = sqrt(air_east_mps * air_east_mps + air_north_mps * air_north_mps)
now_east_mps = east_mps - 0.3048 * wind_east_fps
now_north_mps = north_mps - 0.3048 * wind_north_fps
crab_cos = max((now_east_mps * course_east + now_north_mps * course_north)
  / max(sqrt(now_east_mps * now_east_mps + now_north_mps * now_north_mps), 3), 0.3)
roll_asked_rad = -atan(v_mps * omega_cmd_radps / (9.80665 * crab_cos))
roll_target_rad = clip(roll_asked_rad, -FW_R_LIM / 57.29578, FW_R_LIM / 57.29578)
limited_omega = roll_target_rad != roll_asked_rad
roll_slew_rad = period * FW_PN_R_SLEW_MAX / 57.29578
roll_demand_rad = clip(roll_target_rad, roll_demand_rad - roll_slew_rad, roll_demand_rad + roll_slew_rad)

== energy if on at 50 Hz ==
energy_rate_max = FW_T_CLMB_MAX * 9.80665
energy_rate_min = -FW_T_SINK_MIN * 9.80665
energy_rate_span = energy_rate_max - energy_rate_min
# Steady gains of a two-state filter, to which the acceleration is not fed.
speed_error_mps = airspeed_mps - speed_mps
speed_next_mps = speed_mps + period * (speed_dot_mps2 + 1.919 * speed_error_mps - 0.259 * speed_dot_mps2)
speed_dot_mps2 = speed_dot_mps2 + period * (2.116 * speed_error_mps - 0.672 * speed_dot_mps2)
speed_mps = max(speed_next_mps, 3)
speed_target_mps = clip(airspeed_asked_mps, FW_AIRSPD_MIN, FW_AIRSPD_MAX)
speed_slewed_mps = clip(speed_target_mps, speed_slewed_mps - period, speed_slewed_mps + period)
speed_dot_wanted_mps2 = (speed_slewed_mps - speed_mps) / FW_T_TAS_TC
speed_dot_demand_mps2 = clip(speed_dot_wanted_mps2, 0.5 * energy_rate_min / speed_mps, 0.5 * energy_rate_max / speed_mps)
height_dot_target_mps = clip(zeta_cmd_mps, -FW_T_SINK_MAX, FW_T_CLMB_MAX)
height_dot_mps = clip(height_dot_target_mps, height_dot_mps - period * FW_T_VERT_ACC, height_dot_mps + period * FW_T_VERT_ACC)
kinetic_weight = min(FW_T_SPDWEIGHT, 1)
potential_weight = min(2 - FW_T_SPDWEIGHT, 1)
per_pitch = speed_mps * 9.80665
balance_rate_demand = potential_weight * 9.80665 * height_dot_mps - kinetic_weight * speed_mps * speed_dot_demand_mps2
balance_rate = potential_weight * 9.80665 * zeta_mps - kinetic_weight * speed_mps * speed_dot_mps2
pitch_max_rad = FW_P_LIM_MAX / 57.29578
pitch_min_rad = FW_P_LIM_MIN / 57.29578
balance_integral_rad = clip(balance_integral_rad + period * FW_T_I_GAIN_PIT * (balance_rate_demand - balance_rate) / per_pitch,
  pitch_min_rad, pitch_max_rad)
pitch_wanted_rad = FW_PSP_OFF / 57.29578 + balance_integral_rad
  + (FW_T_SEB_R_FF * balance_rate_demand + FW_T_PTCH_DAMP * (balance_rate_demand - balance_rate)) / per_pitch
pitch_target_rad = clip(pitch_wanted_rad, pitch_min_rad, pitch_max_rad)
pitch_slew_rad = period * FW_T_VERT_ACC / speed_mps
pitch_demand_rad = clip(pitch_target_rad, pitch_demand_rad - pitch_slew_rad, pitch_demand_rad + pitch_slew_rad)
energy_rate_wanted = 9.80665 * height_dot_mps + speed_mps * speed_dot_demand_mps2 + FW_T_RLL2THR * (1 / cos_roll - 1)
energy_rate_demand = clip(energy_rate_wanted, energy_rate_min, energy_rate_max)
energy_rate_low = energy_rate_low + period / (period + max(FW_T_STE_R_TC, 0.001))
  * (9.80665 * zeta_mps + speed_mps * speed_dot_mps2 - energy_rate_low)
energy_rate_error = energy_rate_demand - energy_rate_low
throttle_feed = throttle_trim + where(energy_rate_demand > 0, (FW_THR_MAX - throttle_trim) * energy_rate_demand / energy_rate_max,
  (throttle_trim - FW_THR_MIN) * energy_rate_demand / -energy_rate_min)
throttle_integral = clip(throttle_integral + period * FW_T_THR_INTEG * energy_rate_error / energy_rate_span,
  FW_THR_MIN - throttle_feed, FW_THR_MAX - throttle_feed)
throttle_wanted = throttle_feed + FW_T_THR_DAMPING * energy_rate_error / energy_rate_span + throttle_integral
throttle_step = where(FW_THR_SLEW_MAX > 0, period * FW_THR_SLEW_MAX, 1)
throttle_out = clip(clip(throttle_wanted, FW_THR_MIN, FW_THR_MAX), throttle_out - throttle_step, throttle_out + throttle_step)
limited_v = max(max(airspeed_asked_mps != speed_target_mps, speed_dot_demand_mps2 != speed_dot_wanted_mps2),
  max(energy_rate_demand != energy_rate_wanted, clip(throttle_wanted, FW_THR_MIN, FW_THR_MAX) != throttle_wanted))
limited_zeta = max(height_dot_target_mps != zeta_cmd_mps, pitch_target_rad != pitch_wanted_rad)

== attitude if on ==
roll_dot_radps = (roll_demand_rad - roll_rad) / FW_R_TC
pitch_dot_radps = (pitch_demand_rad - pitch_rad) / FW_P_TC
turn_roll_rad = clip(roll_rad, -abs(roll_demand_rad), abs(roll_demand_rad))
cos_pitch = cos(pitch_rad)
yaw_dot_radps = 9.80665 * sin(turn_roll_rad) / max(cos(turn_roll_rad), 0.1) * cos_pitch / airspeed_mps
roll_rate_radps = clip(roll_dot_radps - yaw_dot_radps * sin(pitch_rad), -FW_R_RMAX / 57.29578, FW_R_RMAX / 57.29578)
pitch_rate_radps = clip(pitch_dot_radps * cos(roll_rad) + yaw_dot_radps * cos_pitch * sin(roll_rad),
  -FW_P_RMAX_NEG / 57.29578, FW_P_RMAX_POS / 57.29578)
roll_error_radps = roll_rate_radps - p_radps
pitch_error_radps = pitch_rate_radps - q_radps
scaler2 = scaler * scaler
roll_integral = clip(roll_integral + period * FW_RR_I * roll_error_radps, -FW_RR_IMAX, FW_RR_IMAX)
pitch_integral = clip(pitch_integral + period * FW_PR_I * pitch_error_radps, -FW_PR_IMAX, FW_PR_IMAX)
aileron_out = clip(FW_RR_FF * scaler * roll_rate_radps + scaler2 * (FW_RR_P * roll_error_radps + roll_integral), -1, 1)
elevator_out = clip(-FW_PR_FF * scaler * pitch_rate_radps - scaler2 * (FW_PR_P * pitch_error_radps + pitch_integral), -1, 1)
elevator_norm = elevator_out + elevator_probe -> fcs/elevator-cmd-norm
aileron_norm = aileron_out + aileron_probe -> fcs/aileron-cmd-norm
throttle_norm = throttle_out + throttle_probe -> fcs/throttle-cmd-norm

== yaw for rudder if on ==
yaw_rate_radps = clip(yaw_dot_radps * cos(roll_rad) * cos_pitch - pitch_dot_radps * sin(roll_rad), -FW_Y_RMAX / 57.29578, FW_Y_RMAX / 57.29578)
yaw_integral = clip(yaw_integral + period * FW_YR_I * (yaw_rate_radps - r_radps), -FW_YR_IMAX, FW_YR_IMAX)
rudder_out = clip(-FW_YR_FF * scaler * yaw_rate_radps - scaler2 * (FW_YR_P * (yaw_rate_radps - r_radps) + yaw_integral), -1, 1)
rudder_norm = rudder_out + rudder_probe -> fcs/rudder-cmd-norm
