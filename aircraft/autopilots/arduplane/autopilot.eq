# ArduPlane's loops, written anew from its documentation: roll and pitch cascades, TECS, at ArduPlane's rates.
#
# Parameters have ArduPlane's names, units and defaults. Roll is positive to the right, pitch and pitch rate are
# positive nose up; course and omega are counter-clockwise from east, as everywhere in the testbed. True airspeed
# stands for equivalent airspeed: at 300 m they differ by 1.5 %.

use east_fps = velocities/v-east-fps
use north_fps = velocities/v-north-fps
use ground_fps = velocities/vg-fps
use climb_fps = velocities/h-dot-fps
use height_ft = position/h-sl-ft
use true_airspeed_fps = velocities/vt-fps
use wind_east_fps = atmosphere/total-wind-east-fps
use wind_north_fps = atmosphere/total-wind-north-fps
use forward_load = accelerations/Nx
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

parameter RLL2SRV_TCONST = 0.5 [s] 0.4 to 1: time constant of the error in roll
parameter RLL2SRV_RMAX = 0 [deg/s] 0 to 180: largest roll rate asked for; 0 is no limit
parameter RLL_RATE_P = 0.08 [] 0.08 to 0.35: aileron per error in roll rate
parameter RLL_RATE_I = 0.15 [1/s] 0.01 to 0.6: aileron per error in roll rate and second
parameter RLL_RATE_D = 0 [s] 0.001 to 0.03: aileron per rate of that error
parameter RLL_RATE_FF = 0.345 [] 0 to 3: aileron per roll rate asked for
parameter RLL_RATE_IMAX = 0.666 [] 0 to 1: largest integral
parameter RLL_RATE_FLTT = 3 [Hz] 2 to 50: low-pass of the roll rate asked for
parameter RLL_RATE_FLTD = 12 [Hz] 0 to 50: low-pass of the error's rate
parameter PTCH2SRV_TCONST = 0.5 [s] 0.4 to 1: time constant of the error in pitch
parameter PTCH2SRV_RMAX_UP = 0 [deg/s] 0 to 100: largest pitch rate up; 0 is no limit
parameter PTCH2SRV_RMAX_DN = 0 [deg/s] 0 to 100: largest pitch rate down; 0 is no limit
parameter PTCH2SRV_RLL = 1 [] 0.7 to 1.5: share of the pitch rate that a turn needs
parameter PTCH_RATE_P = 0.04 [] 0.08 to 0.35: elevator per error in pitch rate
parameter PTCH_RATE_I = 0.15 [1/s] 0.01 to 0.6: elevator per error in pitch rate and second
parameter PTCH_RATE_D = 0 [s] 0.001 to 0.03: elevator per rate of that error
parameter PTCH_RATE_FF = 0.345 [] 0 to 3: elevator per pitch rate asked for
parameter PTCH_RATE_IMAX = 0.666 [] 0 to 1: largest integral
parameter PTCH_RATE_FLTT = 3 [Hz] 2 to 50: low-pass of the pitch rate asked for
parameter PTCH_RATE_FLTD = 12 [Hz] 0 to 50: low-pass of the error's rate
parameter SCALING_SPEED = 15 [m/s] 0 to 50: airspeed at which the gains are as given
parameter ROLL_LIMIT_DEG = 45 [deg] 0 to 90: largest bank
parameter PTCH_LIM_MAX_DEG = 20 [deg] 0 to 90: highest pitch
parameter PTCH_LIM_MIN_DEG = -25 [deg] -90 to 0: lowest pitch
parameter AIRSPEED_MIN = 9 [m/s] 5 to 100: lowest airspeed asked for
parameter AIRSPEED_MAX = 22 [m/s] 5 to 100: highest airspeed asked for
parameter AIRSPEED_STALL = 0 [m/s] 5 to 75: stall speed; 0 takes AIRSPEED_MIN
parameter TRIM_THROTTLE = 45 [%] 0 to 100: throttle of level flight
parameter THR_MIN = 0 [%] -100 to 100: least throttle
parameter THR_MAX = 100 [%] 0 to 100: most throttle
parameter THR_SLEWRATE = 100 [%/s] 0 to 127: fastest throttle; 0 is no limit
parameter KFF_RDDRMIX = 0.5 [] 0 to 1: rudder per aileron
parameter YAW2SRV_DAMP = 0 [] 0 to 2: rudder against the yaw rate
parameter YAW2SRV_RLL = 1 [] 0.8 to 1.2: share of the yaw rate that a turn needs
parameter TECS_CLMB_MAX = 5 [m/s] 0.1 to 20: climb at full throttle
parameter TECS_SINK_MIN = 2 [m/s] 0.1 to 10: sink at idle
parameter TECS_SINK_MAX = 5 [m/s] 0 to 20: fastest sink asked for
parameter TECS_TIME_CONST = 5 [s] 3 to 10: time constant of height and speed
parameter TECS_HDEM_TCONST = 3 [s] 1 to 5: low-pass of the height asked for
parameter TECS_THR_DAMP = 0.5 [s] 0.1 to 1: throttle against the rate of energy
parameter TECS_PTCH_DAMP = 0.3 [] 0.1 to 1: pitch against the rate of balance
parameter TECS_INTEG_GAIN = 0.3 [1/s] 0 to 0.5: integral gain of throttle and pitch
parameter TECS_SPDWEIGHT = 1 [] 0 to 2: pitch for speed (2), for height (0) or for both
parameter TECS_RLL2THR = 10 [m2/s3] 5 to 30: throttle for the drag of a turn
parameter TECS_VERT_ACC = 7 [m/s2] 1 to 10: largest vertical acceleration
parameter TECS_SPD_OMEGA = 2 [rad/s] 0.5 to 2: airspeed's complementary filter
parameter TECS_PITCH_MAX = 15 [deg] 0 to 45: highest pitch of TECS; 0 takes PTCH_LIM_MAX_DEG
parameter TECS_PITCH_MIN = 0 [deg] -45 to 0: lowest pitch of TECS; 0 takes PTCH_LIM_MIN_DEG
# Of the testbed's own: how far the height asked for runs ahead of the aircraft. ArduPlane is asked for heights only,
# and its low-pass of height lags by TECS_HDEM_TCONST times the climb rate, which this must exceed.
parameter HEIGHT_WINDOW = 20 [m] 10 to 40: how far the height asked for may be from the aircraft

