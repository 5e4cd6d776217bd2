// Stops robots before they touch: /<robot>/odometry of all robots -> /<robot>/trajectory of those to be
// stopped, a braking path that ends at rest (docs/operator.md). Set-points and trajectories of others for a
// held robot are overruled until ~release (std_srvs/Trigger) is called. ~status (DistanceMonitorStatus), 10
// Hz of ROS time. Parameters: ~robots (names, separated by blanks), ~vehicle (file), ~margin_m, ~stale_s.
#include <atmos_msgs/DistanceMonitorStatus.h>
#include <geometry_msgs/PoseStamped.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>

#include <algorithm>
#include <sstream>

#include "atmos_model_ros/messages.h"
#include "atmos_model_ros/node.h"
#include "atmos_model_ros/planar_trajectory.h"
#include "atmos_operator/distance_monitor.h"

namespace atmos {
namespace {

using geometry_msgs::PoseStamped;
using trajectory_msgs::MultiDOFJointTrajectory;

constexpr double kStatus_s = 0.1, kRepeat_s = 1.0;

MultiDOFJointTrajectory to_message(const std::vector<BrakingPoint>& points) {
  MultiDOFJointTrajectory message = planar_trajectory(points.front().time_s);
  for (const BrakingPoint& at : points) {
    message.points.push_back(trajectory_point({at.time_s - points.front().time_s,
                                               {at.p_W.x(), at.p_W.y(), at.yaw},
                                               {at.v_W.x(), at.v_W.y(), at.yaw_rate},
                                               {at.a_W.x(), at.a_W.y(), at.yaw_acceleration}}));
  }
  return message;
}

class DistanceMonitorNode {
 public:
  DistanceMonitorNode(std::vector<DistanceMonitor::Robot> robots, const DistanceMonitorSettings& settings)
      : monitor_(std::move(robots), settings) {
    ros::NodeHandle private_node("~");
    status_ = private_node.advertise<atmos_msgs::DistanceMonitorStatus>("status", 10);
    const auto hints = ros::TransportHints().tcpNoDelay();
    for (std::size_t i = 0; i < monitor_.size(); ++i) {
      const std::string space = "/" + monitor_.name(i) + "/";
      trajectories_.push_back(node_.advertise<MultiDOFJointTrajectory>(space + "trajectory", 10));
      const boost::function<void(const nav_msgs::Odometry&)> see = [this, i](const auto& m) {
        on_odometry(i, m);
      };
      subscribers_.push_back(
          node_.subscribe<nav_msgs::Odometry>(space + "odometry", 10, see, ros::VoidConstPtr(), hints));
      subscribe_to_orders<PoseStamped>(i, space + "setpoint");
      subscribe_to_orders<MultiDOFJointTrajectory>(i, space + "trajectory");
    }
    release_ = private_node.advertiseService("release", &DistanceMonitorNode::release, this);
  }

 private:
  // What others ask of a robot comes from here too: the last word on a held robot is ours.
  template <class Message>
  void subscribe_to_orders(std::size_t robot, const std::string& topic) {
    const boost::function<void(const ros::MessageEvent<Message const>&)> overrule =
        [this, robot](const ros::MessageEvent<Message const>& event) {
          if (event.getPublisherName() != ros::this_node::getName() && monitor_.held(robot))
            hold(robot, std::max(now_s_, event.getMessage()->header.stamp.toSec()));
        };
    subscribers_.push_back(node_.subscribe<Message>(topic, 10, overrule));
  }

  void on_odometry(std::size_t robot, const nav_msgs::Odometry& message) {
    if (message.header.frame_id != kWorldFrame) return;
    const State13<double> x = state13_from(message);
    const double stamp = message.header.stamp.toSec();
    const SeenMotion motion{stamp, x.head<2>(), x.segment<2>(state13::kVelocity),
                            yaw_of(message.pose.pose.orientation), x[state13::kAngularVelocity + 2]};
    for (const std::size_t stopped : monitor_.see(robot, motion)) {
      ROS_WARN("%s is held: %s", monitor_.name(stopped).c_str(), monitor_.reason().c_str());
      hold(stopped, stamp);
    }
    now_s_ = std::max(now_s_, stamp);
    if (now_s_ >= status_s_ + kStatus_s) publish_status(message.header.stamp);
    if (now_s_ < repeated_s_ + kRepeat_s) return;
    // Whatever order messages came in: a held robot is told again.
    repeated_s_ = now_s_;
    for (std::size_t i = 0; i < monitor_.size(); ++i) {
      if (monitor_.held(i)) hold(i, now_s_);
    }
  }

  void hold(std::size_t robot, double from_s) {
    trajectories_[robot].publish(to_message(monitor_.path(robot).points_from(from_s)));
  }

  void publish_status(const ros::Time& stamp) {
    status_s_ = now_s_;
    atmos_msgs::DistanceMonitorStatus message;
    message.header.stamp = stamp;
    message.header.frame_id = kWorldFrame;
    for (std::size_t i = 0; i < monitor_.size(); ++i) {
      message.robots.push_back(monitor_.name(i));
      message.distance.push_back(monitor_.distance_m(i));
      message.held.push_back(monitor_.held(i));
    }
    message.reason = monitor_.reason();
    status_.publish(message);
  }

  bool release(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
    monitor_.release();
    response.success = true;
    response.message = "robots hold their places until they get a new set-point";
    ROS_INFO("released");
    return true;
  }

  ros::NodeHandle node_;
  DistanceMonitor monitor_;
  std::vector<ros::Publisher> trajectories_;
  ros::Publisher status_;
  std::vector<ros::Subscriber> subscribers_;
  ros::ServiceServer release_;
  double now_s_ = -1e9, status_s_ = -1e9,
         repeated_s_ = -1e9;  // newest stamp; of the last status and repetition
};

}  // namespace
}  // namespace atmos

int main(int argc, char** argv) {
  return atmos::run_node(argc, argv, "distance_monitor", [] {
    const ros::NodeHandle parameters("~");
    const auto vehicle = atmos::load_vehicle(atmos::required_parameter<std::string>(parameters, "vehicle"));
    atmos::DistanceMonitorSettings settings;
    settings.margin_m = parameters.param("margin_m", settings.margin_m);
    settings.stale_s = parameters.param("stale_s", settings.stale_s);
    std::istringstream names(atmos::required_parameter<std::string>(parameters, "robots"));
    std::vector<atmos::DistanceMonitor::Robot> robots;
    for (std::string name; names >> name;) robots.push_back({name, atmos::braking_ability(vehicle)});
    const atmos::DistanceMonitorNode node(std::move(robots), settings);
    ros::spin();
    return 0;
  });
}
