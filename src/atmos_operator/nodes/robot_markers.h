// A robot as rviz markers: body, thrust, set-point, where it was, where it is expected, what disturbs it.
#pragma once

#include <atmos_msgs/Disturbance.h>
#include <atmos_msgs/ThrusterCommand.h>
#include <nav_msgs/Odometry.h>
#include <nav_msgs/Path.h>
#include <trajectory_msgs/MultiDOFJointTrajectory.h>
#include <visualization_msgs/MarkerArray.h>

#include <deque>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "atmos_model/vehicle.h"
#include "atmos_operator/setpoint_player.h"

namespace atmos {

// Lengths of arrows.
struct MarkerScales {
  double thrust_m_n;       // of a nozzle's thrust
  double disturbance_m_n;  // of the disturbance, as a force on the nominal mass
};

// What is known of a robot at the moment of drawing.
struct RobotPicture {
  std::optional<nav_msgs::Odometry> odometry;
  std::optional<atmos_msgs::ThrusterCommand> command;  // only while it acts
  std::optional<StampedSetPoint> set_point;            // that holds
  std::optional<nav_msgs::Path> predicted;
  std::optional<trajectory_msgs::MultiDOFJointTrajectory> reference;
  std::optional<atmos_msgs::Disturbance> disturbance;
  std::deque<geometry_msgs::Point> trail;
};

// What people look at in two layers: the robots, and what their controllers think.
struct RobotLayers {
  visualization_msgs::MarkerArray robots;   // body, thrust, set-point, trail
  visualization_msgs::MarkerArray control;  // predicted, reference, disturbance
};

// Marker namespaces are "<robot> body", "<robot> thrust", "<robot> set-point", "<robot> trail", "<robot>
// predicted",
// "<robot> reference", "<robot> disturbance": each can be switched off in rviz.
class RobotMarkers {
 public:
  RobotMarkers(std::string robot, const Vehicle& vehicle, const MarkerScales& scales)
      : robot_(std::move(robot)), vehicle_(vehicle), scales_(scales) {}

  // Everything that is to be seen now, and deletions of what was there the time before and is not any more.
  RobotLayers draw(const RobotPicture& picture);

 private:
  visualization_msgs::Marker& add(const std::string& part, int id, int type,
                                  const std_msgs::ColorRGBA& paint);
  void add_cylinder(const std::string& part, int id, const geometry_msgs::Pose& pose, double radius, double z,
                    double height, const std_msgs::ColorRGBA& paint);
  void add_heading(const std::string& part, const geometry_msgs::Pose& pose, double z, double length,
                   const std_msgs::ColorRGBA& paint);
  visualization_msgs::Marker& add_text(const std::string& part, int id, const geometry_msgs::Point& place,
                                       const std::string& text, double height,
                                       const std_msgs::ColorRGBA& paint);
  void add_body(const geometry_msgs::Pose& pose);
  void add_thrust(const geometry_msgs::Pose& pose, const atmos_msgs::ThrusterCommand& command);
  void add_set_point(const StampedSetPoint& point);
  void add_disturbance(const geometry_msgs::Pose& pose, const atmos_msgs::Disturbance& disturbance);
  void add_plans(const RobotPicture& picture);
  // The layer drawn since the last call, with deletions of what was `shown` the time before and is not any
  // more.
  visualization_msgs::MarkerArray finish(std::set<std::pair<std::string, int>>& shown);

  std::string robot_;
  Vehicle vehicle_;
  MarkerScales scales_;
  visualization_msgs::MarkerArray array_;  // of the layer that is being drawn
  std::set<std::pair<std::string, int>> shown_robots_, shown_control_;
};

}  // namespace atmos
