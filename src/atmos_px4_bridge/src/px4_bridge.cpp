#include "atmos_px4_bridge/px4_bridge.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "atmos_model/strict_yaml.h"
#include "atmos_px4_bridge/mavlink/px4.h"

namespace atmos {

namespace {

// Set-points, odometry and arming over one link; modes and what disarms go over both, so that either is
// enough.
class DividedLink : public AutopilotLink {
 public:
  DividedLink(AutopilotLink& flies, AutopilotLink& commands) : flies_(flies), commands_(commands) {}
  LevelSupport support(Level level) const override { return flies_.support(level); }
  void send_setpoint(const Setpoint& setpoint, const OdometrySample& measured, double now_s) override {
    flies_.send_setpoint(setpoint, measured, now_s);
  }
  bool can_close() const override { return flies_.can_close(); }
  void send_closed(double now_s) override { flies_.send_closed(now_s); }
  void send_odometry(const OdometrySample& odometry, double now_s) override {
    flies_.send_odometry(odometry, now_s);
  }
  void send_mode(FlightMode mode, double now_s) override {
    flies_.send_mode(mode, now_s);
    commands_.send_mode(mode, now_s);
  }
  void send_arm(bool arm, bool force, double now_s) override {
    flies_.send_arm(arm, force, now_s);
    if (!arm) commands_.send_arm(arm, force, now_s);
  }

 private:
  AutopilotLink &flies_, &commands_;
};

MavlinkConfig mavlink_config(const ConfigMap& map) {
  MavlinkConfig config;
  config.firmware =
      map.choice("firmware", {"stock", "patched"}) == "patched" ? Firmware::kPatched : Firmware::kStock;
  config.own.system = static_cast<mavlink::u8>(map.integer("system_id", 1, 255));
  config.own.component = mavlink::kComponentOnboardComputer;
  config.autopilot.system = static_cast<mavlink::u8>(map.integer("autopilot_system_id", 1, 255));
  config.autopilot.component = mavlink::kComponentAutopilot;
  config.attitude_p = map.number("autopilot_yaw_p_1_s", Bounds::positive());
  return config;
}

XrceConfig xrce_config(const ConfigMap& map) {
  XrceConfig config;
  config.firmware = *xrce::firmware_named(map.choice("firmware", xrce::firmware_names()));
  config.system_id = static_cast<std::uint8_t>(map.integer("system_id", 1, 255));
  config.autopilot_system_id = static_cast<std::uint8_t>(map.integer("autopilot_system_id", 1, 255));
  return config;
}

}  // namespace

BridgeConfig load_bridge(const std::string& path, LinkChoice link) {
  const ConfigFile file(path);
  const ConfigMap root = file.root().map("px4_bridge");
  BridgeConfig config{};
  // What is not used is read all the same: a file is right or wrong whatever the link.
  if (link != LinkChoice::kXrce) {
    config.mavlink = mavlink_config(root.map("mavlink"));
  } else if (const auto map = root.optional_map("mavlink")) {
    mavlink_config(*map);
  }
  if (link != LinkChoice::kMavlink) {
    config.xrce = xrce_config(root.map("xrce"));
  } else if (const auto map = root.optional_map("xrce")) {
    xrce_config(*map);
  }

  const ConfigMap safety = root.map("safety");
  config.safety.setpoint_limit_s = safety.number("setpoint_limit_s", Bounds::positive());
  config.safety.odometry_limit_s = safety.number("odometry_limit_s", Bounds::positive());
  config.safety.link_limit_s = safety.number("link_limit_s", Bounds::positive());
  config.safety.battery_min = safety.number("battery_min", Bounds::between(0.0, 1.0));
  config.safety.area_min_m = safety.vector2("area_min_m");
  config.safety.area_max_m = safety.vector2("area_max_m");
  config.safety.speed_max_m_s = safety.number("speed_max_m_s", Bounds::positive());
  config.safety.yaw_rate_max_rad_s = safety.number("yaw_rate_max_rad_s", Bounds::positive());
  if ((config.safety.area_min_m.array() >= config.safety.area_max_m.array()).any())
    safety.fault("area_max_m", "must lie beyond area_min_m");
  file.check();
  return config;
}

Px4Bridge::Px4Bridge(const BridgeConfig& config, const Vehicle& vehicle, Lines lines,
                     TelemetryListener telemetry) {
  for (double& heard_s : heard_s_) heard_s = -std::numeric_limits<double>::infinity();
  if (config.mavlink) {
    mavlink_ = std::make_unique<MavlinkLink>(*config.mavlink, vehicle, std::move(lines.mavlink),
                                             listener(Source::kMavlink, telemetry));
    link_ = mavlink_.get();
  }
  if (config.xrce) {
    if (config.mavlink) telemetry.imu = nullptr, telemetry.motion = nullptr, telemetry.battery = nullptr;
    xrce_ = std::make_unique<XrceLink>(*config.xrce, vehicle, std::move(lines.xrce),
                                       listener(Source::kXrce, telemetry));
    link_ = xrce_.get();
  }
  if (config.mavlink && config.xrce) {
    both_ = std::make_unique<DividedLink>(*xrce_, *mavlink_);
    link_ = both_.get();
  }
  manager_ = std::make_unique<FlightManager>(config.safety, *link_, vehicle.thrusters.size(),
                                             vehicle.actuation == Actuation::kOnOff ? 0.0 : -1.0);
}

Px4Bridge::~Px4Bridge() = default;

// A link is alive only while all of its lines are.
void Px4Bridge::hear(Source source, double now_s) {
  heard_s_[static_cast<int>(source)] = now_s;
  const double other = heard_s_[source == Source::kMavlink ? 1 : 0];
  manager_->hear(mavlink_ && xrce_ ? std::min(now_s, other) : now_s);
}

TelemetryListener Px4Bridge::listener(Source source, const TelemetryListener& telemetry) {
  TelemetryListener all = telemetry;
  all.heard = [this, source, next = telemetry.heard](double now_s) {
    now_s_ = now_s;
    hear(source, now_s);
    if (next) next(now_s);
  };
  all.state = [this, next = telemetry.state](const AutopilotState& state) {
    manager_->take_autopilot(state, now_s_);
    if (next) next(state);
  };
  all.reboot = [this, next = telemetry.reboot](double now_s) {
    manager_->take_reboot(now_s);
    if (next) next(now_s);
  };
  all.refusal = [this, next = telemetry.refusal](const std::string& text) {
    manager_->take_refusal(text);
    if (next) next(text);
  };
  all.battery = [this, next = telemetry.battery](const BatteryReading& battery) {
    if (std::isfinite(battery.share)) manager_->take_battery(battery.share);
    if (next) next(battery);
  };
  return all;
}

void Px4Bridge::tick(double now_s) {
  if (mavlink_) mavlink_->tick(now_s);
  if (xrce_) xrce_->tick(now_s);
  manager_->tick(now_s);
}

}  // namespace atmos