== measure ==
tracking = 1 - on
v_mps = max(0.3048 * ground_fps, 1)
omega_radps = omega_radps + min(period / 0.02, 1)
  * (0.3048 * (east_mps * north_fps - north_mps * east_fps) / (v_mps * v_mps * max(period, 1e-6)) - omega_radps)
east_mps = 0.3048 * east_fps
north_mps = 0.3048 * north_fps

== air at 50 Hz ==
airspeed_mps = max(0.3048 * true_airspeed_fps, 3)
height_m = 0.3048 * height_ft
zeta_mps = 0.3048 * climb_fps
cos_roll = max(cos(roll_rad), 0.17)
tan_roll = sin(roll_rad) / cos_roll

# States follow the aircraft until the autopilot is engaged, integrators what the trim commands.
== track if tracking at 50 Hz ==
speed_mps = airspeed_mps
speed_bias_mps2 = 0
speed_dot_mps2 = 0
speed_dot_low_mps2 = 0
demand_dot_low_mps2 = 0
speed_demand_mps = airspeed_mps
height_asked_m = height_m
height_before_m = height_m
height_slewed_m = height_m
height_demand_m = height_m
throttle_slewed = TRIM_THROTTLE / 100
throttle_integral = throttle_now - TRIM_THROTTLE / 100
energy_rate_error = 0
pitch_demand_rad = pitch_rad
balance_integral = pitch_rad * airspeed_mps * 9.80665
balance_speed_integral = 0
roll_demand_rad = 0
roll_rate_low_radps = 0
pitch_rate_low_radps = 0
roll_error_before = 0
pitch_error_before = 0
roll_error_rate = 0
pitch_error_rate = 0
roll_integral = aileron_now * 0.785398 / (scaler * scaler)
pitch_integral = -elevator_now * 0.785398 / (scaler * scaler)
aileron_out = aileron_now
elevator_out = elevator_now
throttle_out = throttle_now
aileron_free = 1
elevator_free = 1
scaler = clip(SCALING_SPEED / airspeed_mps, min(0.5, SCALING_SPEED / (2 * AIRSPEED_MAX)),
  max(2, SCALING_SPEED / (0.7 * AIRSPEED_MIN)))

