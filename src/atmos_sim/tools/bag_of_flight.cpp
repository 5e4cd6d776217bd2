#include "bag_of_flight.h"

#include <atmos_msgs/ThrusterCommand.h>
#include <geometry_msgs/PoseStamped.h>
#include <rosbag/bag.h>

#include "atmos_model_ros/messages.h"

namespace atmos {

namespace {

constexpr double kPoseTransport = 0.0045;     // s from exposure to the recorder
constexpr double kCommandTransport = 0.0005;  // s

geometry_msgs::PoseStamped pose_message(double stamp_s, double x, double y, double yaw) {
  geometry_msgs::PoseStamped message;
  message.header.stamp = ros::Time(stamp_s);
  message.header.frame_id = kWorldFrame;
  message.pose = planar_pose(x, y, yaw);
  return message;
}

}  // namespace

void write_bag(const std::string& path, const Scenario& scenario, const PilotedFlight& flight, double start_s,
               const std::string& robot) {
  rosbag::Bag bag(path, rosbag::bagmode::Write);
  for (const SetPoint& point : scenario.set_points) {
    const double stamp = start_s + point.time_s;
    bag.write("/" + robot + "/setpoint", ros::Time(stamp),
              pose_message(stamp, point.x_m, point.y_m, point.yaw_rad));
  }
  for (const ThrusterCommand& command : flight.commands) {
    atmos_msgs::ThrusterCommand message;
    message.header.stamp = ros::Time(command.stamp_s);
    message.period = command.period_s;
    message.duty = command.duty;
    bag.write("/" + robot + "/thruster_command", ros::Time(command.stamp_s + kCommandTransport), message);
  }
  for (const PilotedRow& row : flight.rows) {
    const MocapFrame& frame = row.row.frame;
    if (!frame.pose.p_W.allFinite()) continue;
    bag.write("/" + robot + "/mocap/pose", ros::Time(row.row.time_s + kPoseTransport),
              pose_message(frame.stamp_s, frame.pose.p_W.x(), frame.pose.p_W.y(), frame.pose.yaw));
  }
}

}  // namespace atmos
