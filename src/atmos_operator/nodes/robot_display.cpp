// A robot for rviz: its odometry, commands, references and estimates -> /display/robots and /display/control
// (MarkerArray), the same topics for every robot, so that one rviz configuration shows all of them.
// Parameters: ~vehicle (file), ~rate_hz, ~metres_per_newton (thrust), ~metres_per_disturbance_newton,
// ~trail_s.
#include <geometry_msgs/PoseStamped.h>
#include <ros/ros.h>

#include <cmath>

#include "atmos_model_ros/messages.h"
#include "atmos_model_ros/node.h"
#include "atmos_operator/setpoint_queue.h"
#include "robot_markers.h"

namespace atmos {
namespace {

constexpr double kTrailStep_m = 0.01;
constexpr double kSilence_s = 1.0;  // predictions and estimates older than this are not shown

class RobotDisplay {
 public:
  RobotDisplay(ros::NodeHandle& node, const ros::NodeHandle& parameters)
      : markers_(node.getNamespace().substr(1),
                 load_vehicle(required_parameter<std::string>(parameters, "vehicle")),
                 {parameters.param("metres_per_newton", 0.15),
                  parameters.param("metres_per_disturbance_newton", 1.0)}),
        trail_s_(parameters.param("trail_s", 20.0)),
        robots_(node.advertise<visualization_msgs::MarkerArray>("/display/robots", 2)),
        control_(node.advertise<visualization_msgs::MarkerArray>("/display/control", 2)),
        odometry_(node.subscribe("odometry", 100, &RobotDisplay::on_odometry, this)),
        setpoint_(node.subscribe("setpoint", 10, &RobotDisplay::on_setpoint, this)),
        trajectory_(node.subscribe("trajectory", 10, &RobotDisplay::on_trajectory, this)) {
    keep(node, "thruster_command", picture_.command);
    keep(node, "nmpc/predicted_path", picture_.predicted);
    keep(node, "disturbance", picture_.disturbance);
    timer_ =
        node.createTimer(ros::Duration(1.0 / parameters.param("rate_hz", 25.0)), &RobotDisplay::draw, this);
  }

 private:
  template <class Message>
  void keep(ros::NodeHandle& node, const std::string& topic, std::optional<Message>& newest) {
    const boost::function<void(const Message&)> take = [&newest](const Message& m) { newest = m; };
    kept_.push_back(node.subscribe<Message>(topic, 5, take));
  }

  void on_odometry(const nav_msgs::Odometry& message) {
    if (picture_.odometry && message.header.stamp < picture_.odometry->header.stamp) {  // another flight
      stamps_.clear();
      picture_.trail.clear();
    }
    picture_.odometry = message;
    geometry_msgs::Point at = message.pose.pose.position;
    at.z = 0.02;
    const bool moved = picture_.trail.empty() || std::hypot(at.x - picture_.trail.back().x,
                                                            at.y - picture_.trail.back().y) > kTrailStep_m;
    if (moved) {
      picture_.trail.push_back(at);
      stamps_.push_back(message.header.stamp);
    }
    while (!stamps_.empty() && (message.header.stamp - stamps_.front()).toSec() > trail_s_) {
      stamps_.pop_front();
      picture_.trail.pop_front();
    }
  }

  void on_setpoint(const geometry_msgs::PoseStamped& message) {
    const auto& p = message.pose.position;
    setpoints_.add({message.header.stamp.toSec(), p.x, p.y, yaw_of(message.pose.orientation)});
  }

  // Until a set-point that holds later.
  void on_trajectory(const trajectory_msgs::MultiDOFJointTrajectory& message) {
    picture_.reference = message;
  }

  void draw(const ros::TimerEvent&) {
    const ros::Time now = ros::Time::now();
    const auto age = [now](const ros::Time& stamp) { return (now - stamp).toSec(); };
    RobotPicture shown = picture_;
    if (shown.command && age(shown.command->header.stamp) > 2.0 * shown.command->period)
      shown.command.reset();
    if (shown.predicted && age(shown.predicted->header.stamp) > kSilence_s) shown.predicted.reset();
    if (shown.disturbance && age(shown.disturbance->header.stamp) > kSilence_s) shown.disturbance.reset();
    shown.set_point = setpoints_.at(now.toSec());
    if (shown.reference) {
      const double begin = shown.reference->header.stamp.toSec();
      if (begin > now.toSec() || (shown.set_point && shown.set_point->stamp > begin)) {
        shown.reference.reset();
      } else {
        shown.set_point.reset();
      }
    }
    const RobotLayers layers = markers_.draw(shown);
    robots_.publish(layers.robots);
    control_.publish(layers.control);
  }

  RobotMarkers markers_;
  double trail_s_;
  RobotPicture picture_;
  std::deque<ros::Time> stamps_;  // of the trail's points
  SetpointQueue setpoints_;
  ros::Publisher robots_, control_;
  ros::Subscriber odometry_, setpoint_, trajectory_;
  std::vector<ros::Subscriber> kept_;
  ros::Timer timer_;
};

}  // namespace
}  // namespace atmos

int main(int argc, char** argv) {
  return atmos::run_node(argc, argv, "robot_display", [] {
    ros::NodeHandle node;
    const atmos::RobotDisplay display(node, ros::NodeHandle("~"));
    ros::spin();
    return 0;
  });
}
