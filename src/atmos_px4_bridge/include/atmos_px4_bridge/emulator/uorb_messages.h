// PX4Space's messages as its structures lie in memory: what its uxrce_dds_client copies to and from the line,
// without a check. Written independently of the codec in xrce/. World NED, body FRD; timestamps in
// microseconds.
#pragma once

#include <cstddef>
#include <cstdint>

namespace atmos::uorb {

struct VehicleOdometry {
  std::uint64_t timestamp, timestamp_sample;
  std::uint8_t pose_frame;
  float position[3], q[4];
  std::uint8_t velocity_frame;
  float velocity[3], angular_velocity[3], position_variance[3], orientation_variance[3], velocity_variance[3];
  std::uint8_t reset_counter;
  std::int8_t quality;
  static constexpr std::size_t kWire = 114;
};
static_assert(offsetof(VehicleOdometry, quality) == 113);

struct OffboardControlMode {
  std::uint64_t timestamp;
  bool position, velocity, acceleration, attitude, body_rate, thrust_and_torque, direct_actuator;
  static constexpr std::size_t kWire = 15;
};
static_assert(offsetof(OffboardControlMode, direct_actuator) == 14);

struct ActuatorMotors {
  std::uint64_t timestamp, timestamp_sample;
  std::uint16_t reversible_flags;
  float control[12];
  static constexpr std::size_t kWire = 68;
};
static_assert(offsetof(ActuatorMotors, control) == 20);

struct VectorSetpoint {  // vehicle_thrust_setpoint, vehicle_torque_setpoint
  std::uint64_t timestamp, timestamp_sample;
  float xyz[3];
  static constexpr std::size_t kWire = 28;
};

struct RatesSetpoint {
  std::uint64_t timestamp;
  float roll, pitch, yaw, thrust_body[3];
  bool reset_integral;
  static constexpr std::size_t kWire = 33;
};
static_assert(offsetof(RatesSetpoint, reset_integral) == 32);

struct AttitudeSetpoint {
  std::uint64_t timestamp;
  float roll_body, pitch_body, yaw_body, yaw_sp_move_rate, q_d[4], thrust_body[3];
  bool reset_integral, fw_control_yaw_wheel;
  static constexpr std::size_t kWire = 54;
};
static_assert(offsetof(AttitudeSetpoint, fw_control_yaw_wheel) == 53);

struct TrajectorySetpoint {
  std::uint64_t timestamp;
  float position[3], velocity[3], acceleration[3], jerk[3], attitude[4], angular_velocity[3], yaw, yawspeed;
  static constexpr std::size_t kWire = 92;
};
static_assert(offsetof(TrajectorySetpoint, yawspeed) == 88);

struct VehicleCommand {
  std::uint64_t timestamp;
  float param1, param2, param3, param4;
  double param5, param6;
  float param7;
  std::uint32_t command;
  std::uint8_t target_system, target_component, source_system;
  std::uint16_t source_component;
  std::uint8_t confirmation;
  bool from_external;
  static constexpr std::size_t kWire = 56;
};
static_assert(offsetof(VehicleCommand, from_external) == 55);

struct VehicleCommandAck {
  std::uint64_t timestamp;
  std::uint32_t command;
  std::uint8_t result, result_param1;
  std::int32_t result_param2;
  std::uint8_t target_system;
  std::uint16_t target_component;
  bool from_external;
  static constexpr std::size_t kWire = 25;
};
static_assert(offsetof(VehicleCommandAck, from_external) == 24);

struct VehicleStatus {
  std::uint64_t timestamp, armed_time, takeoff_time;
  std::uint8_t arming_state, latest_arming_reason, latest_disarming_reason;
  std::uint64_t nav_state_timestamp;
  std::uint8_t nav_state_user_intention, nav_state, executor_in_charge;
  std::uint32_t valid_nav_states_mask, can_set_nav_states_mask;
  std::uint16_t failure_detector_status;
  std::uint8_t hil_state, vehicle_type;
  std::uint8_t flags[25];  // failsafe ... calibration_enabled
  bool pre_flight_checks_pass;
  static constexpr std::size_t kWire = 82;
};
static_assert(offsetof(VehicleStatus, nav_state) == 41 &&
              offsetof(VehicleStatus, pre_flight_checks_pass) == 81);

struct VehicleAttitude {
  std::uint64_t timestamp, timestamp_sample;
  float q[4], delta_q_reset[4];
  std::uint8_t quat_reset_counter;
  static constexpr std::size_t kWire = 49;
};

struct VehicleAngularVelocity {
  std::uint64_t timestamp, timestamp_sample;
  float xyz[3], xyz_derivative[3];
  static constexpr std::size_t kWire = 40;
};

struct SensorCombined {
  std::uint64_t timestamp;
  float gyro_rad[3];
  std::uint32_t gyro_integral_dt;
  std::int32_t accelerometer_timestamp_relative;
  float accelerometer_m_s2[3];
  std::uint32_t accelerometer_integral_dt;
  std::uint8_t counts[4];
  static constexpr std::size_t kWire = 48;
};
static_assert(offsetof(SensorCombined, counts) == 44);

struct VehicleLocalPosition {
  std::uint64_t timestamp, timestamp_sample;
  bool xy_valid, z_valid, v_xy_valid, v_z_valid;
  float x, y, z, delta_xy[2];
  std::uint8_t xy_reset_counter;
  float delta_z;
  std::uint8_t z_reset_counter;
  float vx, vy, vz;
  std::uint8_t rest[136];  // z_deriv ... hagl_max
  static constexpr std::size_t kWire = 200;
};
static_assert(offsetof(VehicleLocalPosition, vx) == 52 && offsetof(VehicleLocalPosition, rest) == 64);

struct BatteryStatus {
  std::uint64_t timestamp;
  bool connected;
  float voltage_v, voltage_filtered_v, current_a, current_filtered_a, current_average_a, discharged_mah,
      remaining;
  std::uint8_t rest[136];
  static constexpr std::size_t kWire = 176;
};
static_assert(offsetof(BatteryStatus, remaining) == 36 && offsetof(BatteryStatus, rest) == 40);

struct TimesyncStatus {
  std::uint64_t timestamp;
  std::uint8_t source_protocol;
  std::uint64_t remote_timestamp;
  std::int64_t observed_offset, estimated_offset;
  std::uint32_t round_trip_time;
  static constexpr std::size_t kWire = 44;
};
static_assert(offsetof(TimesyncStatus, round_trip_time) == 40);

}  // namespace atmos::uorb
