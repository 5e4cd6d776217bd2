// Publishes the set-points of a scenario (~scenario; of a scenario with several robots those of the robot
// with the name of the namespace) or of a sequence file (~sequence) on `setpoint`, and a scenario's
// trajectories on `trajectory`.
// ~autostart true (default): the mission starts at the first valid ROS time, and only then is a topic
// advertised: who waits for the connection knows that the start has been taken. false: it waits for ~start.
// Services (std_srvs/Trigger): ~start begins the mission, or begins it anew; ~stop ends it, the robot then
// holds the place where it is. ~state (std_msgs/String, latched): idle, running, finished (nothing more to
// announce: the last set-point holds) or stopped.
#include <geometry_msgs/PoseStamped.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <std_msgs/String.h>
#include <std_srvs/Trigger.h>

#include <optional>

#include "atmos_model_ros/messages.h"
#include "atmos_model_ros/node.h"
#include "atmos_model_ros/planar_trajectory.h"
#include "atmos_operator/mission.h"
#include "atmos_operator/trajectory_shape.h"

namespace {

using geometry_msgs::PoseStamped;
using trajectory_msgs::MultiDOFJointTrajectory;

constexpr double kSample_s = 0.1;         // between the points of a trajectory
constexpr double kOdometryLimit_s = 0.5;  // older odometry does not say where the robot is

PoseStamped to_message(const atmos::StampedSetPoint& point) {
  PoseStamped message;
  message.header.frame_id = atmos::kWorldFrame;
  message.header.stamp.fromSec(point.stamp);
  message.pose = atmos::planar_pose(point.x_m, point.y_m, point.yaw_rad);
  return message;
}

MultiDOFJointTrajectory to_message(const atmos::StampedTrajectory& trajectory) {
  const double length_s = trajectory.settings.duration_s - trajectory.from_s;
  MultiDOFJointTrajectory message = atmos::planar_trajectory(trajectory.stamp());
  const int steps = static_cast<int>(std::ceil(length_s / kSample_s));
  for (int k = 0; k <= steps; ++k) {
    const double t = length_s * k / steps;
    const atmos::ShapePoint at = atmos::shape_at(trajectory.settings, trajectory.from_s + t);
    message.points.push_back(
        atmos::trajectory_point({t,
                                 {at.x.value, at.y.value, at.yaw.value},
                                 {at.x.rate, at.y.rate, at.yaw.rate},
                                 {at.x.acceleration, at.y.acceleration, at.yaw.acceleration}}));
  }
  return message;
}

atmos::MissionProgram load(const ros::NodeHandle& private_node) {
  if (private_node.hasParam("sequence"))
    return {atmos::load_sequence(atmos::required_parameter<std::string>(private_node, "sequence")), {}};
  const std::string space = ros::this_node::getNamespace();
  const auto scenario = atmos::load_scenario(atmos::required_parameter<std::string>(private_node, "scenario"),
                                             space.substr(space.rfind('/') + 1));
  return {scenario.set_points, scenario.trajectories};
}

class SetpointPlayerNode {
 public:
  SetpointPlayerNode(const atmos::MissionProgram& program, bool autostart) : mission_(program) {
    // Like latched topics, but a listener that comes late gets all that holds or will hold.
    const auto tell = [this](const ros::SingleSubscriberPublisher& newcomer, bool points) {
      const auto orders = mission_.announced(now());
      if (points) {
        for (const auto& point : orders.points) newcomer.publish(to_message(point));
      } else {
        for (const auto& trajectory : orders.trajectories) newcomer.publish(to_message(trajectory));
      }
    };
    const atmos::MissionOrders first = autostart ? mission_.start(now()) : atmos::MissionOrders{};
    trajectories_ = node_.advertise<MultiDOFJointTrajectory>(
        "trajectory", 10, [tell](const ros::SingleSubscriberPublisher& to) { tell(to, false); });
    points_ = node_.advertise<PoseStamped>(
        "setpoint", 10, [tell](const ros::SingleSubscriberPublisher& to) { tell(to, true); });
    ros::NodeHandle private_node("~");
    state_ = private_node.advertise<std_msgs::String>("state", 1, true);
    publish(first);
    odometry_ = node_.subscribe("odometry", 1, &SetpointPlayerNode::on_odometry, this);
    start_ = private_node.advertiseService("start", &SetpointPlayerNode::start, this);
    stop_ = private_node.advertiseService("stop", &SetpointPlayerNode::stop, this);
    timer_ = node_.createTimer(ros::Duration(0.05),
                               [this](const ros::TimerEvent&) { publish(mission_.due(now())); });
  }

 private:
  static double now() { return ros::Time::now().toSec(); }

  void on_odometry(const nav_msgs::Odometry& message) {
    const auto& p = message.pose.pose.position;
    const double yaw = atmos::yaw_of(message.pose.pose.orientation);
    if (std::isfinite(p.x + p.y + yaw)) here_ = {message.header.stamp.toSec(), p.x, p.y, yaw};
  }

  bool start(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
    publish(mission_.start(now()));
    response.success = true;
    response.message = "the mission runs";
    return true;
  }

  bool stop(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
    const auto in_force = mission_.in_force(now());
    response.success = in_force.has_value();
    if (!response.success) {
      response.message = "no mission runs";
      return true;
    }
    const bool seen = here_ && now() - here_->stamp <= kOdometryLimit_s;
    response.message = seen ? "the robot holds its place" : "no odometry: the last set-point holds";
    publish(mission_.stop(now(), seen ? *here_ : *in_force));
    return true;
  }

  void publish(const atmos::MissionOrders& orders) {
    for (const auto& point : orders.points) {
      points_.publish(to_message(point));
      ROS_INFO("from %.1f s: x %.2f m, y %.2f m, yaw %.1f deg", point.stamp, point.x_m, point.y_m,
               point.yaw_rad * 180.0 / M_PI);
    }
    for (const auto& trajectory : orders.trajectories) trajectories_.publish(to_message(trajectory));
    const std::string name = name_of(mission_.state(now()));
    if (name == said_.data) return;
    said_.data = name;
    state_.publish(said_);
  }

  ros::NodeHandle node_;
  atmos::Mission mission_;
  std::optional<atmos::StampedSetPoint> here_;  // where the robot was last seen, and when
  std_msgs::String said_;
  ros::Publisher points_, trajectories_, state_;
  ros::Subscriber odometry_;
  ros::ServiceServer start_, stop_;
  ros::Timer timer_;
};

}  // namespace

int main(int argc, char** argv) {
  return atmos::run_node(argc, argv, "setpoint_player", [] {
    const ros::NodeHandle node, private_node("~");
    const atmos::MissionProgram program = load(private_node);
    const bool autostart = private_node.param("autostart", true);
    if (autostart) ros::Time::waitForValid();
    const SetpointPlayerNode player(program, autostart);
    ros::spin();
    return 0;
  });
}
