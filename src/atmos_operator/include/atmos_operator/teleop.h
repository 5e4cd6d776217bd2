// Teleoperation: what a hand on a joystick asks of the robot (docs/operator.md, "Teleoperation").
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "atmos_model/allocator.h"
#include "atmos_model/vehicle.h"

namespace atmos {

enum class TeleopMode {
  kWrench,    // body force and torque
  kRate,      // body force and yaw rate
  kPosition,  // the set-point of a controller, moved along the world's axes
};

struct TeleopConfig {
  struct Axis {
    int index;  // into the axes of a reading
    bool inverted;
  };
  int dead_man_button;
  double dead_zone;  // [0, 0.9] of a stick's way
  Axis forward, left, turn;
  double force_share, torque_share, yaw_rate_share, speed_share;  // (0, 1] of TeleopLimits
  double ahead_m, ahead_rad;  // the set-point may be this far from the robot
};

// Reads config/teleop/*.yaml. Throws ConfigError with every fault.
TeleopConfig load_teleop(const std::string& path);

// What the vehicle can do; for rates and speeds: what one second of full thrust stops.
struct TeleopLimits {
  double force_n;  // in the weakest direction
  double torque_n_m;
  double yaw_rate_rad_s;
  double speed_m_s;
};
TeleopLimits teleop_limits(const Vehicle& vehicle);

struct TeleopCommand {
  bool closed = false;                     // the hand has let go: close the valves; position: stay at `pose`
  BodyWrench wrench = BodyWrench::Zero();  // body [N, N, N m]; rate mode: its torque is 0
  double yaw_rate = 0.0;                   // rad/s, rate mode
  Eigen::Vector3d pose = Eigen::Vector3d::Zero();  // x, y [m], yaw [rad], world: position mode
};

// Judges the readings of a joystick. Nothing is commanded unless the dead man is held. He counts as held only
// after he has been seen released: at the start, after silence and after a reading that was refused. Times
// are seconds of any clock that never stops.
class Teleop {
 public:
  static constexpr double kSilence_s = 0.25;   // without a reading: as if released
  static constexpr double kPoseLimit_s = 0.5;  // position mode: an older pose does not say where the robot is

  Teleop(const TeleopConfig& config, const Vehicle& vehicle, TeleopMode mode);

  // A reading. One with an axis or button too few, or an axis of those used that is not within [-1, 1], is
  // counted, and lets go of the dead man.
  void take(const std::vector<double>& axes, const std::vector<int>& buttons, double now_s);
  // Where the robot is: x, y, yaw in the world. What is not finite is ignored.
  void see(const Eigen::Vector3d& pose, double now_s);

  // The command that holds now: while the dead man is held, and once, `closed`, after that. Position mode:
  // none without a pose.
  std::optional<TeleopCommand> due(double now_s);

  std::uint64_t refused() const { return refused_; }
  // Why the last reading was refused; empty when it was not.
  const std::string& fault() const { return fault_; }
  bool held(double now_s) const;

 private:
  std::string fault_in(const std::vector<double>& axes, const std::vector<int>& buttons) const;
  double stick(const TeleopConfig::Axis& axis, const std::vector<double>& axes) const;
  bool seen(double now_s) const { return now_s - seen_s_ <= kPoseLimit_s; }
  BodyWrench within_reach(const BodyWrench& wrench) const;
  void move_set_point(double now_s);

  TeleopConfig config_;
  TeleopMode mode_;
  TeleopLimits limits_;
  Allocator allocator_;
  bool ready_ = false;    // the dead man has been seen released since the last fault
  bool pressed_ = false;  // ... and then held, in the newest reading
  bool flying_ = false;   // a command has been given since the last `closed`
  Eigen::Vector3d sticks_ = Eigen::Vector3d::Zero();  // forward, left, turn in [-1, 1]
  double read_s_ = -std::numeric_limits<double>::infinity();
  Eigen::Vector3d pose_ = Eigen::Vector3d::Zero(), set_point_ = Eigen::Vector3d::Zero();
  double seen_s_ = -std::numeric_limits<double>::infinity(), moved_s_ = 0.0;
  std::uint64_t refused_ = 0;
  std::string fault_;
};

}  // namespace atmos
