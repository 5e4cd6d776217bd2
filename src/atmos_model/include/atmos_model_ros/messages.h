// Conversion between messages and the core's types. For nodes only: cores include no ROS header.
#pragma once

#include <atmos_msgs/ThrusterCommand.h>
#include <geometry_msgs/Pose.h>
#include <geometry_msgs/PoseStamped.h>
#include <nav_msgs/Odometry.h>

#include <cmath>
#include <string>

#include "atmos_model/planar.h"
#include "atmos_model/rigid_body.h"
#include "atmos_model/valve_schedule.h"

namespace atmos {

inline constexpr const char* kWorldFrame = "world";

// "<robot>/base_link"; `robot` is the node's namespace without slashes ("atmos").
inline std::string base_frame(const std::string& robot) { return robot + "/base_link"; }

inline ThrusterCommand from_message(const atmos_msgs::ThrusterCommand& message) {
  return {message.header.stamp.toSec(), message.period, message.duty};
}

inline geometry_msgs::Quaternion yaw_quaternion(double yaw) {
  geometry_msgs::Quaternion q;
  q.x = 0.0;
  q.y = 0.0;
  q.z = std::sin(0.5 * yaw);
  q.w = std::cos(0.5 * yaw);
  return q;
}

inline double yaw_of(const geometry_msgs::Quaternion& q) {
  return std::atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z));
}

inline geometry_msgs::Pose planar_pose(double x, double y, double yaw) {
  geometry_msgs::Pose pose;
  pose.position.x = x;
  pose.position.y = y;
  pose.position.z = 0.0;
  pose.orientation = yaw_quaternion(yaw);
  return pose;
}

// 13-state of the geometric centre out of odometry whose twist is in the body frame. Not checked for
// finiteness.
inline State13<double> state13_from(const nav_msgs::Odometry& odometry) {
  using namespace state13;
  const auto& pose = odometry.pose.pose;
  const auto& twist = odometry.twist.twist;
  State13<double> x;
  x.segment<3>(kPosition) << pose.position.x, pose.position.y, pose.position.z;
  x.segment<4>(kQuaternion) << pose.orientation.w, pose.orientation.x, pose.orientation.y, pose.orientation.z;
  const Vec3<double> v_B(twist.linear.x, twist.linear.y, twist.linear.z);
  x.segment<3>(kVelocity) = rotate<double>(x.segment<4>(kQuaternion), v_B);
  x.segment<3>(kAngularVelocity) << twist.angular.x, twist.angular.y, twist.angular.z;
  return x;
}

}  // namespace atmos
