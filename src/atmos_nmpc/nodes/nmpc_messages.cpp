#include "nmpc_messages.h"

#include <limits>

#include "atmos_model_ros/messages.h"

namespace atmos {

namespace {

Vec3<double> vector_from(const geometry_msgs::Vector3& v) { return {v.x, v.y, v.z}; }

void to_message(const Vec3<double>& v, geometry_msgs::Vector3& out) {
  out.x = v[0];
  out.y = v[1];
  out.z = v[2];
}

}  // namespace

atmos_msgs::ThrusterCommand thruster_message(const ControlDecision& decision, const std::string& frame) {
  atmos_msgs::ThrusterCommand message;
  message.header.stamp = ros::Time(decision.command.stamp_s);
  message.header.frame_id = frame;
  message.period = decision.command.period_s;
  message.duty = decision.command.duty;
  return message;
}

geometry_msgs::WrenchStamped wrench_message(const ControlDecision& decision, const std::string& frame) {
  geometry_msgs::WrenchStamped message;
  message.header.stamp = ros::Time(decision.command.stamp_s);
  message.header.frame_id = frame;
  message.wrench.force.x = decision.wrench[0];
  message.wrench.force.y = decision.wrench[1];
  message.wrench.torque.z = decision.wrench[2];
  return message;
}

atmos_msgs::RateCommand rate_message(const ControlDecision& decision, const std::string& frame) {
  atmos_msgs::RateCommand message;
  message.header.stamp = ros::Time(decision.command.stamp_s);
  message.header.frame_id = frame;
  message.force.x = decision.wrench[0];
  message.force.y = decision.wrench[1];
  message.angular_rate.z = decision.yaw_rate;
  return message;
}

atmos_msgs::Disturbance disturbance_message(const ControlDecision& decision) {
  const DisturbanceEstimate& estimate = *decision.disturbance;
  atmos_msgs::Disturbance message;
  message.header.stamp = ros::Time(decision.command.stamp_s);
  message.header.frame_id = kWorldFrame;
  to_message(estimate.mean.acceleration_W, message.linear_acceleration);
  to_message(estimate.mean.angular_acceleration_B, message.angular_acceleration);
  for (int i = 0; i < 36; ++i)
    message.covariance[static_cast<std::size_t>(i)] = estimate.covariance(i / 6, i % 6);
  return message;
}

nav_msgs::Path path_message(const ControlDecision& decision) {
  nav_msgs::Path path;
  path.header.stamp = ros::Time(decision.command.stamp_s);
  path.header.frame_id = kWorldFrame;
  for (std::size_t k = 0; k < decision.path.size(); ++k) {
    const State13<double>& x = decision.path[k];
    geometry_msgs::PoseStamped pose;
    pose.header.frame_id = kWorldFrame;
    pose.header.stamp =
        ros::Time(decision.command.stamp_s + static_cast<double>(k) * decision.command.period_s);
    pose.pose.position.x = x[0];
    pose.pose.position.y = x[1];
    pose.pose.position.z = x[2];
    pose.pose.orientation.w = x[state13::kQuaternion];
    pose.pose.orientation.x = x[state13::kQuaternion + 1];
    pose.pose.orientation.y = x[state13::kQuaternion + 2];
    pose.pose.orientation.z = x[state13::kQuaternion + 3];
    path.poses.push_back(pose);
  }
  return path;
}

std::vector<TrajectoryPoint> trajectory_points(const trajectory_msgs::MultiDOFJointTrajectory& message) {
  std::vector<TrajectoryPoint> points;
  for (const auto& from : message.points) {
    TrajectoryPoint point;
    point.time_s = message.header.stamp.toSec() + from.time_from_start.toSec();
    point.p_WB.setConstant(std::numeric_limits<double>::quiet_NaN());
    point.q_WB.setZero();
    point.v_WB.setZero();
    point.w_WB_W.setZero();
    point.a_WB.setZero();
    if (!from.transforms.empty()) {
      const auto& q = from.transforms.front().rotation;
      point.p_WB = vector_from(from.transforms.front().translation);
      point.q_WB << q.w, q.x, q.y, q.z;
    }
    if (!from.velocities.empty()) {
      point.v_WB = vector_from(from.velocities.front().linear);
      point.w_WB_W = vector_from(from.velocities.front().angular);
    }
    if (!from.accelerations.empty()) point.a_WB = vector_from(from.accelerations.front().linear);
    points.push_back(point);
  }
  return points;
}

}  // namespace atmos
