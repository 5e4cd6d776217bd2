// The topics that are wanted of PX4, their names and versions by firmware.
#pragma once

#include <cstddef>
#include <string>

#include "atmos_px4_bridge/xrce/px4_messages.h"

namespace atmos::xrce {

// PX4 reads the first nine (fmu/in) and writes the others (fmu/out).
enum class Topic {
  kVisualOdometry,
  kOffboardControlMode,
  kActuatorMotors,
  kThrustSetpoint,
  kTorqueSetpoint,
  kRatesSetpoint,
  kAttitudeSetpoint,
  kTrajectorySetpoint,
  kCommand,
  kStatus,
  kLocalPosition,
  kAttitude,
  kAngularVelocity,
  kBattery,
  kImu,
  kCommandAck,
  kTimesyncStatus,
  kCount
};
constexpr std::size_t kTopics = static_cast<std::size_t>(Topic::kCount);

struct TopicInfo {
  const char* name;  // behind fmu/in/ or fmu/out/, without a version
  const char* type;  // of px4_msgs
  bool read_by_px4;
  int version[4];       // by firmware; 0: the name has no suffix
  std::size_t size[4];  // of the payload, bytes
};
const TopicInfo& info(Topic topic);

inline std::size_t index(Topic topic) { return static_cast<std::size_t>(topic); }
inline std::size_t payload_size(Topic topic, Firmware firmware) {
  return info(topic).size[static_cast<std::size_t>(firmware)];
}
inline int version(Topic topic, Firmware firmware) {
  return info(topic).version[static_cast<std::size_t>(firmware)];
}

// What a topic name of PX4 stands for: rt/[namespace/]fmu/in|out/NAME[_vN].
struct TopicMatch {
  enum class Kind { kUnknown, kWanted, kContradiction } kind = Kind::kUnknown;
  Topic topic = Topic::kCount;
  std::string fault;  // of a contradiction to the firmware: what was seen and what was expected
};
TopicMatch match_topic(const std::string& name, const std::string& type, Firmware firmware);

}  // namespace atmos::xrce
