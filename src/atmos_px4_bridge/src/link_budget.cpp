#include "atmos_px4_bridge/link_budget.h"

#include "atmos_px4_bridge/mavlink/messages.h"
#include "atmos_px4_bridge/xrce/topics.h"

namespace atmos {

using namespace mavlink;

namespace {

template <class Message>
BudgetRow row(bool to_autopilot, double rate_hz) {
  return {Message::kName, to_autopilot, 10.0 + Message::kSize + 2.0, rate_hz};
}

}  // namespace

std::vector<BudgetRow> mavlink_traffic() {
  return {row<Odometry>(true, 100.0),
          row<SetAttitudeTarget>(true, 60.0),
          row<Timesync>(true, 20.0),
          row<Heartbeat>(true, 1.0),
          row<CommandLong>(true, 1.2),
          row<HighresImu>(false, 50.0),
          row<AttitudeQuaternion>(false, 50.0),
          row<LocalPositionNed>(false, 30.0),
          row<mavlink::Odometry>(false, 30.0),
          row<AttitudeTarget>(false, 10.0),
          row<ServoOutputRaw>(false, 10.0),
          row<SysStatus>(false, 5.0),
          row<ExtendedSysState>(false, 5.0),
          row<BatteryStatus>(false, 1.0),
          row<EstimatorStatus>(false, 1.0),
          row<Timesync>(false, 20.0),
          row<Heartbeat>(false, 1.0),
          row<Statustext>(false, 0.1)};
}

namespace {

// One message of samples: framing 7, header 4, and for each 8 in front, on multiples of four.
double xrce_frame(xrce::Firmware firmware, const std::vector<xrce::Topic>& topics) {
  std::size_t bytes = 0;
  for (const xrce::Topic topic : topics) bytes += 8 + (xrce::payload_size(topic, firmware) + 3) / 4 * 4;
  return 7.0 + 4.0 + static_cast<double>(bytes);
}

}  // namespace

std::vector<BudgetRow> xrce_traffic(xrce::Firmware firmware) {
  using xrce::Topic;
  std::vector<BudgetRow> rows{
      {"visual odometry", true, xrce_frame(firmware, {Topic::kVisualOdometry}), 100.0},
      {"set-point", true, xrce_frame(firmware, {Topic::kOffboardControlMode, Topic::kActuatorMotors}), 60.0},
      {"TIMESTAMP_REPLY", true, 39.0, 1.0},
      {"ACKNACK", true, 20.0, 2.0},
      {"vehicle_odometry", false, 7.0 + 4.0 + 8.0 + 116.0, 100.0},
      {"TIMESTAMP", false, 23.0, 1.0}};
  const auto from = [&](Topic topic, double rate_hz) {
    rows.push_back({xrce::info(topic).name, false, xrce_frame(firmware, {topic}), rate_hz});
  };
  for (const Topic topic : {Topic::kLocalPosition, Topic::kAttitude, Topic::kAngularVelocity, Topic::kImu})
    from(topic, 100.0);
  from(Topic::kStatus, 2.0);
  from(Topic::kBattery, 1.0);
  return rows;
}

double line_load(const std::vector<BudgetRow>& rows, bool to_autopilot) {
  double bytes_per_s = 0.0;
  for (const BudgetRow& r : rows) bytes_per_s += r.to_autopilot == to_autopilot ? r.bytes * r.rate_hz : 0.0;
  return bytes_per_s;
}

double line_share(const std::vector<BudgetRow>& rows, bool to_autopilot, double baud) {
  return line_load(rows, to_autopilot) * 10.0 / baud;
}

}  // namespace atmos
