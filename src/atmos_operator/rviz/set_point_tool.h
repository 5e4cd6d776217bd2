// Sends a set-point to a robot: a click on the floor keeps its heading, a drag sets the heading too.
#pragma once

#ifndef Q_MOC_RUN
#include <geometry_msgs/PoseStamped.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <rviz/default_plugin/tools/pose_tool.h>
#endif

namespace rviz {
class StringProperty;
}

namespace atmos {

// Publishes on <Robot>/setpoint, valid at once, in the fixed frame, which must be the world.
class SetPointTool : public rviz::PoseTool {
  Q_OBJECT
 public:
  SetPointTool();

  void onInitialize() override;
  int processMouseEvent(rviz::ViewportMouseEvent& event) override;

 protected:
  void onPoseSet(double x, double y, double theta) override;

 private:
  void change_robot();

  rviz::StringProperty* robot_;  // its namespace
  ros::Publisher set_points_;
  ros::Subscriber odometry_;
  double yaw_ = 0.0;       // of the robot, as last seen
  bool has_drag_ = false;  // since the button went down
};

}  // namespace atmos
