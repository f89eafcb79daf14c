# What an autopilot senses: the equations that stand between JSBSim's properties and the autopilot's.
# A channel's rate is filled in from [sensors]; equations that an autopilot does not need are left out.

use step_s = simulation/dt
use true_east_fps = velocities/v-east-fps
use true_north_fps = velocities/v-north-fps
use true_climb_fps = velocities/h-dot-fps
use true_airspeed_sensed_fps = velocities/vt-fps
use true_qbar_psf = aero/qbar-psf
use true_wind_east_fps = atmosphere/total-wind-east-fps
use true_wind_north_fps = atmosphere/total-wind-north-fps
use true_wind_down_fps = atmosphere/total-wind-down-fps
use true_alpha_rad = aero/alpha-rad
use true_beta_rad = aero/beta-rad
use true_nx = accelerations/Nx
use true_ny = accelerations/Ny
use true_nz = accelerations/Nz
use true_p_radps = velocities/p-rad_sec
use true_q_radps = velocities/q-rad_sec
use true_r_radps = velocities/r-rad_sec
use true_height_ft = position/h-sl-ft

# Commands as they arrive: sent at a rate, and late.
== command_sent at {command_rate_hz} Hz ==
sent_v_mps = v_cmd_mps
sent_omega_radps = omega_cmd_radps
sent_zeta_mps = zeta_cmd_mps

{command_delay}
# Velocity: inertial sensors carry the estimate from one measurement of GPS to the next, so only its error has a lag.
== gps_motion at 25 Hz ==
late_east_fps = late_east_fps + where(on, period / (period + sensor_gps_latency_error_s + 1e-9), 1) * (true_east_fps - late_east_fps)
late_north_fps = late_north_fps + where(on, period / (period + sensor_gps_latency_error_s + 1e-9), 1) * (true_north_fps - late_north_fps)
late_climb_fps = late_climb_fps + where(on, period / (period + sensor_gps_latency_error_s + 1e-9), 1) * (true_climb_fps - late_climb_fps)

== gps at {gps_rate_hz} Hz ==
gps_east_fps = late_east_fps - true_east_fps + on * sensor_gps_noise_mps / 0.3048 * normal()
gps_north_fps = late_north_fps - true_north_fps + on * sensor_gps_noise_mps / 0.3048 * normal()
gps_climb_fps = late_climb_fps - true_climb_fps + on * sensor_gps_noise_mps / 0.3048 * normal()
gps_age_s = 0

== estimate at 25 Hz ==
gps_age_s = gps_age_s + period
gps_arrived = max(gps_age_s > sensor_gps_latency_s, 1 - on)
known_east_fps = where(gps_arrived, gps_east_fps, known_east_fps)
known_north_fps = where(gps_arrived, gps_north_fps, known_north_fps)
known_climb_fps = where(gps_arrived, gps_climb_fps, known_climb_fps)
off_east_fps = off_east_fps + where(on, period / (period + sensor_ekf_lag_s + 1e-9), 1) * (known_east_fps - off_east_fps)
off_north_fps = off_north_fps + where(on, period / (period + sensor_ekf_lag_s + 1e-9), 1) * (known_north_fps - off_north_fps)
off_climb_fps = off_climb_fps + where(on, period / (period + sensor_ekf_lag_s + 1e-9), 1) * (known_climb_fps - off_climb_fps)

== velocity ==
seen_east_fps = true_east_fps + off_east_fps
seen_north_fps = true_north_fps + off_north_fps
seen_climb_fps = true_climb_fps + off_climb_fps
seen_ground_fps = sqrt(seen_east_fps * seen_east_fps + seen_north_fps * seen_north_fps)

== airspeed at {airspeed_rate_hz} Hz ==
seen_airspeed_fps = seen_airspeed_fps + where(on, period / (period + sensor_airspeed_lag_s + 1e-9), 1)
  * (true_airspeed_sensed_fps + on * sensor_airspeed_noise_mps / 0.3048 * normal() - seen_airspeed_fps)
seen_qbar_psf = true_qbar_psf * seen_airspeed_fps * seen_airspeed_fps
  / max(true_airspeed_sensed_fps * true_airspeed_sensed_fps, 1)

== baro at {baro_rate_hz} Hz ==
seen_height_ft = seen_height_ft + where(on, period / (period + sensor_baro_lag_s + 1e-9), 1)
  * (true_height_ft + on * sensor_baro_noise_m / 0.3048 * normal() - seen_height_ft)

== wind at 5 Hz ==
seen_wind_east_fps = seen_wind_east_fps + where(on, period / (period + sensor_wind_lag_s + 1e-9), 1) * (true_wind_east_fps - seen_wind_east_fps)
seen_wind_north_fps = seen_wind_north_fps + where(on, period / (period + sensor_wind_lag_s + 1e-9), 1) * (true_wind_north_fps - seen_wind_north_fps)
seen_wind_down_fps = seen_wind_down_fps + where(on, period / (period + sensor_wind_lag_s + 1e-9), 1) * (true_wind_down_fps - seen_wind_down_fps)

# What a first-order lag lets through in one evaluation.
== shares at 25 Hz ==
gyro_share = where(on, step_s / (step_s + sensor_gyro_lag_s + 1e-9), 1)
load_share = where(on, 2 * step_s / (2 * step_s + sensor_accelerometer_lag_s + 1e-9), 1)

== inertial ==
seen_p_radps = seen_p_radps + gyro_share * (true_p_radps - seen_p_radps)
seen_q_radps = seen_q_radps + gyro_share * (true_q_radps - seen_q_radps)
seen_r_radps = seen_r_radps + gyro_share * (true_r_radps - seen_r_radps)

== loads every 2 ==
seen_nx = seen_nx + load_share * (true_nx - seen_nx)
seen_ny = seen_ny + load_share * (true_ny - seen_ny)
seen_nz = seen_nz + load_share * (true_nz - seen_nz)

== angles every 2 ==
{alpha}
{beta}
