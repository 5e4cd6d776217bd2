// Error-state Kalman filter on SE(3): poses of the motion capture in, position, attitude and velocities out.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <limits>
#include <optional>

#include "atmos_mocap_bridge/config.h"
#include "atmos_mocap_bridge/nis_monitor.h"
#include "atmos_model/allocation.h"
#include "atmos_model/rigid_body.h"
#include "atmos_model/valve_schedule.h"
#include "atmos_model/vehicle.h"

namespace atmos {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Matrix12 = Eigen::Matrix<double, 12, 12>;

// One mocap frame at the instant of exposure; not-a-number in the pose: the robot was not seen.
struct PoseFrame {
  double stamp_s;
  Eigen::Vector3d p_WB;  // m
  Eigen::Quaterniond q_WB;
  // Of position (world) and attitude error (body), where the source knows it; else that of the settings.
  std::optional<Matrix6> covariance = std::nullopt;
};

// Order of the error state: position error (m, world), attitude error (rad, body: R_WB = R_estimated
// Exp(error)), velocity error (m/s, world), angular-velocity error (rad/s, body).
namespace pose_error {
enum Index { kPosition = 0, kAttitude = 3, kVelocity = 6, kAngularVelocity = 9 };
}

struct PoseEstimate {
  double stamp_s = 0.0;
  Eigen::Vector3d p_WB = Eigen::Vector3d::Zero();  // m
  Eigen::Quaterniond q_WB = Eigen::Quaterniond::Identity();
  Eigen::Vector3d v_WB = Eigen::Vector3d::Zero();    // m/s, world axes
  Eigen::Vector3d w_WB_B = Eigen::Vector3d::Zero();  // rad/s, body axes
  Matrix12 covariance = Matrix12::Zero();            // of the error state
};

// The estimate as nav_msgs/Odometry wants it: pose in the world with covariance of (x, y, z, rotations about
// the fixed world axes), twist in the body with covariance of (vx, vy, vz, wx, wy, wz).
struct OdometryEstimate {
  Eigen::Vector3d p_WB;
  Eigen::Quaterniond q_WB;
  Eigen::Vector3d v_WB_B;
  Eigen::Vector3d w_WB_B;
  Matrix6 pose_covariance;
  Matrix6 twist_covariance;
};
OdometryEstimate to_odometry(const PoseEstimate& estimate);

enum class TrackingState { kWaiting, kTracking, kCoasting, kLost };

// What became of one frame.
struct FrameResult {
  TrackingState state;
  bool published;  // estimate() is to be published
  double age_s;    // the frame's stamp minus that of the last accepted frame; 0 before any
};

struct FrameCounters {
  std::uint64_t frames = 0;
  std::uint64_t accepted = 0;
  std::uint64_t rejected_not_finite = 0;  // not seen, or the orientation is no unit quaternion
  std::uint64_t rejected_order = 0;       // stamp not after that of the frame before
  std::uint64_t rejected_gate = 0;
  std::uint64_t reinitialisations = 0;  // starts other than the first
};

// Model: p' = v, v' = R f/m + noise, R' = R [w]x, I w' = tau - w x I w + noise, with force f and torque tau
// out of the known valve openings, exact at valve edges, and white noise (larger where the openings are not
// known). The measured point is taken as the centre of mass. Update in Joseph form with reset of the attitude
// error (Sola, "Quaternion kinematics for the error-state Kalman filter", 2017, chapters 5 to 7, local
// angular error).
//
// Frames that are not seen or fail the gate on the normalised innovation squared (NIS) are bridged by
// prediction. It is published for at most coast_s after the last accepted frame, then the robot is lost until
// the next good frame; after forget_s that frame starts the filter anew, as it does after reinitialise_after
// refusals in a row. Stamps
// that do not ascend are refused; when reinitialise_after such frames come in a row with ascending stamps,
// time has jumped back and the filter starts anew. Bad data never throws.
class PoseFilter {
 public:
  PoseFilter(const MocapConfig& config, const Vehicle& vehicle);

  // Takes what the valves were told, at `now_s` (-inf: it was there in time). Malformed ones are ignored.
  void take_command(const ThrusterCommand& command, double now_s = -std::numeric_limits<double>::infinity());
  FrameResult take_frame(const PoseFrame& frame);

  // At the stamp of the last frame in order.
  const PoseEstimate& estimate() const { return output_; }
  const FrameCounters& counters() const { return counters_; }
  TrackingState state() const { return state_; }
  // Of the last update that reached the gate; 6 degrees of freedom.
  double nis() const { return nis_; }
  const NisMonitor& nis_monitor() const { return nis_monitor_; }

 private:
  // The frame without what the calibration says is wrong with it.
  PoseFrame calibrated(const PoseFrame& frame) const;
  FrameResult filter(const PoseFrame& frame);
  void start(const PoseFrame& frame);
  // Update with a frame of the estimate's stamp; false: the gate refused it.
  bool update(const PoseFrame& frame);
  // What a frame without an acceptable pose leads to, `age_s` after the last accepted one.
  FrameResult coast(double age_s);
  void predict(PoseEstimate& estimate, double until_s);
  // One stretch of the constant openings_; `known`: whether they are.
  void integrate(PoseEstimate& estimate, double dt, bool known) const;

  MocapConfig config_;
  Vehicle vehicle_;
  AllocationMatrices matrices_;
  ValveSchedule valves_;
  double known_from_ = std::numeric_limits<double>::infinity();  // stretch for which commands are known
  double known_until_ = -std::numeric_limits<double>::infinity();
  Eigen::VectorXd openings_;
  PoseEstimate estimate_;  // at the exposure of the last frame
  PoseEstimate output_;
  NisMonitor nis_monitor_;
  TrackingState state_ = TrackingState::kWaiting;
  FrameCounters counters_;
  double last_stamp_ = -std::numeric_limits<double>::infinity();  // of the last frame in order
  double accepted_stamp_ = 0.0;
  double refused_stamp_ = -std::numeric_limits<double>::infinity();  // of the last frame out of order
  int order_refusals_ = 0;                                           // in a row, among themselves ascending
  int gate_refusals_ = 0;                                            // in a row
  double nis_ = 0.0;
};

}  // namespace atmos
