// The bridge without ROS: the flight manager on a MAVLink line, on an XRCE line, or on both. Bytes,
// set-points and odometry in; bytes and telemetry out.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "atmos_px4_bridge/flight_manager.h"
#include "atmos_px4_bridge/mavlink/mavlink_link.h"
#include "atmos_px4_bridge/supervisor.h"
#include "atmos_px4_bridge/xrce/xrce_link.h"

namespace atmos {

// Which protocols are spoken. kBoth: set-points, odometry and arming over XRCE; telemetry and parameters over
// MAVLink; modes and disarming over either.
enum class LinkChoice { kMavlink, kXrce, kBoth };

// A bridge file (config/px4/bridge.yaml), as far as the links that are used need it.
struct BridgeConfig {
  std::optional<MavlinkConfig> mavlink;
  std::optional<XrceConfig> xrce;
  SupervisorConfig safety;
};

// Throws ConfigError with every fault.
BridgeConfig load_bridge(const std::string& path, LinkChoice link);

class Px4Bridge {
 public:
  // Where bytes go to; needed of the links that `config` has.
  struct Lines {
    MavlinkLink::Write mavlink;
    XrceLink::Write xrce;
  };

  // `telemetry`: its heard, state, reboot, refusal and battery are taken by the flight manager first. With
  // both links, measurements (imu, motion, battery) are those of MAVLink.
  Px4Bridge(const BridgeConfig& config, const Vehicle& vehicle, Lines lines,
            TelemetryListener telemetry = {});
  ~Px4Bridge();
  Px4Bridge(const Px4Bridge&) = delete;
  Px4Bridge& operator=(const Px4Bridge&) = delete;

  // At 50 Hz or more.
  void tick(double now_s);
  // The link that set-points take.
  AutopilotLink& link() { return *link_; }
  // The links by protocol; null when not used.
  MavlinkLink* mavlink() { return mavlink_.get(); }
  XrceLink* xrce() { return xrce_.get(); }
  const MavlinkLink* mavlink() const { return mavlink_.get(); }
  const XrceLink* xrce() const { return xrce_.get(); }
  FlightManager& manager() { return *manager_; }
  const FlightManager& manager() const { return *manager_; }

 private:
  enum class Source { kMavlink, kXrce };
  TelemetryListener listener(Source source, const TelemetryListener& telemetry);
  void hear(Source source, double now_s);

  double now_s_ = 0.0;
  double heard_s_[2];  // by source
  std::unique_ptr<MavlinkLink> mavlink_;
  std::unique_ptr<XrceLink> xrce_;
  std::unique_ptr<AutopilotLink> both_;
  AutopilotLink* link_;
  std::unique_ptr<FlightManager> manager_;
};

}  // namespace atmos
