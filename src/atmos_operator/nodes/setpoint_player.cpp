// Publishes the set-points of a scenario (~scenario; of a scenario with several robots those of the robot
// with the name of the namespace) or of a sequence file (~sequence) on `setpoint`, and a scenario's
// trajectories on `trajectory`. The flight starts at the first valid ROS time. Only then is a topic
// advertised: who waits for the connection knows that the start has been taken.
#include <geometry_msgs/PoseStamped.h>
#include <ros/ros.h>
#include <trajectory_msgs/MultiDOFJointTrajectory.h>

#include "atmos_model_ros/messages.h"
#include "atmos_model_ros/node.h"
#include "atmos_operator/setpoint_player.h"
#include "atmos_operator/trajectory_shape.h"

namespace {

constexpr double kSample_s = 0.1;  // between the points of a trajectory

geometry_msgs::PoseStamped to_message(const atmos::StampedSetPoint& point) {
  geometry_msgs::PoseStamped message;
  message.header.frame_id = atmos::kWorldFrame;
  message.header.stamp.fromSec(point.stamp);
  message.pose = atmos::planar_pose(point.x_m, point.y_m, point.yaw_rad);
  return message;
}

trajectory_msgs::MultiDOFJointTrajectory to_message(const atmos::TrajectorySettings& settings, double t0) {
  trajectory_msgs::MultiDOFJointTrajectory message;
  message.header.frame_id = atmos::kWorldFrame;
  message.header.stamp.fromSec(t0 + settings.time_s);
  message.joint_names = {"base_link"};
  const int steps = static_cast<int>(std::ceil(settings.duration_s / kSample_s));
  for (int k = 0; k <= steps; ++k) {
    const double t = settings.duration_s * k / steps;
    const atmos::ShapePoint at = atmos::shape_at(settings, t);
    trajectory_msgs::MultiDOFJointTrajectoryPoint point;
    point.time_from_start.fromSec(t);
    geometry_msgs::Transform pose;
    pose.translation.x = at.x.value;
    pose.translation.y = at.y.value;
    pose.rotation = atmos::yaw_quaternion(at.yaw.value);
    geometry_msgs::Twist velocity, acceleration;
    velocity.linear.x = at.x.rate;
    velocity.linear.y = at.y.rate;
    velocity.angular.z = at.yaw.rate;
    acceleration.linear.x = at.x.acceleration;
    acceleration.linear.y = at.y.acceleration;
    acceleration.angular.z = at.yaw.acceleration;
    point.transforms.push_back(pose);
    point.velocities.push_back(velocity);
    point.accelerations.push_back(acceleration);
    message.points.push_back(point);
  }
  return message;
}

struct Program {
  std::vector<atmos::SetPoint> set_points;
  std::vector<atmos::TrajectorySettings> trajectories;
};

Program load(const ros::NodeHandle& private_node) {
  if (private_node.hasParam("sequence"))
    return {atmos::load_sequence(atmos::required_parameter<std::string>(private_node, "sequence")), {}};
  const std::string space = ros::this_node::getNamespace();
  const auto scenario = atmos::load_scenario(atmos::required_parameter<std::string>(private_node, "scenario"),
                                             space.substr(space.rfind('/') + 1));
  return {scenario.set_points, scenario.trajectories};
}

}  // namespace

int main(int argc, char** argv) {
  return atmos::run_node(argc, argv, "setpoint_player", [] {
    ros::NodeHandle node;
    const Program program = load(ros::NodeHandle("~"));
    ros::Time::waitForValid();
    const double t0 = ros::Time::now().toSec();
    atmos::SetpointPlayer player(program.set_points, t0);

    // Whole trajectories, whenever somebody starts to listen: each says itself from when it holds.
    const ros::Publisher trajectories = node.advertise<trajectory_msgs::MultiDOFJointTrajectory>(
        "trajectory", 10, [&program, t0](const ros::SingleSubscriberPublisher& newcomer) {
          for (const auto& settings : program.trajectories) newcomer.publish(to_message(settings, t0));
        });

    // Like a latched topic, but a listener that comes late gets two messages: what holds and what is next.
    const auto tell_newcomer = [&player](const ros::SingleSubscriberPublisher& newcomer) {
      for (const auto& point : player.announced(ros::Time::now().toSec()))
        newcomer.publish(to_message(point));
    };
    ros::Publisher publisher = node.advertise<geometry_msgs::PoseStamped>("setpoint", 10, tell_newcomer);
    const auto announce = [&player, &publisher](const ros::TimerEvent&) {
      for (const auto& point : player.due(ros::Time::now().toSec())) {
        publisher.publish(to_message(point));
        ROS_INFO("from %.1f s: x %.2f m, y %.2f m, yaw %.1f deg", point.stamp, point.x_m, point.y_m,
                 point.yaw_rad * 180.0 / M_PI);
      }
    };
    announce({});
    const ros::Timer timer = node.createTimer(ros::Duration(0.05), announce);
    ros::spin();
    return 0;
  });
}
