#include "atmos_px4_bridge/mavlink/link_budget.h"

#include "atmos_px4_bridge/mavlink/messages.h"

namespace atmos {

using namespace mavlink;

namespace {

template <class Message>
BudgetRow row(bool to_autopilot, double rate_hz) {
  return {Message::kName, to_autopilot, 10.0 + Message::kSize + 2.0, rate_hz};
}

}  // namespace

std::vector<BudgetRow> flight_traffic() {
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

double line_share(const std::vector<BudgetRow>& rows, bool to_autopilot, double baud) {
  double bytes_per_s = 0.0;
  for (const BudgetRow& r : rows) bytes_per_s += r.to_autopilot == to_autopilot ? r.bytes * r.rate_hz : 0.0;
  return bytes_per_s * 10.0 / baud;
}

}  // namespace atmos
