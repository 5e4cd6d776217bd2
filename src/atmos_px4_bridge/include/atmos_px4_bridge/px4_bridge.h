// The bridge without ROS: the flight manager on a MAVLink line. Bytes, set-points and odometry in; bytes and
// telemetry out.
#pragma once

#include <string>

#include "atmos_px4_bridge/flight_manager.h"
#include "atmos_px4_bridge/mavlink/mavlink_link.h"
#include "atmos_px4_bridge/supervisor.h"

namespace atmos {

// A bridge file (config/px4/bridge.yaml).
struct BridgeConfig {
  MavlinkConfig mavlink;
  SupervisorConfig safety;
};

// Throws ConfigError with every fault.
BridgeConfig load_bridge(const std::string& path);

class Px4Bridge {
 public:
  // `telemetry`: its heard, state, reboot, refusal and battery are taken by the flight manager first.
  Px4Bridge(const BridgeConfig& config, const Vehicle& vehicle, MavlinkLink::Write write,
            MavlinkLink::Listener telemetry = {});
  Px4Bridge(const Px4Bridge&) = delete;
  Px4Bridge& operator=(const Px4Bridge&) = delete;

  // At 50 Hz or more.
  void tick(double now_s);
  MavlinkLink& link() { return link_; }
  FlightManager& manager() { return manager_; }
  const MavlinkLink& link() const { return link_; }
  const FlightManager& manager() const { return manager_; }

 private:
  MavlinkLink::Listener listener(MavlinkLink::Listener telemetry);

  double now_s_ = 0.0;
  MavlinkLink link_;
  FlightManager manager_;
};

}  // namespace atmos
