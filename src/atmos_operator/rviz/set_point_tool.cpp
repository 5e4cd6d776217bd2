#include "set_point_tool.h"

#include <rviz/display_context.h>
#include <rviz/load_resource.h>
#include <rviz/properties/string_property.h>
#include <rviz/viewport_mouse_event.h>
#include <pluginlib/class_list_macros.hpp>

#include "atmos_model_ros/messages.h"

namespace atmos {

SetPointTool::SetPointTool() {
  shortcut_key_ = 's';
  robot_ = new rviz::StringProperty(
      "Robot", "/atmos", "Namespace of the robot; the operator's panel sets it.", getPropertyContainer());
  connect(robot_, &rviz::Property::changed, this, &SetPointTool::change_robot);
}

void SetPointTool::onInitialize() {
  PoseTool::onInitialize();
  setName("Set-point");
  setIcon(rviz::loadPixmap("package://rviz/icons/classes/SetGoal.png"));
  change_robot();
}

void SetPointTool::change_robot() {
  ros::NodeHandle node(robot_->getStdString());
  set_points_ = node.advertise<geometry_msgs::PoseStamped>("setpoint", 1);
  const boost::function<void(const nav_msgs::Odometry&)> see = [this](const nav_msgs::Odometry& message) {
    yaw_ = yaw_of(message.pose.pose.orientation);
  };
  odometry_ = node.subscribe<nav_msgs::Odometry>("odometry", 1, see);
}

int SetPointTool::processMouseEvent(rviz::ViewportMouseEvent& event) {
  if (event.leftDown()) has_drag_ = false;
  if (event.type == QEvent::MouseMove && event.left()) has_drag_ = true;
  return PoseTool::processMouseEvent(event);
}

void SetPointTool::onPoseSet(double x, double y, double theta) {
  const std::string frame = context_->getFixedFrame().toStdString();
  if (frame != kWorldFrame) {
    ROS_WARN("no set-point sent: the fixed frame is '%s' and must be '%s'", frame.c_str(), kWorldFrame);
    return;
  }
  geometry_msgs::PoseStamped message;
  message.header.frame_id = kWorldFrame;
  message.header.stamp = ros::Time::now();
  message.pose = planar_pose(x, y, has_drag_ ? theta : yaw_);
  set_points_.publish(message);
  ROS_INFO("set-point to %s: x %.2f m, y %.2f m, yaw %.0f deg", robot_->getStdString().c_str(), x, y,
           (has_drag_ ? theta : yaw_) * 180.0 / M_PI);
}

}  // namespace atmos

PLUGINLIB_EXPORT_CLASS(atmos::SetPointTool, rviz::Tool)
