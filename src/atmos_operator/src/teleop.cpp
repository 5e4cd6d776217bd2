#include "atmos_operator/teleop.h"

#include <algorithm>
#include <cmath>

#include "atmos_model/strict_yaml.h"
#include "atmos_operator/distance_monitor.h"

namespace atmos {

namespace {

constexpr double kRounding = 1e-3;  // drivers scale integers: a stick fully out may read a little more than 1
constexpr double kStop_s = 1.0;     // in which full thrust stops what the limits allow

TeleopConfig::Axis read_axis(const ConfigMap& axes, const std::string& key) {
  const ConfigMap map = axes.map(key);
  return {map.integer("axis", 0, 63), map.flag("inverted", false)};
}

double wrapped(double angle) { return std::remainder(angle, 2.0 * M_PI); }

}  // namespace

TeleopConfig load_teleop(const std::string& path) {
  const ConfigFile file(path);
  const ConfigMap map = file.root().map("teleop"), axes = map.map("axes"), shares = map.map("shares"),
                  ahead = map.map("ahead");
  const Bounds share{0.0, 1.0, true};
  TeleopConfig config{};
  config.dead_man_button = map.integer("dead_man_button", 0, 63);
  config.dead_zone = map.number("dead_zone", Bounds::between(0.0, 0.9));
  config.forward = read_axis(axes, "forward");
  config.left = read_axis(axes, "left");
  config.turn = read_axis(axes, "turn");
  config.force_share = shares.number("force", share);
  config.torque_share = shares.number("torque", share);
  config.yaw_rate_share = shares.number("yaw_rate", share);
  config.speed_share = shares.number("speed", share);
  config.ahead_m = ahead.number("distance_m", {0.0, 1.0, true});
  config.ahead_rad = ahead.number("yaw_deg", {0.0, 90.0, true}) * M_PI / 180.0;
  if (config.forward.index == config.left.index || config.forward.index == config.turn.index ||
      config.left.index == config.turn.index)
    map.fault("axes", "forward, left and turn must be three different axes");
  file.check();
  return config;
}

TeleopLimits teleop_limits(const Vehicle& vehicle) {
  const BrakingAbility ability = braking_ability(vehicle);
  return {ability.acceleration_m_s2 * vehicle.mass_kg,
          ability.yaw_acceleration_rad_s2 * vehicle.inertia_kg_m2.z(),
          ability.yaw_acceleration_rad_s2 * kStop_s, ability.acceleration_m_s2 * kStop_s};
}

Teleop::Teleop(const TeleopConfig& config, const Vehicle& vehicle, TeleopMode mode)
    : config_(config), mode_(mode), limits_(teleop_limits(vehicle)), allocator_(vehicle) {}

std::string Teleop::fault_in(const std::vector<double>& axes, const std::vector<int>& buttons) const {
  if (config_.dead_man_button >= static_cast<int>(buttons.size()))
    return "no button " + std::to_string(config_.dead_man_button) + ", the dead man's";
  for (const TeleopConfig::Axis& axis : {config_.forward, config_.left, config_.turn}) {
    const std::string name = "axis " + std::to_string(axis.index);
    if (axis.index >= static_cast<int>(axes.size())) return "no " + name;
    const double value = axes[static_cast<std::size_t>(axis.index)];
    if (!(std::abs(value) <= 1.0 + kRounding)) return name + " is " + std::to_string(value);
  }
  return {};
}

// A stick's way without its dead zone, stretched so that there is no jump at the zone's end.
double Teleop::stick(const TeleopConfig::Axis& axis, const std::vector<double>& axes) const {
  const double value = axes[static_cast<std::size_t>(axis.index)] * (axis.inverted ? -1.0 : 1.0);
  const double out = std::max(0.0, std::abs(value) - config_.dead_zone) / (1.0 - config_.dead_zone);
  return std::copysign(std::min(out, 1.0), value);
}

void Teleop::take(const std::vector<double>& axes, const std::vector<int>& buttons, double now_s) {
  if (now_s - read_s_ > kSilence_s) ready_ = pressed_ = false;
  read_s_ = now_s;
  fault_ = fault_in(axes, buttons);
  if (!fault_.empty()) {
    ++refused_;
    ready_ = pressed_ = false;
    return;
  }
  const bool down = buttons[static_cast<std::size_t>(config_.dead_man_button)] != 0;
  if (!down) ready_ = true;
  pressed_ = down && ready_;
  sticks_ = {stick(config_.forward, axes), stick(config_.left, axes), stick(config_.turn, axes)};
  const double reach =
      sticks_.head<2>().norm();  // the corners of a square stick are no stronger than its sides
  if (reach > 1.0) sticks_.head<2>() /= reach;
}

void Teleop::see(const Eigen::Vector3d& pose, double now_s) {
  if (!pose.allFinite()) return;
  pose_ = pose;
  seen_s_ = now_s;
}

bool Teleop::held(double now_s) const { return pressed_ && now_s - read_s_ <= kSilence_s; }

BodyWrench Teleop::within_reach(const BodyWrench& wrench) const {
  return std::min(1.0, allocator_.attainable_scale(wrench)) * wrench;
}

void Teleop::move_set_point(double now_s) {
  const double elapsed_s = flying_ ? now_s - moved_s_ : 0.0;
  if (!flying_) set_point_ = pose_;
  moved_s_ = now_s;
  const double speed = config_.speed_share * limits_.speed_m_s;
  set_point_.head<2>() += elapsed_s * speed * sticks_.head<2>();
  set_point_[2] += elapsed_s * config_.yaw_rate_share * limits_.yaw_rate_rad_s * sticks_[2];
  const Eigen::Vector2d ahead = set_point_.head<2>() - pose_.head<2>();
  if (ahead.norm() > config_.ahead_m)
    set_point_.head<2>() = pose_.head<2>() + ahead * (config_.ahead_m / ahead.norm());
  set_point_[2] =
      pose_[2] + std::clamp(wrapped(set_point_[2] - pose_[2]), -config_.ahead_rad, config_.ahead_rad);
}

std::optional<TeleopCommand> Teleop::due(double now_s) {
  const bool lost = mode_ == TeleopMode::kPosition && !seen(now_s);
  TeleopCommand command;
  if (!held(now_s) || lost) {
    if (!flying_) return std::nullopt;
    flying_ = false;
    // The controller closes the valves of a robot that is not seen; its set-point stays where it is.
    if (lost) return std::nullopt;
    command.closed = true;
    command.pose = pose_;
    return command;
  }
  if (mode_ == TeleopMode::kPosition) {
    move_set_point(now_s);
    command.pose = set_point_;
  } else {
    command.wrench.head<2>() = config_.force_share * limits_.force_n * sticks_.head<2>();
    if (mode_ == TeleopMode::kRate) {
      command.yaw_rate = config_.yaw_rate_share * limits_.yaw_rate_rad_s * sticks_[2];
    } else {
      command.wrench[2] = config_.torque_share * limits_.torque_n_m * sticks_[2];
    }
    command.wrench = within_reach(command.wrench);
  }
  flying_ = true;
  return command;
}

}  // namespace atmos
