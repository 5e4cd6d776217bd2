// PX4Space's control cascade: position P -> velocity PID -> attitude P -> rate PID -> allocation, entered at
// the level of the set-point. Laws: PX4's spacecraft modules; their known defects are avoided
// (docs/px4_bridge.md, "Cascade").
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>

#include "atmos_model/allocator.h"
#include "atmos_model/vehicle.h"
#include "atmos_px4_bridge/pid.h"
#include "atmos_px4_bridge/setpoint.h"

namespace atmos {

// What a force of 1 and a torque of 1 mean in gains and set-points.
enum class Units {
  kMetric,      // N, N m
  kNormalised,  // shares of the largest force along body x and y and the largest torque (PX4)
};

struct CascadeGains {
  Eigen::Vector3d position_p;             // 1/s, world axes
  Eigen::Vector3d position_i;             // 1/s^2
  Eigen::Vector3d position_integral_max;  // m/s
  Eigen::Vector3d velocity_max;           // m/s
  std::array<PidGains, 3> velocity;       // force per m/s, world axes
  Eigen::Vector3d force_max;              // world axes
  Eigen::Vector3d attitude_p;             // 1/s, body axes
  Eigen::Vector3d rate_max;               // rad/s
  std::array<PidGains, 3> rate;           // torque per rad/s, body axes
};

// Motion of the geometric centre. NaN: not known; what would need it is not commanded.
struct CascadeState {
  Eigen::Vector3d p_WB = kNotControlled;  // m
  Eigen::Vector3d v_WB = kNotControlled;  // m/s
  Eigen::Quaterniond q_WB = Eigen::Quaterniond(kNotControlled.x(), 0.0, 0.0, 0.0);
  Eigen::Vector3d w_WB_B = kNotControlled;  // rad/s
};

struct CascadeOutput {
  Eigen::Vector3d rate_B = kNotControlled;             // set-point of the rate level, rad/s
  Eigen::Vector3d force_B = Eigen::Vector3d::Zero();   // asked of the allocation, N
  Eigen::Vector3d torque_B = Eigen::Vector3d::Zero();  // N m
  Allocation allocation;                               // of the planar part; kThrusters: the duties as given
};

// Times are ROS seconds. Nothing throws after construction; whatever is not finite is not commanded.
class Cascade {
 public:
  Cascade(const Vehicle& vehicle, const CascadeGains& gains, Units units);

  // Duties for the time from stamp_s on. Forces and torques of a set-point are in the cascade's units.
  const CascadeOutput& update(double stamp_s, const Setpoint& setpoint, const CascadeState& state);

  // Forgets what was integrated.
  void reset();

  // What is integrated: a velocity [m/s], a force [N] and a torque [N m].
  const Eigen::Vector3d& position_integral() const { return position_integral_; }
  Eigen::Vector3d velocity_integral() const;
  Eigen::Vector3d rate_integral() const;

 private:
  void control_position(double stamp_s, const Setpoint& setpoint, const CascadeState& state);
  void control_attitude(const Eigen::Quaterniond& q_WB_setpoint, const CascadeState& state);
  void control_rate(double stamp_s, const CascadeState& state);
  void allocate(const Eigen::Matrix3d& R_WB);

  Allocator allocator_;
  Eigen::Vector3d force_unit_, torque_unit_;  // N, N m
  CascadeGains gains_;                        // metric
  std::array<Pid, 3> velocity_, rate_;
  Eigen::Vector3d position_integral_ = Eigen::Vector3d::Zero();
  double last_stamp_;
  bool velocity_runs_[3] = {}, rate_runs_[3] = {};  // axes whose loop acted in this update
  CascadeOutput output_;
};

}  // namespace atmos