== adaptor if on at 10 Hz ==
# Airspeed through the wind triangle: the wanted velocity over the ground less the wind.
course_east = east_mps / v_mps
course_north = north_mps / v_mps
air_east_mps = v_cmd_mps * course_east - 0.3048 * wind_east_fps
air_north_mps = v_cmd_mps * course_north - 0.3048 * wind_north_fps
airspeed_asked_mps = sqrt(air_east_mps * air_east_mps + air_north_mps * air_north_mps)
# Cosine of the angle between heading and course.
now_east_mps = east_mps - 0.3048 * wind_east_fps
now_north_mps = north_mps - 0.3048 * wind_north_fps
crab_cos = max((now_east_mps * course_east + now_north_mps * course_north)
  / max(sqrt(now_east_mps * now_east_mps + now_north_mps * now_north_mps), 3), 0.3)
# Bank that leaves the wing lift enough, never below 25 deg.
stall_mps = where(AIRSPEED_STALL > 0, AIRSPEED_STALL, AIRSPEED_MIN)
load_allowed = max(airspeed_mps * airspeed_mps / (stall_mps * stall_mps), 1)
roll_max_rad = min(ROLL_LIMIT_DEG / 57.29578, max(atan(sqrt(load_allowed * load_allowed - 1)), 0.436332))
# ArduPlane has no climb rate command: the height asked for is moved on, ten times a second.
height_asked_m = clip(height_asked_m + period * zeta_cmd_mps, height_m - HEIGHT_WINDOW, height_m + HEIGHT_WINDOW)

== estimator if on at 50 Hz ==
# In place of the mean of five samples of acceleration: a low-pass with the same delay.
speed_dot_mps2 = speed_dot_mps2 + min(period / 0.04, 1) * (9.80665 * (forward_load - sin(pitch_rad)) - speed_dot_mps2)
speed_error_mps = airspeed_mps - speed_mps
speed_bias_mps2 = speed_bias_mps2 + period * TECS_SPD_OMEGA * TECS_SPD_OMEGA * speed_error_mps
speed_mps = max(speed_mps + period * (speed_bias_mps2 + speed_dot_mps2 + 1.4142 * TECS_SPD_OMEGA * speed_error_mps), 3)

== energy if on at 10 Hz ==
energy_rate_max = TECS_CLMB_MAX * 9.80665
energy_rate_min = -TECS_SINK_MIN * 9.80665
energy_rate_span = energy_rate_max - energy_rate_min
# Speed asked for: within the limits, of which the lower rises with the load factor; slewed by half the power.
speed_low_mps = AIRSPEED_MIN / sqrt(cos_roll)
speed_target_mps = clip(airspeed_asked_mps, min(speed_low_mps, AIRSPEED_MAX), AIRSPEED_MAX)
demand_dot_mps2 = clip((speed_target_mps - speed_demand_mps) / max(period, 0.001),
  0.5 * energy_rate_min / speed_mps, 0.5 * energy_rate_max / speed_mps)
