#include "atmos_px4_bridge/xrce/topics.h"

#include <cctype>

namespace atmos::xrce {

namespace {

// Lengths stand here a second time, apart from the layouts, so that either is checked by the other.
constexpr TopicInfo kTable[kTopics] = {
    {"vehicle_visual_odometry", "VehicleOdometry", true, {0, 0, 0, 0}, {114, 114, 114, 114}},
    {"offboard_control_mode", "OffboardControlMode", true, {0, 0, 0, 0}, {15, 15, 15, 15}},
    {"actuator_motors", "ActuatorMotors", true, {0, 0, 0, 0}, {68, 68, 68, 68}},
    {"vehicle_thrust_setpoint", "VehicleThrustSetpoint", true, {0, 0, 0, 0}, {28, 28, 28, 28}},
    {"vehicle_torque_setpoint", "VehicleTorqueSetpoint", true, {0, 0, 0, 0}, {28, 28, 28, 28}},
    {"vehicle_rates_setpoint", "VehicleRatesSetpoint", true, {0, 0, 0, 0}, {33, 33, 33, 33}},
    {"vehicle_attitude_setpoint", "VehicleAttitudeSetpoint", true, {0, 0, 1, 1}, {54, 42, 40, 40}},
    {"trajectory_setpoint", "TrajectorySetpoint", true, {0, 0, 0, 0}, {92, 64, 64, 64}},
    {"vehicle_command", "VehicleCommand", true, {0, 0, 0, 0}, {56, 56, 56, 56}},
    {"vehicle_status", "VehicleStatus", false, {0, 1, 1, 4}, {82, 80, 80, 83}},
    {"vehicle_local_position", "VehicleLocalPosition", false, {0, 0, 1, 1}, {200, 216, 216, 216}},
    {"vehicle_attitude", "VehicleAttitude", false, {0, 0, 0, 0}, {49, 49, 49, 49}},
    {"vehicle_angular_velocity", "VehicleAngularVelocity", false, {0, 0, 0, 0}, {40, 40, 40, 40}},
    {"battery_status", "BatteryStatus", false, {0, 0, 1, 1}, {176, 180, 176, 176}},
    {"sensor_combined", "SensorCombined", false, {0, 0, 0, 0}, {48, 48, 48, 48}},
    {"vehicle_command_ack", "VehicleCommandAck", false, {0, 0, 0, 1}, {25, 25, 25, 25}},
    {"timesync_status", "TimesyncStatus", false, {0, 0, 0, 0}, {44, 44, 44, 44}},
};

// Takes the suffix _vN off a name; 0 without one.
int take_version(std::string& name) {
  std::size_t digits = name.size();
  while (digits > 0 && std::isdigit(static_cast<unsigned char>(name[digits - 1])) != 0) --digits;
  const std::size_t count = name.size() - digits;
  if (count == 0 || count > 3 || digits < 2 || name.compare(digits - 2, 2, "_v") != 0) return 0;
  const int version = std::stoi(name.substr(digits));
  name.resize(digits - 2);
  return version;
}

}  // namespace

const TopicInfo& info(Topic topic) { return kTable[index(topic)]; }

TopicMatch match_topic(const std::string& full_name, const std::string& type, Firmware firmware) {
  const std::size_t last = full_name.rfind('/');
  if (last == std::string::npos) return {};
  const std::string folder = full_name.substr(0, last + 1);
  const auto ends_with = [&folder](const std::string& end) {
    return folder.size() > end.size() && folder.compare(folder.size() - end.size(), end.size(), end) == 0;
  };
  const bool in = ends_with("/fmu/in/"), out = ends_with("/fmu/out/");
  if (!in && !out) return {};
  std::string name = full_name.substr(last + 1);
  const int seen = take_version(name);
  for (std::size_t i = 0; i < kTopics; ++i) {
    if (kTable[i].read_by_px4 != in || name != kTable[i].name) continue;
    const Topic topic = static_cast<Topic>(i);
    const int expected = version(topic, firmware);
    const auto text = [](int number) {
      return number == 0 ? "no version" : "version " + std::to_string(number);
    };
    if (seen != expected)
      return {TopicMatch::Kind::kContradiction, topic,
              name + " has " + text(seen) + "; " + name_of(firmware) + " has " + text(expected)};
    if (type != "px4_msgs::msg::dds_::" + std::string(kTable[i].type) + "_")
      return {TopicMatch::Kind::kContradiction, topic, name + " is of type " + type};
    return {TopicMatch::Kind::kWanted, topic, {}};
  }
  return {};
}

}  // namespace atmos::xrce
