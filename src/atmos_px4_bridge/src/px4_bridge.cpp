#include "atmos_px4_bridge/px4_bridge.h"

#include <cmath>

#include "atmos_model/strict_yaml.h"
#include "atmos_px4_bridge/mavlink/px4.h"

namespace atmos {

BridgeConfig load_bridge(const std::string& path) {
  const ConfigFile file(path);
  const ConfigMap root = file.root().map("px4_bridge");
  BridgeConfig config{};
  const ConfigMap mavlink = root.map("mavlink");
  config.mavlink.firmware =
      mavlink.choice("firmware", {"stock", "patched"}) == "patched" ? Firmware::kPatched : Firmware::kStock;
  config.mavlink.own.system = static_cast<mavlink::u8>(mavlink.integer("system_id", 1, 255));
  config.mavlink.own.component = mavlink::kComponentOnboardComputer;
  config.mavlink.autopilot.system = static_cast<mavlink::u8>(mavlink.integer("autopilot_system_id", 1, 255));
  config.mavlink.autopilot.component = mavlink::kComponentAutopilot;
  config.mavlink.attitude_p = mavlink.number("autopilot_yaw_p_1_s", Bounds::positive());

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

Px4Bridge::Px4Bridge(const BridgeConfig& config, const Vehicle& vehicle, MavlinkLink::Write write,
                     MavlinkLink::Listener telemetry)
    : link_(config.mavlink, vehicle, std::move(write), listener(std::move(telemetry))),
      manager_(config.safety, link_, vehicle.thrusters.size(),
               vehicle.actuation == Actuation::kOnOff ? 0.0 : -1.0) {}

MavlinkLink::Listener Px4Bridge::listener(MavlinkLink::Listener telemetry) {
  MavlinkLink::Listener all = telemetry;
  all.heard = [this, next = telemetry.heard](double now_s) {
    now_s_ = now_s;
    manager_.hear(now_s);
    if (next) next(now_s);
  };
  all.state = [this, next = telemetry.state](const AutopilotState& state) {
    manager_.take_autopilot(state, now_s_);
    if (next) next(state);
  };
  all.reboot = [this, next = telemetry.reboot](double now_s) {
    manager_.take_reboot(now_s);
    if (next) next(now_s);
  };
  all.refusal = [this, next = telemetry.refusal](const std::string& text) {
    manager_.take_refusal(text);
    if (next) next(text);
  };
  all.battery = [this, next = telemetry.battery](const BatteryReading& battery) {
    if (std::isfinite(battery.share)) manager_.take_battery(battery.share);
    if (next) next(battery);
  };
  return all;
}

void Px4Bridge::tick(double now_s) {
  link_.tick(now_s);
  manager_.tick(now_s);
}

}  // namespace atmos
