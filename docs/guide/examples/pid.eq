# An autopilot of PID loops: bank for the turn, pitch for the climb, throttle for the speed.

use east_fps = velocities/v-east-fps
use north_fps = velocities/v-north-fps
use ground_fps = velocities/vg-fps
use climb_fps = velocities/h-dot-fps
use roll_rad = attitude/phi-rad
use pitch_rad = attitude/theta-rad
use p_radps = velocities/p-rad_sec
use q_radps = velocities/q-rad_sec
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

parameter BANK_MAX = 0.7 [rad] 0.3 to 1.2: largest bank asked for
parameter ROLL_P = 0.6 [1/rad] 0.1 to 2: aileron per error in roll
parameter ROLL_D = 0.02 [s/rad] 0 to 0.2: aileron against the roll rate
parameter ROLL_I = 0.1 [1/rad/s] 0 to 1: aileron per error in roll and second
parameter CLIMB_P = 0.06 [rad s/m] 0 to 0.2: pitch per error in climb rate
parameter CLIMB_I = 0.04 [rad/m] 0 to 0.2: pitch per error in climb rate and second
parameter PITCH_P = 1.2 [1/rad] 0.1 to 3: elevator, trailing edge up, per error in pitch
parameter PITCH_D = 0.08 [s/rad] 0 to 0.5: elevator against the pitch rate
parameter PITCH_I = 0.4 [1/rad/s] 0 to 2: elevator per error in pitch and second
parameter SPEED_P = 0.15 [s/m] 0 to 1: throttle per error in ground speed
parameter SPEED_I = 0.05 [1/m] 0 to 0.5: throttle per error in ground speed and second

== measure ==
tracking = 1 - on
v_mps = max(0.3048 * ground_fps, 1)
zeta_mps = 0.3048 * climb_fps
omega_radps = omega_radps + min(period / 0.02, 1)
  * (0.3048 * (east_mps * north_fps - north_mps * east_fps) / (v_mps * v_mps * max(period, 1e-6)) - omega_radps)
east_mps = 0.3048 * east_fps
north_mps = 0.3048 * north_fps
roll_target_rad = clip(-atan(v_mps * omega_cmd_radps / 9.80665), -BANK_MAX, BANK_MAX)
limited_omega = abs(v_mps * omega_cmd_radps / 9.80665) > BANK_MAX

== track if tracking ==
pitch_held_rad = pitch_rad
elevator_held = elevator_now
aileron_held = aileron_now
throttle_held = throttle_now

== fly if on ==
roll_error_rad = roll_target_rad - roll_rad
aileron_held = clip(aileron_held + period * ROLL_I * roll_error_rad, -0.5, 0.5)
aileron_norm = clip(aileron_held + ROLL_P * roll_error_rad - ROLL_D * p_radps, -1, 1)
  + aileron_probe -> fcs/aileron-cmd-norm
zeta_error_mps = zeta_cmd_mps - zeta_mps
pitch_held_rad = clip(pitch_held_rad + period * CLIMB_I * zeta_error_mps, -0.3, 0.4)
pitch_error_rad = pitch_held_rad + CLIMB_P * zeta_error_mps - pitch_rad
elevator_held = clip(elevator_held - period * PITCH_I * pitch_error_rad, -0.6, 0.6)
elevator_norm = clip(elevator_held - PITCH_P * pitch_error_rad + PITCH_D * q_radps, -1, 1)
  + elevator_probe -> fcs/elevator-cmd-norm
v_error_mps = v_cmd_mps - v_mps
throttle_held = clip(throttle_held + period * SPEED_I * v_error_mps, 0, 1)
throttle_wanted = throttle_held + SPEED_P * v_error_mps
throttle_norm = clip(throttle_wanted, 0, 1) + throttle_probe -> fcs/throttle-cmd-norm
limited_v = clip(throttle_wanted, 0, 1) != throttle_wanted
limited_zeta = abs(pitch_held_rad - 0.05) > 0.34
