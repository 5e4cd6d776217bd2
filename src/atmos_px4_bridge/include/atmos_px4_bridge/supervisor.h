// The safety rules: when commands may reach the valves, and what happens when they may not
// (docs/px4_bridge.md, "Safety"). Knows no protocol. Times are ROS seconds.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>

#include "atmos_px4_bridge/autopilot_link.h"

namespace atmos {

// In the order in which they are looked at. Numbers as in atmos_msgs/SupervisorStatus.
enum class Rule {
  kNone = 0,
  kKill = 1,
  kBatteryLow = 2,
  kLinkLost = 3,
  kOdometryLost = 4,
  kEnvelopeLeft = 5,
  kNmpcFailed = 6,
  kSetpointOld = 7,
};
const char* name_of(Rule rule);

enum class Reaction {
  kFly,
  kStabilise,  // the autopilot holds the place by itself
  kClose,      // valves closed; flying goes on by itself once the rule is satisfied again
  kDisarm,     // valves closed for good
};

struct SupervisorConfig {
  double setpoint_limit_s;
  double odometry_limit_s;
  double link_limit_s;
  double battery_min;                      // share of the charge, [0, 1)
  Eigen::Vector2d area_min_m, area_max_m;  // of the geometric centre, world
  double speed_max_m_s;
  double yaw_rate_max_rad_s;
};

struct Verdict {
  Reaction reaction = Reaction::kClose;
  Rule rule = Rule::kNone;
  std::string text;  // numbers for people; empty while flying
};

class Supervisor {
 public:
  explicit Supervisor(const SupervisorConfig& config) : config_(config) {}

  void on_setpoint(double now_s) { setpoint_s_ = now_s; }
  // `now_s` is when it came; a stamp ahead of it counts as of now.
  void on_odometry(const OdometrySample& odometry, double now_s);
  // The controller says that it has no command worth carrying out.
  void on_nmpc(bool failed) { nmpc_failed_ = failed; }
  void on_link(double now_s) { link_s_ = now_s; }
  void on_battery(double share) { battery_ = share; }
  void set_kill(bool kill) { kill_ = kill; }
  // The operator wants to fly (again): what was latched is judged anew.
  void release_latches();

  // Looks at all rules; the envelope and the battery stay broken once they were, until release_latches().
  Verdict judge(double now_s);
  bool link_alive(double now_s) const { return now_s - link_s_ <= config_.link_limit_s; }

 private:
  std::string envelope_fault() const;
  void notice_clock(double now_s);

  SupervisorConfig config_;
  static constexpr double kNever = -std::numeric_limits<double>::infinity();
  double setpoint_s_ = kNever, odometry_s_ = kNever, link_s_ = kNever, last_now_s_ = kNever;
  OdometrySample odometry_;
  double battery_ = std::numeric_limits<double>::quiet_NaN();  // not known yet
  bool nmpc_failed_ = false, kill_ = false;
  std::string envelope_latch_, battery_latch_;
};

}  // namespace atmos
