// Stops robots before they touch (docs/operator.md, "Distance monitor").
#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "atmos_model/vehicle.h"

namespace atmos {

struct DistanceMonitorSettings {
  double margin_m = 0.05;    // left between two bodies that have been stopped
  double reaction_s = 0.25;  // from a measurement until its robot brakes: network, control period, PWM
  // Shares of what the thrusters can do in their weakest direction: what a stopped robot is asked for, and
  // what it is counted on for, which is less because a controller follows its reference with an error.
  double asked_share = 0.6;
  double counted_share = 0.4;
  double stale_s = 0.5;  // a robot not seen for longer may be anywhere: all others are stopped
};

// What thrusters can do, out of the vehicle file: the least acceleration over all directions, without torque,
// and the yaw acceleration.
struct BrakingAbility {
  double radius_m;  // of the body
  double acceleration_m_s2;
  double yaw_acceleration_rad_s2;
};
BrakingAbility braking_ability(const Vehicle& vehicle);

// Motion of the geometric centre, world frame.
struct SeenMotion {
  double stamp_s;  // ROS seconds
  Eigen::Vector2d p_W, v_W;
  double yaw, yaw_rate;
};

// A point of the way on which a robot comes to rest.
struct BrakingPoint {
  double time_s;
  Eigen::Vector2d p_W, v_W, a_W;
  double yaw, yaw_rate, yaw_acceleration;
};

// Goes on for half of the reaction time, then brakes in a straight line, then rests.
class BrakingPath {
 public:
  BrakingPath(const SeenMotion& from, const BrakingAbility& ability, const DistanceMonitorSettings& settings);

  double start_s() const { return from_.stamp_s; }
  double end_s() const { return end_s_; }  // of the motion
  BrakingPoint at(double time_s) const;
  // The path from `start_s` on in steps of 0.1 s, with a last point of rest in the far future: as a reference
  // it is never over.
  std::vector<BrakingPoint> points_from(double start_s) const;

 private:
  SeenMotion from_;
  double deceleration_m_s2_, yaw_deceleration_rad_s2_;
  double coast_s_, end_s_;
};

// Judges every odometry: if all robots braked now, would two come closer than the margin? Then both are
// stopped and held until somebody releases them. Stamps alone are time here, so that it works in lockstep as
// in real time.
class DistanceMonitor {
 public:
  struct Robot {
    std::string name;
    BrakingAbility ability;
  };
  DistanceMonitor(std::vector<Robot> robots, const DistanceMonitorSettings& settings);

  // Takes a motion; returns the robots (indices) whose path() is new: they are to follow it. One that has
  // been stopped gets a second one when it has come to rest, to stay there. What is not finite or older than
  // what is known is ignored.
  std::vector<std::size_t> see(std::size_t robot, const SeenMotion& motion);
  // Robots may move again. The distance that they have may not shrink before it has grown back to the margin.
  void release();

  std::size_t size() const { return robots_.size(); }
  const std::string& name(std::size_t robot) const { return robots_.at(robot).name; }
  bool held(std::size_t robot) const { return paths_.at(robot).has_value(); }
  // The way on which a held robot comes to rest.
  const BrakingPath& path(std::size_t robot) const { return *paths_.at(robot); }
  // From its body to the nearest other one that is seen; infinite when there is none.
  double distance_m(std::size_t robot) const;
  // Of the newest stop; empty when none is held.
  const std::string& reason() const { return reason_; }

 private:
  bool seen(std::size_t robot) const;
  Eigen::Vector2d position_now(std::size_t robot) const;
  double body_distance(std::size_t a, std::size_t b) const;
  double most_speed(std::size_t robot) const;
  Eigen::Vector2d way(std::size_t robot, double deceleration, double t) const;
  double least_distance_if_braked(std::size_t a, std::size_t b) const;
  double& allowed(std::size_t a, std::size_t b) { return allowed_[a * robots_.size() + b]; }
  void stop(std::size_t robot, const std::string& why, std::vector<std::size_t>& stopped);

  std::vector<Robot> robots_;
  DistanceMonitorSettings settings_;
  std::vector<std::optional<SeenMotion>> motions_;
  std::vector<std::optional<BrakingPath>> paths_;  // of those held
  std::vector<bool> settled_;                      // of those held: at rest
  // Least distance that a pair may come to; below the margin for those that began or were released closer.
  // NaN: not both seen yet.
  std::vector<double> allowed_;
  std::string reason_;
  double now_s_ = -std::numeric_limits<double>::infinity();  // newest stamp
  double first_s_ = std::numeric_limits<double>::infinity();
};

}  // namespace atmos
