#include "atmos_px4_bridge/supervisor.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace atmos {

namespace {

constexpr double kClockStep_s = 0.1;  // a step back by less is jitter

std::string text(const char* format, double a, double b = 0.0) {
  char buffer[160];
  std::snprintf(buffer, sizeof(buffer), format, a, b);
  return buffer;
}

std::string age_text(const char* what, double age) {
  return std::isinf(age) ? std::string("no ") + what + " yet"
                         : std::string(what) + text(" is %.2f s old", age);
}

}  // namespace

const char* name_of(Rule rule) {
  switch (rule) {
    case Rule::kNone:
      return "none";
    case Rule::kKill:
      return "kill";
    case Rule::kBatteryLow:
      return "battery low";
    case Rule::kLinkLost:
      return "link lost";
    case Rule::kOdometryLost:
      return "odometry lost";
    case Rule::kEnvelopeLeft:
      return "envelope left";
    case Rule::kNmpcFailed:
      return "nmpc failed";
    case Rule::kSetpointOld:
      return "set-point old";
  }
  return "unknown";
}

// A clock that was set back: ages against the old one would look fresh for ever.
void Supervisor::notice_clock(double now_s) {
  if (now_s < last_now_s_ - kClockStep_s) setpoint_s_ = odometry_s_ = link_s_ = kNever;
  last_now_s_ = now_s;
}

void Supervisor::on_odometry(const OdometrySample& odometry, double now_s) {
  notice_clock(now_s);
  const double stamp = std::min(odometry.stamp_s, now_s);
  if (!odometry.is_finite() || !(stamp > odometry_s_)) return;
  odometry_s_ = stamp;
  odometry_ = odometry;
  const std::string fault = envelope_fault();
  if (!fault.empty() && envelope_latch_.empty()) envelope_latch_ = fault;
}

std::string Supervisor::envelope_fault() const {
  const Eigen::Vector2d p = odometry_.p_WB.head<2>();
  if ((p.array() < config_.area_min_m.array()).any() || (p.array() > config_.area_max_m.array()).any())
    return text("position (%.2f, %.2f) m is outside the area", p.x(), p.y());
  const double speed = odometry_.v_WB_B.head<2>().norm();
  if (speed > config_.speed_max_m_s)
    return text("speed %.2f m/s is above %.2f m/s", speed, config_.speed_max_m_s);
  const double rate = std::abs(odometry_.w_WB_B.z());
  if (rate > config_.yaw_rate_max_rad_s)
    return text("yaw rate %.2f rad/s is above %.2f rad/s", rate, config_.yaw_rate_max_rad_s);
  return {};
}

void Supervisor::release_latches() {
  envelope_latch_.clear();
  battery_latch_.clear();
}

Verdict Supervisor::judge(double now_s) {
  notice_clock(now_s);
  if (battery_ < config_.battery_min && battery_latch_.empty())
    battery_latch_ = text("charge %.0f %% is below %.0f %%", 100.0 * battery_, 100.0 * config_.battery_min);
  if (kill_) return {Reaction::kDisarm, Rule::kKill, "killed by the operator"};
  if (!battery_latch_.empty()) return {Reaction::kDisarm, Rule::kBatteryLow, battery_latch_};
  if (!link_alive(now_s))
    return {Reaction::kClose, Rule::kLinkLost, age_text("message of the autopilot", now_s - link_s_)};
  if (!(now_s - odometry_s_ < config_.odometry_limit_s))
    return {Reaction::kClose, Rule::kOdometryLost, age_text("odometry", now_s - odometry_s_)};
  if (!envelope_latch_.empty()) return {Reaction::kStabilise, Rule::kEnvelopeLeft, envelope_latch_};
  if (nmpc_failed_) return {Reaction::kClose, Rule::kNmpcFailed, "the controller has closed the valves"};
  if (!(now_s - setpoint_s_ < config_.setpoint_limit_s))
    return {Reaction::kClose, Rule::kSetpointOld, age_text("set-point", now_s - setpoint_s_)};
  return {Reaction::kFly, Rule::kNone, {}};
}

}  // namespace atmos
