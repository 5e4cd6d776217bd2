// Publishes the set-points of a scenario (~scenario; of a scenario with several robots those of the robot
// with the name of the namespace) or of a sequence file (~sequence) on `setpoint`. The flight starts at the
// first valid ROS time. Only then is the topic advertised: who waits for the connection knows that the start
// has been taken.
#include <geometry_msgs/PoseStamped.h>
#include <ros/ros.h>

#include "atmos_model_ros/messages.h"
#include "atmos_model_ros/node.h"
#include "atmos_operator/setpoint_player.h"

namespace {

geometry_msgs::PoseStamped to_message(const atmos::StampedSetPoint& point) {
  geometry_msgs::PoseStamped message;
  message.header.frame_id = atmos::kWorldFrame;
  message.header.stamp.fromSec(point.stamp);
  message.pose = atmos::planar_pose(point.x_m, point.y_m, point.yaw_rad);
  return message;
}

std::vector<atmos::SetPoint> load(const ros::NodeHandle& private_node) {
  if (private_node.hasParam("sequence"))
    return atmos::load_sequence(atmos::required_parameter<std::string>(private_node, "sequence"));
  const std::string space = ros::this_node::getNamespace();
  return atmos::load_scenario(atmos::required_parameter<std::string>(private_node, "scenario"),
                              space.substr(space.rfind('/') + 1))
      .set_points;
}

}  // namespace

int main(int argc, char** argv) {
  return atmos::run_node(argc, argv, "setpoint_player", [] {
    ros::NodeHandle node;
    const std::vector<atmos::SetPoint> sequence = load(ros::NodeHandle("~"));
    ros::Time::waitForValid();
    atmos::SetpointPlayer player(sequence, ros::Time::now().toSec());

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
