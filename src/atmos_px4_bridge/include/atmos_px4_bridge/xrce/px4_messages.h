// The PX4 messages that cross the line, with the layouts of each firmware. Equal names hide different layouts
// (docs/xrce.md, "Firmware"). Field names and order are those of PX4's message definitions; world NED, body
// FRD; stamps are microseconds of our clock.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "atmos_px4_bridge/xrce/cdr.h"

namespace atmos::xrce {

// px4space: DISCOWER/PX4-Space-Systems. The others are releases of PX4.
enum class Firmware { kPx4Space, kPx4_1_16, kPx4_1_17, kPx4_1_18 };

std::vector<std::string> firmware_names();
std::optional<Firmware> firmware_named(const std::string& name);
const char* name_of(Firmware firmware);

using F3 = std::array<float, 3>;
using F4 = std::array<float, 4>;

struct VehicleOdometry {
  std::uint64_t timestamp = 0, timestamp_sample = 0;
  std::uint8_t pose_frame = 0;
  F3 position{};
  F4 q{};
  std::uint8_t velocity_frame = 0;
  F3 velocity{}, angular_velocity{}, position_variance{}, orientation_variance{}, velocity_variance{};
  std::uint8_t reset_counter = 0;
  std::int8_t quality = 0;
};

struct OffboardControlMode {
  std::uint64_t timestamp = 0;
  bool position = false, velocity = false, acceleration = false, attitude = false, body_rate = false,
       thrust_and_torque = false, direct_actuator = false;
};

struct ActuatorMotors {
  std::uint64_t timestamp = 0, timestamp_sample = 0;
  std::uint16_t reversible_flags = 0;
  std::array<float, 12> control{};
};

struct VehicleThrustSetpoint {
  std::uint64_t timestamp = 0, timestamp_sample = 0;
  F3 xyz{};
};
struct VehicleTorqueSetpoint : VehicleThrustSetpoint {};

struct VehicleRatesSetpoint {
  std::uint64_t timestamp = 0;
  float roll = 0, pitch = 0, yaw = 0;
  F3 thrust_body{};
  bool reset_integral = false;
};

struct VehicleAttitudeSetpoint {
  std::uint64_t timestamp = 0;
  float roll_body = 0, pitch_body = 0, yaw_body = 0, yaw_sp_move_rate = 0;
  F4 q_d{};
  F3 thrust_body{};
  bool reset_integral = false, fw_control_yaw_wheel = false;
};

struct TrajectorySetpoint {
  std::uint64_t timestamp = 0;
  F3 position{}, velocity{}, acceleration{}, jerk{};
  F4 attitude{};
  F3 angular_velocity{};
  float yaw = 0, yawspeed = 0;
};

struct VehicleCommand {
  std::uint64_t timestamp = 0;
  float param1 = 0, param2 = 0, param3 = 0, param4 = 0;
  double param5 = 0, param6 = 0;
  float param7 = 0;
  std::uint32_t command = 0;
  std::uint8_t target_system = 0, target_component = 0, source_system = 0;
  std::uint16_t source_component = 0;
  std::uint8_t confirmation = 0;
  bool from_external = false;
};

struct VehicleCommandAck {
  std::uint64_t timestamp = 0;
  std::uint32_t command = 0;
  std::uint8_t result = 0, result_param1 = 0;
  std::int32_t result_param2 = 0;
  std::uint8_t target_system = 0;
  std::uint16_t target_component = 0;
  bool from_external = false;
};

struct VehicleStatus {
  std::uint64_t timestamp = 0, armed_time = 0, takeoff_time = 0;
  std::uint8_t arming_state = 0, latest_arming_reason = 0, latest_disarming_reason = 0;
  std::uint64_t nav_state_timestamp = 0;
  std::uint8_t nav_state_user_intention = 0, nav_state = 0, executor_in_charge = 0;
  std::uint8_t nav_state_display = 0;
  bool accepts_offboard_setpoints = false;
  std::uint32_t valid_nav_states_mask = 0, can_set_nav_states_mask = 0;
  std::uint16_t failure_detector_status = 0;
  std::uint8_t hil_state = 0, vehicle_type = 0;
  bool failsafe = false, failsafe_and_user_took_over = false;
  std::uint8_t failsafe_defer_state = 0;
  bool gcs_connection_lost = false;
  std::uint8_t gcs_connection_lost_counter = 0;
  bool high_latency_data_link_lost = false, is_vtol = false, is_vtol_tailsitter = false,
       in_transition_mode = false, in_transition_to_fw = false;
  std::uint8_t system_type = 0, system_id = 0, component_id = 0;
  bool safety_button_available = false, safety_off = false, power_input_valid = false, usb_connected = false,
       open_drone_id_system_present = false, open_drone_id_system_healthy = false,
       parachute_system_present = false, parachute_system_healthy = false,
       traffic_avoidance_system_present = false, avoidance_system_required = false,
       avoidance_system_valid = false, rc_calibration_in_progress = false, calibration_enabled = false,
       pre_flight_checks_pass = false;
};

struct VehicleLocalPosition {
  std::uint64_t timestamp = 0, timestamp_sample = 0;
  bool xy_valid = false, z_valid = false, v_xy_valid = false, v_z_valid = false;
  float x = 0, y = 0, z = 0;
  std::array<float, 2> delta_xy{};
  std::uint8_t xy_reset_counter = 0;
  float delta_z = 0;
  std::uint8_t z_reset_counter = 0;
  float vx = 0, vy = 0, vz = 0, z_deriv = 0;
  std::array<float, 2> delta_vxy{};
  std::uint8_t vxy_reset_counter = 0;
  float delta_vz = 0;
  std::uint8_t vz_reset_counter = 0;
  float ax = 0, ay = 0, az = 0, heading = 0, heading_var = 0, unaided_heading = 0, delta_heading = 0;
  std::uint8_t heading_reset_counter = 0;
  bool heading_good_for_control = false;
  float tilt_var = 0;
  bool xy_global = false, z_global = false;
  std::uint64_t ref_timestamp = 0;
  double ref_lat = 0, ref_lon = 0;
  float ref_alt = 0, dist_bottom = 0;
  bool dist_bottom_valid = false;
  float dist_bottom_var = 0, delta_dist_bottom = 0;
  std::uint8_t dist_bottom_reset_counter = 0, dist_bottom_sensor_bitfield = 0;
  float eph = 0, epv = 0, evh = 0, evv = 0;
  bool dead_reckoning = false;
  float vxy_max = 0, vz_max = 0, hagl_min = 0, hagl_max = 0, hagl_max_z = 0, hagl_max_xy = 0;
};

struct VehicleAttitude {
  std::uint64_t timestamp = 0, timestamp_sample = 0;
  F4 q{}, delta_q_reset{};
  std::uint8_t quat_reset_counter = 0;
};

struct VehicleAngularVelocity {
  std::uint64_t timestamp = 0, timestamp_sample = 0;
  F3 xyz{}, xyz_derivative{};
};

struct SensorCombined {
  std::uint64_t timestamp = 0;
  F3 gyro_rad{};
  std::uint32_t gyro_integral_dt = 0;
  std::int32_t accelerometer_timestamp_relative = 0;
  F3 accelerometer_m_s2{};
  std::uint32_t accelerometer_integral_dt = 0;
  std::uint8_t accelerometer_clipping = 0, gyro_clipping = 0, accel_calibration_count = 0,
               gyro_calibration_count = 0;
};

struct TimesyncStatus {
  std::uint64_t timestamp = 0;
  std::uint8_t source_protocol = 0;
  std::uint64_t remote_timestamp = 0;
  std::int64_t observed_offset = 0, estimated_offset = 0;
  std::uint32_t round_trip_time = 0;
};

// As far as it is used; what follows is read over, and its length is checked.
struct BatteryStatus {
  std::uint64_t timestamp = 0;
  bool connected = false;
  float voltage_v = 0, voltage_filtered_v = 0, current_a = 0, current_filtered_a = 0, current_average_a = 0,
        discharged_mah = 0, remaining = 0;
};

// A payload in the layout of `firmware`.
template <class Message>
Bytes encode(const Message& message, Firmware firmware);
// False unless the payload has exactly the length of the layout.
template <class Message>
bool decode(ByteView payload, Firmware firmware, Message& message);
template <class Message>
CdrLayout layout(Firmware firmware);

}  // namespace atmos::xrce
