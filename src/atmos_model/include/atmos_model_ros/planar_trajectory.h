// Points of a `trajectory` of motion in the plane. For nodes that depend on trajectory_msgs.
#pragma once

#include <trajectory_msgs/MultiDOFJointTrajectory.h>

#include <Eigen/Core>

#include "atmos_model_ros/messages.h"

namespace atmos {

// World frame; x, y, yaw of each [m, rad, s].
struct PlanarTrajectoryPoint {
  double from_start_s;
  Eigen::Vector3d pose, velocity, acceleration;
};

inline trajectory_msgs::MultiDOFJointTrajectoryPoint trajectory_point(const PlanarTrajectoryPoint& from) {
  const auto twist = [](const Eigen::Vector3d& rate) {
    geometry_msgs::Twist result;
    result.linear.x = rate.x();
    result.linear.y = rate.y();
    result.angular.z = rate.z();
    return result;
  };
  trajectory_msgs::MultiDOFJointTrajectoryPoint point;
  point.time_from_start.fromSec(from.from_start_s);
  geometry_msgs::Transform pose;
  pose.translation.x = from.pose.x();
  pose.translation.y = from.pose.y();
  pose.rotation = yaw_quaternion(from.pose.z());
  point.transforms.push_back(pose);
  point.velocities.push_back(twist(from.velocity));
  point.accelerations.push_back(twist(from.acceleration));
  return point;
}

// An empty one that holds from `stamp_s` (ROS seconds).
inline trajectory_msgs::MultiDOFJointTrajectory planar_trajectory(double stamp_s) {
  trajectory_msgs::MultiDOFJointTrajectory message;
  message.header.frame_id = kWorldFrame;
  message.header.stamp.fromSec(stamp_s);
  message.joint_names = {"base_link"};
  return message;
}

}  // namespace atmos