speed_demand_mps = speed_demand_mps + period * demand_dot_mps2
# Rates of speed, measured and asked for, count by what changes faster than the time constant.
demand_dot_low_mps2 = demand_dot_low_mps2 + period / (period + TECS_TIME_CONST) * (demand_dot_mps2 - demand_dot_low_mps2)
speed_dot_low_mps2 = speed_dot_low_mps2 + period / (period + TECS_TIME_CONST) * (speed_dot_mps2 - speed_dot_low_mps2)
demand_dot_high_mps2 = demand_dot_mps2 - demand_dot_low_mps2
speed_dot_high_mps2 = speed_dot_mps2 - speed_dot_low_mps2
# Height asked for: mean of two, slewed, low-passed.
height_slewed_m = height_slewed_m + clip(0.5 * (height_asked_m + height_before_m) - height_slewed_m,
  -period * TECS_SINK_MAX, period * TECS_CLMB_MAX)
height_before_m = height_asked_m
height_demand_m = height_demand_m + period / (period + TECS_HDEM_TCONST) * (height_slewed_m - height_demand_m)
height_dot_mps = (height_slewed_m - height_demand_m) / TECS_HDEM_TCONST
# Energies and their errors, per mass.
potential_error = 9.80665 * (height_demand_m - height_m)
kinetic_demand = 0.5 * speed_demand_mps * speed_demand_mps
kinetic_error = kinetic_demand - 0.5 * speed_mps * speed_mps
potential_bounded = clip(potential_error, min(0.5 * AIRSPEED_MIN * AIRSPEED_MIN - kinetic_demand, 0),
  max(0.5 * AIRSPEED_MAX * AIRSPEED_MAX - kinetic_demand, 0))
energy_error = potential_bounded + kinetic_error
energy_rate_wanted = potential_bounded / TECS_TIME_CONST + speed_mps * demand_dot_high_mps2
energy_rate_demand = clip(energy_rate_wanted, energy_rate_min, energy_rate_max)
energy_rate = 9.80665 * zeta_mps + speed_mps * speed_dot_high_mps2
energy_rate_error = energy_rate_error + min(period / 0.5, 1) * (energy_rate_demand - energy_rate - energy_rate_error)

== throttle if on at 10 Hz ==
underspeed = (speed_mps < 0.9 * AIRSPEED_MIN) * (throttle_out > 0.95 * THR_MAX / 100)
throttle_span = (THR_MAX - THR_MIN) / 100
throttle_per_energy = throttle_span / (TECS_TIME_CONST * energy_rate_span)
throttle_demand = TRIM_THROTTLE / 100
  + (energy_rate_demand + TECS_RLL2THR * (1 / (cos_roll * cos_roll) - 1)) * throttle_span / energy_rate_span
  + throttle_per_energy * (energy_error + TECS_THR_DAMP * energy_rate_error)
throttle_slew = where(THR_SLEWRATE > 0, period * THR_SLEWRATE / 100, 1)
throttle_slewed = clip(clip(throttle_demand, THR_MIN / 100, THR_MAX / 100), throttle_slewed - throttle_slew, throttle_slewed + throttle_slew)
throttle_integral = clip(throttle_integral + period * TECS_INTEG_GAIN * throttle_per_energy * energy_error,
  THR_MIN / 100 - throttle_slewed - 0.1, THR_MAX / 100 - throttle_slewed + 0.1)
throttle_wanted = where(underspeed, THR_MAX / 100, throttle_slewed + throttle_integral)
throttle_out = clip(throttle_wanted, THR_MIN / 100, THR_MAX / 100)

== balance if on at 10 Hz ==
weight = where(underspeed, 2, TECS_SPDWEIGHT)
kinetic_weight = min(weight, 1)
potential_weight = min(2 - weight, 1)
pitch_max_rad = where(TECS_PITCH_MAX > 0, min(TECS_PITCH_MAX, PTCH_LIM_MAX_DEG), PTCH_LIM_MAX_DEG) / 57.29578
pitch_min_rad = where(TECS_PITCH_MIN < 0, max(TECS_PITCH_MIN, PTCH_LIM_MIN_DEG), PTCH_LIM_MIN_DEG) / 57.29578
per_pitch = speed_mps * 9.80665
balance_rate_wanted = potential_weight * 9.80665 * height_dot_mps
  + (potential_weight * potential_error - kinetic_weight * kinetic_error) / TECS_TIME_CONST
