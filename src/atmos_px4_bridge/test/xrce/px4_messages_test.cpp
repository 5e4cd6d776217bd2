// Layouts of PX4's messages against the published ones (layouts.txt), and against the payloads of the
// session.
#include "atmos_px4_bridge/xrce/px4_messages.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>
#include <set>

#include "atmos_px4_bridge/xrce/topics.h"
#include "session_file.h"

namespace atmos::xrce {
namespace {

constexpr Firmware kAll[] = {Firmware::kPx4Space, Firmware::kPx4_1_16, Firmware::kPx4_1_17,
                             Firmware::kPx4_1_18};

template <class Message>
void add(std::map<std::string, std::function<CdrLayout(Firmware)>>& layouts, const char* name) {
  layouts[name] = layout<Message>;
}

std::map<std::string, std::function<CdrLayout(Firmware)>> all_layouts() {
  std::map<std::string, std::function<CdrLayout(Firmware)>> all;
  add<VehicleOdometry>(all, "VehicleOdometry");
  add<OffboardControlMode>(all, "OffboardControlMode");
  add<ActuatorMotors>(all, "ActuatorMotors");
  add<VehicleThrustSetpoint>(all, "VehicleThrustSetpoint");
  add<VehicleTorqueSetpoint>(all, "VehicleTorqueSetpoint");
  add<VehicleRatesSetpoint>(all, "VehicleRatesSetpoint");
  add<VehicleAttitudeSetpoint>(all, "VehicleAttitudeSetpoint");
  add<TrajectorySetpoint>(all, "TrajectorySetpoint");
  add<VehicleCommand>(all, "VehicleCommand");
  add<VehicleCommandAck>(all, "VehicleCommandAck");
  add<VehicleStatus>(all, "VehicleStatus");
  add<VehicleLocalPosition>(all, "VehicleLocalPosition");
  add<VehicleAttitude>(all, "VehicleAttitude");
  add<VehicleAngularVelocity>(all, "VehicleAngularVelocity");
  add<SensorCombined>(all, "SensorCombined");
  add<TimesyncStatus>(all, "TimesyncStatus");
  add<BatteryStatus>(all, "BatteryStatus");
  return all;
}

TEST(Layouts, EqualThePublishedOnesFieldByField) {
  const auto all = all_layouts();
  std::set<std::pair<std::string, std::string>> seen;
  int hashes = 0;
  std::ifstream file(XRCE_LAYOUTS);
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream in(line);
    std::string type, firmwares, word;
    std::size_t size = 0;
    in >> type >> size >> firmwares;
    std::vector<std::string> fields;
    while (in >> word) fields.push_back(word);
    const std::string hash = fields.back();
    fields.pop_back();
    std::istringstream list(firmwares);
    for (std::string firmware; std::getline(list, firmware, ',');) {
      SCOPED_TRACE(type + " " + firmware);
      seen.emplace(type, firmware);
      const CdrLayout layout = all.at(type)(*firmware_named(firmware));
      EXPECT_EQ(layout.size(), size);
      for (std::size_t i = 0; i < layout.fields().size(); ++i) {
        const auto& field = layout.fields()[i];
        if (field.name == "rest") break;
        ASSERT_LT(i, fields.size());
        EXPECT_EQ(std::to_string(field.offset) + ":" + field.type + ":" + field.name, fields[i]);
      }
      if (type != "BatteryStatus") {
        EXPECT_EQ(layout.fields().size(), fields.size());
      }
      if (hash != "-") {
        EXPECT_EQ(layout.hash(), std::strtoul(hash.c_str(), nullptr, 16));
        ++hashes;
      }
    }
  }
  EXPECT_EQ(seen.size(), all.size() * std::size(kAll))
      << "a message or a firmware without a published layout";
  EXPECT_EQ(hashes, 10 * 4);
}

TEST(Layouts, TopicTableHasTheSizesOfTheLayouts) {
  const auto all = all_layouts();
  for (std::size_t i = 0; i < kTopics; ++i) {
    for (const Firmware firmware : kAll) {
      const Topic topic = static_cast<Topic>(i);
      EXPECT_EQ(all.at(info(topic).type)(firmware).size(), payload_size(topic, firmware)) << info(topic).name;
    }
  }
}

// Payload of the first recorded message to or from an object.
Bytes recorded_payload(unsigned object, bool from_client) {
  for (const auto& recorded : test::load_session()) {
    const Bytes& m = recorded.message;
    constexpr std::size_t kPayload = 12;
    if (recorded.from_client == from_client && m.size() > kPayload && (m[4] == 7 || m[4] == 9) &&
        (m[10] << 8 | m[11]) == static_cast<int>(object))
      return Bytes(m.begin() + kPayload, m.begin() + 8 + (m[6] | m[7] << 8));
  }
  return {};
}

template <class Message>
Message round_trip(unsigned object, bool from_client) {
  const Bytes payload = recorded_payload(object, from_client);
  Message message;
  EXPECT_TRUE(decode({payload.data(), payload.size()}, Firmware::kPx4Space, message)) << payload.size();
  Bytes again = encode(message, Firmware::kPx4Space);
  EXPECT_EQ(again.size(), payload.size());
  if (!from_client) {
    EXPECT_EQ(again, payload);  // the client's padding is not initialised
  }
  return message;
}

TEST(Recorded, PayloadsToPx4AreWrittenByteForByte) {
  const auto odometry = round_trip<VehicleOdometry>(0x8126, false);
  EXPECT_EQ(odometry.timestamp, 1795325325632803u);
  EXPECT_EQ(odometry.position, (F3{2.0f, 1.0f, 2.0f}));
  EXPECT_EQ(odometry.angular_velocity, (F3{0.01f, 0.02f, 0.03f}));
  EXPECT_EQ(odometry.reset_counter, 5);
  EXPECT_EQ(odometry.quality, 88);
  EXPECT_TRUE(round_trip<OffboardControlMode>(0x8086, false).direct_actuator);
  const auto motors = round_trip<ActuatorMotors>(0x8196, false);
  EXPECT_EQ(motors.reversible_flags, 0xFF);
  EXPECT_EQ(motors.control[11], 0.6875f);
  const auto command = round_trip<VehicleCommand>(0x8136, false);
  EXPECT_EQ(command.command, 176u);
  EXPECT_EQ(command.param2, 6.0f);
  EXPECT_EQ(command.param5, 47.5);
  EXPECT_TRUE(command.from_external);
  const auto trajectory = round_trip<TrajectorySetpoint>(0x80E6, false);
  EXPECT_EQ(trajectory.position, (F3{1.0f, 2.0f, 3.0f}));
  EXPECT_EQ(trajectory.attitude, (F4{0.5f, 0.5f, 0.5f, 0.5f}));
  EXPECT_EQ(trajectory.yaw, 1.5f);
}

TEST(Recorded, PayloadsOfPx4AreRead) {
  EXPECT_FLOAT_EQ(round_trip<BatteryStatus>(0x0135, true).voltage_v, 14.8f);
  const auto status = round_trip<VehicleStatus>(0x10B5, true);
  EXPECT_EQ(status.arming_state, 2);
  EXPECT_EQ(status.nav_state, 14);
  EXPECT_TRUE(status.pre_flight_checks_pass || status.calibration_enabled);
  const auto odometry = round_trip<VehicleOdometry>(0x1065, true);
  EXPECT_EQ(odometry.position[0], 0.5f);
  EXPECT_EQ(odometry.q[0], 1.0f);
}

TEST(Decoding, TakesTheExactLengthOnly) {
  VehicleStatus status;
  for (const Firmware firmware : kAll) {
    for (std::size_t size = 0; size < 100; ++size) {
      const Bytes payload(size, 1);
      EXPECT_EQ(decode({payload.data(), size}, firmware, status),
                size == payload_size(Topic::kStatus, firmware));
    }
  }
}

TEST(Topics, NamesAndVersionsTellTheFirmware) {
  using Kind = TopicMatch::Kind;
  const auto kind = [](const char* name, const char* type, Firmware firmware) {
    return match_topic(name, "px4_msgs::msg::dds_::" + std::string(type) + "_", firmware).kind;
  };
  EXPECT_EQ(kind("rt/fmu/out/vehicle_status", "VehicleStatus", Firmware::kPx4Space), Kind::kWanted);
  EXPECT_EQ(kind("rt/uav_1/fmu/out/vehicle_status_v4", "VehicleStatus", Firmware::kPx4_1_18), Kind::kWanted);
  EXPECT_EQ(kind("rt/fmu/out/vehicle_status_v1", "VehicleStatus", Firmware::kPx4Space), Kind::kContradiction);
  EXPECT_EQ(kind("rt/fmu/out/vehicle_status", "VehicleStatus", Firmware::kPx4_1_16), Kind::kContradiction);
  EXPECT_EQ(kind("rt/fmu/in/vehicle_attitude_setpoint_v1", "VehicleAttitudeSetpoint", Firmware::kPx4_1_16),
            Kind::kContradiction);
  EXPECT_EQ(kind("rt/fmu/in/trajectory_setpoint", "TrajectorySetpoint6dof", Firmware::kPx4Space),
            Kind::kContradiction);
  // Others' topics, the wrong direction, and no topics at all.
  for (const char* name :
       {"rt/fmu/out/vehicle_odometry", "rt/fmu/in/vehicle_status", "vehicle_status", "/fmu/in/", "",
        "rt/fmu/in/offboard_control_mode_v", "rt/fmu/in/_v99999999999999999999"})
    EXPECT_EQ(kind(name, "VehicleOdometry", Firmware::kPx4Space), Kind::kUnknown) << name;
  // Any two firmwares contradict each other in the name of a topic, so a wrong key is always found out.
  for (const Firmware a : kAll) {
    for (const Firmware b : kAll) {
      bool differ = false;
      for (std::size_t i = 0; i < kTopics; ++i)
        differ |= version(static_cast<Topic>(i), a) != version(static_cast<Topic>(i), b);
      EXPECT_EQ(differ, a != b);
    }
  }
}

}  // namespace
}  // namespace atmos::xrce
