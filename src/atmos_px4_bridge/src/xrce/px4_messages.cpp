#include "atmos_px4_bridge/xrce/px4_messages.h"

namespace atmos::xrce {

namespace {

constexpr struct {
  Firmware firmware;
  const char* name;
} kFirmwares[] = {{Firmware::kPx4Space, "px4space"},
                  {Firmware::kPx4_1_16, "px4-1.16"},
                  {Firmware::kPx4_1_17, "px4-1.17"},
                  {Firmware::kPx4_1_18, "px4-1.18"}};

bool fork(Firmware firmware) { return firmware == Firmware::kPx4Space; }
bool v16(Firmware firmware) { return firmware == Firmware::kPx4_1_16; }
bool v18(Firmware firmware) { return firmware == Firmware::kPx4_1_18; }

// FIELD(x) hands the field x of the message m to the archive a.
#define FIELD(field) a(#field, m.field)

template <class A>
void visit(A& a, VehicleOdometry& m, Firmware) {
  FIELD(timestamp), FIELD(timestamp_sample), FIELD(pose_frame), FIELD(position), FIELD(q);
  FIELD(velocity_frame), FIELD(velocity), FIELD(angular_velocity), FIELD(position_variance);
  FIELD(orientation_variance), FIELD(velocity_variance), FIELD(reset_counter), FIELD(quality);
}

template <class A>
void visit(A& a, OffboardControlMode& m, Firmware) {
  FIELD(timestamp), FIELD(position), FIELD(velocity), FIELD(acceleration), FIELD(attitude), FIELD(body_rate);
  FIELD(thrust_and_torque), FIELD(direct_actuator);
}

template <class A>
void visit(A& a, ActuatorMotors& m, Firmware) {
  FIELD(timestamp), FIELD(timestamp_sample), FIELD(reversible_flags), FIELD(control);
}

template <class A>
void visit(A& a, VehicleThrustSetpoint& m, Firmware) {
  FIELD(timestamp), FIELD(timestamp_sample), FIELD(xyz);
}

template <class A>
void visit(A& a, VehicleRatesSetpoint& m, Firmware) {
  FIELD(timestamp), FIELD(roll), FIELD(pitch), FIELD(yaw), FIELD(thrust_body), FIELD(reset_integral);
}

template <class A>
void visit(A& a, VehicleAttitudeSetpoint& m, Firmware firmware) {
  FIELD(timestamp);
  if (fork(firmware)) FIELD(roll_body), FIELD(pitch_body), FIELD(yaw_body);
  FIELD(yaw_sp_move_rate), FIELD(q_d), FIELD(thrust_body);
  if (fork(firmware) || v16(firmware)) FIELD(reset_integral), FIELD(fw_control_yaw_wheel);
}

template <class A>
void visit(A& a, TrajectorySetpoint& m, Firmware firmware) {
  FIELD(timestamp), FIELD(position), FIELD(velocity), FIELD(acceleration), FIELD(jerk);
  if (fork(firmware)) FIELD(attitude), FIELD(angular_velocity);
  FIELD(yaw), FIELD(yawspeed);
}

template <class A>
void visit(A& a, VehicleCommand& m, Firmware) {
  FIELD(timestamp), FIELD(param1), FIELD(param2), FIELD(param3), FIELD(param4), FIELD(param5), FIELD(param6);
  FIELD(param7), FIELD(command), FIELD(target_system), FIELD(target_component), FIELD(source_system);
  FIELD(source_component), FIELD(confirmation), FIELD(from_external);
}

template <class A>
void visit(A& a, VehicleCommandAck& m, Firmware) {
  FIELD(timestamp), FIELD(command), FIELD(result), FIELD(result_param1), FIELD(result_param2);
  FIELD(target_system), FIELD(target_component), FIELD(from_external);
}

template <class A>
void visit(A& a, VehicleStatus& m, Firmware firmware) {
  FIELD(timestamp), FIELD(armed_time), FIELD(takeoff_time), FIELD(arming_state);
  FIELD(latest_arming_reason), FIELD(latest_disarming_reason), FIELD(nav_state_timestamp);
  FIELD(nav_state_user_intention), FIELD(nav_state), FIELD(executor_in_charge);
  if (v18(firmware)) FIELD(nav_state_display), FIELD(accepts_offboard_setpoints);
  FIELD(valid_nav_states_mask), FIELD(can_set_nav_states_mask);
  if (!v18(firmware)) FIELD(failure_detector_status);
  FIELD(hil_state), FIELD(vehicle_type), FIELD(failsafe), FIELD(failsafe_and_user_took_over);
  FIELD(failsafe_defer_state), FIELD(gcs_connection_lost), FIELD(gcs_connection_lost_counter);
  FIELD(high_latency_data_link_lost), FIELD(is_vtol), FIELD(is_vtol_tailsitter), FIELD(in_transition_mode);
  FIELD(in_transition_to_fw), FIELD(system_type), FIELD(system_id), FIELD(component_id);
  FIELD(safety_button_available), FIELD(safety_off), FIELD(power_input_valid), FIELD(usb_connected);
  FIELD(open_drone_id_system_present), FIELD(open_drone_id_system_healthy), FIELD(parachute_system_present);
  FIELD(parachute_system_healthy);
  if (fork(firmware)) FIELD(avoidance_system_required), FIELD(avoidance_system_valid);
  if (v18(firmware)) FIELD(traffic_avoidance_system_present);
  FIELD(rc_calibration_in_progress), FIELD(calibration_enabled), FIELD(pre_flight_checks_pass);
}

template <class A>
void visit(A& a, VehicleLocalPosition& m, Firmware firmware) {
  FIELD(timestamp), FIELD(timestamp_sample), FIELD(xy_valid), FIELD(z_valid), FIELD(v_xy_valid);
  FIELD(v_z_valid), FIELD(x), FIELD(y), FIELD(z), FIELD(delta_xy), FIELD(xy_reset_counter), FIELD(delta_z);
  FIELD(z_reset_counter), FIELD(vx), FIELD(vy), FIELD(vz), FIELD(z_deriv), FIELD(delta_vxy);
  FIELD(vxy_reset_counter), FIELD(delta_vz), FIELD(vz_reset_counter), FIELD(ax), FIELD(ay), FIELD(az);
  FIELD(heading), FIELD(heading_var), FIELD(unaided_heading), FIELD(delta_heading);
  FIELD(heading_reset_counter), FIELD(heading_good_for_control), FIELD(tilt_var), FIELD(xy_global);
  FIELD(z_global), FIELD(ref_timestamp), FIELD(ref_lat), FIELD(ref_lon), FIELD(ref_alt);
  if (fork(firmware)) {
    FIELD(dist_bottom), FIELD(dist_bottom_valid);
  } else {
    FIELD(dist_bottom_valid), FIELD(dist_bottom), FIELD(dist_bottom_var), FIELD(delta_dist_bottom);
    FIELD(dist_bottom_reset_counter);
  }
  FIELD(dist_bottom_sensor_bitfield), FIELD(eph), FIELD(epv), FIELD(evh), FIELD(evv), FIELD(dead_reckoning);
  FIELD(vxy_max), FIELD(vz_max), FIELD(hagl_min);
  if (fork(firmware)) {
    FIELD(hagl_max);
  } else {
    FIELD(hagl_max_z), FIELD(hagl_max_xy);
  }
}

template <class A>
void visit(A& a, VehicleAttitude& m, Firmware) {
  FIELD(timestamp), FIELD(timestamp_sample), FIELD(q), FIELD(delta_q_reset), FIELD(quat_reset_counter);
}

template <class A>
void visit(A& a, VehicleAngularVelocity& m, Firmware) {
  FIELD(timestamp), FIELD(timestamp_sample), FIELD(xyz), FIELD(xyz_derivative);
}

template <class A>
void visit(A& a, SensorCombined& m, Firmware) {
  FIELD(timestamp), FIELD(gyro_rad), FIELD(gyro_integral_dt), FIELD(accelerometer_timestamp_relative);
  FIELD(accelerometer_m_s2), FIELD(accelerometer_integral_dt), FIELD(accelerometer_clipping);
  FIELD(gyro_clipping), FIELD(accel_calibration_count), FIELD(gyro_calibration_count);
}

template <class A>
void visit(A& a, TimesyncStatus& m, Firmware) {
  FIELD(timestamp), FIELD(source_protocol), FIELD(remote_timestamp), FIELD(observed_offset);
  FIELD(estimated_offset), FIELD(round_trip_time);
}

template <class A>
void visit(A& a, BatteryStatus& m, Firmware firmware) {
  FIELD(timestamp), FIELD(connected), FIELD(voltage_v);
  if (fork(firmware)) FIELD(voltage_filtered_v);
  FIELD(current_a);
  if (fork(firmware)) FIELD(current_filtered_a);
  FIELD(current_average_a), FIELD(discharged_mah), FIELD(remaining);
  const auto skip = [&a](auto rest) { a("rest", rest); };
  if (fork(firmware)) {
    skip(std::array<std::uint8_t, 136>{});
  } else if (v16(firmware)) {
    skip(std::array<std::uint8_t, 148>{});
  } else {
    skip(std::array<std::uint8_t, 144>{});
  }
}

#undef FIELD

}  // namespace

std::vector<std::string> firmware_names() {
  std::vector<std::string> names;
  for (const auto& known : kFirmwares) names.emplace_back(known.name);
  return names;
}

std::optional<Firmware> firmware_named(const std::string& name) {
  for (const auto& known : kFirmwares) {
    if (name == known.name) return known.firmware;
  }
  return std::nullopt;
}

const char* name_of(Firmware firmware) {
  for (const auto& known : kFirmwares) {
    if (firmware == known.firmware) return known.name;
  }
  return "unknown";
}

template <class Message>
Bytes encode(const Message& message, Firmware firmware) {
  Message copy = message;
  CdrWriter writer;
  visit(writer, copy, firmware);
  return std::move(writer.bytes);
}

template <class Message>
bool decode(ByteView payload, Firmware firmware, Message& message) {
  Message out;
  CdrReader reader(payload);
  visit(reader, out, firmware);
  if (!reader.complete()) return false;
  message = out;
  return true;
}

template <class Message>
CdrLayout layout(Firmware firmware) {
  Message message;
  CdrLayout description;
  visit(description, message, firmware);
  return description;
}

#define INSTANTIATE(Message)                                   \
  template Bytes encode<Message>(const Message&, Firmware);    \
  template bool decode<Message>(ByteView, Firmware, Message&); \
  template CdrLayout layout<Message>(Firmware);

INSTANTIATE(VehicleOdometry)
INSTANTIATE(OffboardControlMode)
INSTANTIATE(ActuatorMotors)
INSTANTIATE(VehicleThrustSetpoint)
INSTANTIATE(VehicleTorqueSetpoint)
INSTANTIATE(VehicleRatesSetpoint)
INSTANTIATE(VehicleAttitudeSetpoint)
INSTANTIATE(TrajectorySetpoint)
INSTANTIATE(VehicleCommand)
INSTANTIATE(VehicleCommandAck)
INSTANTIATE(VehicleStatus)
INSTANTIATE(VehicleLocalPosition)
INSTANTIATE(VehicleAttitude)
INSTANTIATE(VehicleAngularVelocity)
INSTANTIATE(SensorCombined)
INSTANTIATE(TimesyncStatus)
INSTANTIATE(BatteryStatus)

#undef INSTANTIATE

}  // namespace atmos::xrce