balance_rate_demand = clip(balance_rate_wanted, -TECS_SINK_MAX * 9.80665, TECS_CLMB_MAX * 9.80665)
balance_rate = potential_weight * 9.80665 * zeta_mps - kinetic_weight * speed_mps * speed_dot_high_mps2
balance_error = balance_rate_demand - balance_rate
balance_integral = clip(balance_integral + period * TECS_INTEG_GAIN * balance_error,
  pitch_min_rad * per_pitch - balance_rate_demand - TECS_PTCH_DAMP * balance_error,
  pitch_max_rad * per_pitch - balance_rate_demand - TECS_PTCH_DAMP * balance_error)
balance_speed_integral = clip(balance_speed_integral - period * kinetic_weight * kinetic_error / TECS_TIME_CONST,
  -0.25 * (pitch_max_rad - pitch_min_rad) * per_pitch, 0.25 * (pitch_max_rad - pitch_min_rad) * per_pitch)
pitch_wanted_rad = (balance_rate_demand + TECS_PTCH_DAMP * balance_error + balance_integral + balance_speed_integral) / per_pitch
pitch_slew_rad = period * TECS_VERT_ACC / speed_mps
pitch_demand_rad = clip(clip(pitch_wanted_rad, pitch_min_rad, pitch_max_rad),
  pitch_demand_rad - pitch_slew_rad, pitch_demand_rad + pitch_slew_rad)
limited_v = max(airspeed_asked_mps != speed_target_mps, throttle_out != throttle_wanted)
limited_zeta = max(max(zeta_cmd_mps > TECS_CLMB_MAX, zeta_cmd_mps < -TECS_SINK_MAX),
  max(balance_rate_demand != balance_rate_wanted, clip(pitch_wanted_rad, pitch_min_rad, pitch_max_rad) != pitch_wanted_rad))

== attitude if on at 50 Hz ==
# A bank that is asked for from outside is taken over in every loop; only ArduPlane's own navigation is slower.
roll_asked_rad = -atan(v_mps * omega_cmd_radps / (9.80665 * crab_cos))
roll_demand_rad = clip(roll_asked_rad, -roll_max_rad, roll_max_rad)
limited_omega = abs(roll_asked_rad) > roll_max_rad
scaler_wanted = clip(SCALING_SPEED / airspeed_mps, min(0.5, SCALING_SPEED / (2 * AIRSPEED_MAX)),
  max(2, SCALING_SPEED / (0.7 * AIRSPEED_MIN)))
scaler = scaler + period / (period + 0.0795775) * (scaler_wanted - scaler)
scaler2 = scaler * scaler
roll_rate_wanted_radps = (roll_demand_rad - roll_rad) / RLL2SRV_TCONST
roll_rate_max_radps = where(RLL2SRV_RMAX > 0, RLL2SRV_RMAX / 57.29578, 100)
roll_rate_radps = clip(roll_rate_wanted_radps, -roll_rate_max_radps, roll_rate_max_radps)
roll_rate_low_radps = roll_rate_low_radps
  + where(RLL_RATE_FLTT > 0, period / (period + 0.159155 / max(RLL_RATE_FLTT, 0.01)), 1) * (roll_rate_radps - roll_rate_low_radps)
roll_error_radps = roll_rate_low_radps - p_radps
roll_error_rate = roll_error_rate + where(RLL_RATE_FLTD > 0, period / (period + 0.159155 / max(RLL_RATE_FLTD, 0.01)), 1)
  * ((roll_error_radps - roll_error_before) / max(period, 0.001) * (period > 0) - roll_error_rate)
roll_error_before = roll_error_radps
flying = airspeed_mps > AIRSPEED_MIN
roll_integral = clip(roll_integral + period * flying * max(aileron_free, roll_error_radps * roll_integral < 0) * RLL_RATE_I * roll_error_radps,
  -RLL_RATE_IMAX, RLL_RATE_IMAX)
aileron_wanted = 1.2732395 * (RLL_RATE_FF * scaler * roll_rate_low_radps
  + scaler2 * (RLL_RATE_P * roll_error_radps + roll_integral + RLL_RATE_D * roll_error_rate))
aileron_out = clip(aileron_wanted, -1, 1)
aileron_free = aileron_out == aileron_wanted
# Pitch rate of a turn at this bank, none beyond the roll limit's far side.
turn_pitch_radps = PTCH2SRV_RLL * cos(pitch_rad) * 9.80665 / airspeed_mps * abs(tan_roll * sin(roll_rad))
  * clip((1.5707963 - abs(roll_rad)) / max(1.5707963 - ROLL_LIMIT_DEG / 57.29578 - 0.0872665, 0.05), 0, 1)
pitch_rate_wanted_radps = (pitch_demand_rad - pitch_rad) / PTCH2SRV_TCONST + turn_pitch_radps
pitch_rate_radps = clip(pitch_rate_wanted_radps, -where(PTCH2SRV_RMAX_DN > 0, PTCH2SRV_RMAX_DN / 57.29578, 100),
  where(PTCH2SRV_RMAX_UP > 0, PTCH2SRV_RMAX_UP / 57.29578, 100))
pitch_rate_low_radps = pitch_rate_low_radps
  + where(PTCH_RATE_FLTT > 0, period / (period + 0.159155 / max(PTCH_RATE_FLTT, 0.01)), 1) * (pitch_rate_radps - pitch_rate_low_radps)
pitch_error_radps = pitch_rate_low_radps - q_radps
pitch_error_rate = pitch_error_rate + where(PTCH_RATE_FLTD > 0, period / (period + 0.159155 / max(PTCH_RATE_FLTD, 0.01)), 1)
  * ((pitch_error_radps - pitch_error_before) / max(period, 0.001) * (period > 0) - pitch_error_rate)
pitch_error_before = pitch_error_radps
pitch_integral = clip(pitch_integral
  + period * (airspeed_mps > 0.5 * AIRSPEED_MIN) * max(elevator_free, pitch_error_radps * pitch_integral < 0) * PTCH_RATE_I * pitch_error_radps,
  -PTCH_RATE_IMAX, PTCH_RATE_IMAX)
elevator_wanted = -1.2732395 * (PTCH_RATE_FF * scaler * pitch_rate_low_radps
  + scaler2 * (PTCH_RATE_P * pitch_error_radps + pitch_integral + PTCH_RATE_D * pitch_error_rate))
elevator_out = clip(elevator_wanted, -1, 1)
elevator_free = elevator_out == elevator_wanted

== yaw for rudder if on at 50 Hz ==
yaw_rate_error_radps = r_radps - YAW2SRV_RLL * 9.80665 / airspeed_mps * sin(roll_rad)
yaw_rate_low_radps = yaw_rate_low_radps + period * 0.2 * (yaw_rate_error_radps - yaw_rate_low_radps)
rudder_out = clip(-KFF_RDDRMIX * aileron_out + YAW2SRV_DAMP * scaler2 * (yaw_rate_error_radps - yaw_rate_low_radps), -1, 1)

== outputs if on ==
elevator_norm = elevator_out + elevator_probe -> fcs/elevator-cmd-norm
aileron_norm = aileron_out + aileron_probe -> fcs/aileron-cmd-norm
throttle_norm = throttle_out + throttle_probe -> fcs/throttle-cmd-norm

== yaw_output for rudder if on ==
rudder_norm = rudder_out + rudder_probe -> fcs/rudder-cmd-norm
