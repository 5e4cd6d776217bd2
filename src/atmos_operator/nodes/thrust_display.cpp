// thruster_command + odometry + setpoint -> display/thrust: the robot's body, an arrow at each open nozzle,
// the set-point that holds. Parameters: ~vehicle (file), ~rate_hz, ~metres_per_newton.
#include <atmos_msgs/ThrusterCommand.h>
#include <geometry_msgs/PoseStamped.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <visualization_msgs/MarkerArray.h>

#include <optional>
#include <string>

#include "atmos_model_ros/messages.h"
#include "atmos_model_ros/node.h"
#include "atmos_operator/setpoint_queue.h"
#include "atmos_operator/thrust_arrows.h"

namespace {

using visualization_msgs::Marker;

std_msgs::ColorRGBA color(float r, float g, float b, float a) {
  std_msgs::ColorRGBA c;
  c.r = r;
  c.g = g;
  c.b = b;
  c.a = a;
  return c;
}

const std_msgs::ColorRGBA kBody = color(0.16f, 0.20f, 0.27f, 1.0f);
const std_msgs::ColorRGBA kDeck = color(0.86f, 0.88f, 0.91f, 1.0f);
const std_msgs::ColorRGBA kNose = color(0.20f, 0.55f, 0.90f, 1.0f);
const std_msgs::ColorRGBA kThrust = color(1.0f, 0.45f, 0.05f, 0.95f);
const std_msgs::ColorRGBA kSetPoint = color(0.10f, 0.62f, 0.35f, 0.35f);
const std_msgs::ColorRGBA kSetPointNose = color(0.10f, 0.62f, 0.35f, 0.9f);

geometry_msgs::Point to_point(const Eigen::Vector3d& p) {
  geometry_msgs::Point point;
  point.x = p.x();
  point.y = p.y();
  point.z = p.z();
  return point;
}

class ThrustDisplay {
 public:
  ThrustDisplay(ros::NodeHandle& node, const ros::NodeHandle& private_node)
      : vehicle_(atmos::load_vehicle(atmos::required_parameter<std::string>(private_node, "vehicle"))),
        metres_per_newton_(private_node.param("metres_per_newton", 0.15)),
        publisher_(node.advertise<visualization_msgs::MarkerArray>("display/thrust", 2)),
        command_(node.subscribe("thruster_command", 5, &ThrustDisplay::on_command, this)),
        odometry_(node.subscribe("odometry", 5, &ThrustDisplay::on_odometry, this)),
        setpoint_(node.subscribe("setpoint", 10, &ThrustDisplay::on_setpoint, this)),
        timer_(node.createTimer(ros::Duration(1.0 / private_node.param("rate_hz", 25.0)),
                                &ThrustDisplay::draw, this)) {}

 private:
  void on_command(const atmos_msgs::ThrusterCommand& message) { latest_command_ = message; }
  void on_odometry(const nav_msgs::Odometry& message) { latest_odometry_ = message; }
  void on_setpoint(const geometry_msgs::PoseStamped& message) {
    const auto& p = message.pose.position;
    setpoints_.add({message.header.stamp.toSec(), p.x, p.y, atmos::yaw_of(message.pose.orientation)});
  }

  Marker marker(const std::string& name, int id, int type, const std_msgs::ColorRGBA& paint) const {
    Marker m;
    m.header.frame_id = atmos::kWorldFrame;
    m.header.stamp = ros::Time();  // drawn where it was last said to be, whatever the age of transforms
    m.ns = name;
    m.id = id;
    m.type = type;
    m.action = Marker::ADD;
    m.color = paint;
    m.pose.orientation.w = 1.0;
    return m;
  }

  // An upright cylinder standing at height z on the floor point of `pose`.
  Marker cylinder(const std::string& name, int id, const geometry_msgs::Pose& pose, double radius, double z,
                  double height, const std_msgs::ColorRGBA& paint) const {
    Marker m = marker(name, id, Marker::CYLINDER, paint);
    m.pose = pose;
    m.pose.position.z = z + 0.5 * height;
    m.scale.x = m.scale.y = 2.0 * radius;
    m.scale.z = height;
    return m;
  }

  // A flat arrow along body x that shows the heading.
  Marker heading(const std::string& name, const geometry_msgs::Pose& pose, double z,
                 const std_msgs::ColorRGBA& paint) const {
    Marker m = marker(name, 1, Marker::ARROW, paint);
    m.pose = pose;
    m.pose.position.z = z;
    m.scale.x = 0.9 * vehicle_.radius_m;
    m.scale.y = m.scale.z = 0.04;
    return m;
  }

  void add_robot(visualization_msgs::MarkerArray& array) const {
    const geometry_msgs::Pose& pose = latest_odometry_->pose.pose;
    const double height = vehicle_.height_m;
    array.markers.push_back(cylinder("body", 0, pose, vehicle_.radius_m, 0.0, height, kBody));
    array.markers.push_back(cylinder("body", 2, pose, 0.85 * vehicle_.radius_m, height, 0.01, kDeck));
    array.markers.push_back(heading("body", pose, height + 0.03, kNose));
    if (!latest_command_) return;

    const double age = (ros::Time::now() - latest_command_->header.stamp).toSec();
    if (age > 2.0 * latest_command_->period) return;  // the period is over: the valves are closed
    for (const atmos::ThrustArrow& arrow :
         thrust_arrows(vehicle_, latest_command_->duty, metres_per_newton_)) {
      Marker m = marker("thrust", arrow.thruster, Marker::ARROW, kThrust);
      m.pose = pose;
      m.pose.position.z = height + 0.05;  // above the deck, where the body does not hide it
      m.points = {to_point(arrow.tail_B), to_point(arrow.head_B)};
      m.scale.x = 0.025;
      m.scale.y = 0.055;
      m.scale.z = 0.5 * (arrow.tail_B - arrow.head_B).norm();
      array.markers.push_back(m);
    }
  }

  void add_set_point(visualization_msgs::MarkerArray& array) {
    const auto point = setpoints_.at(ros::Time::now().toSec());
    if (!point) return;
    const geometry_msgs::Pose pose = atmos::planar_pose(point->x_m, point->y_m, point->yaw_rad);
    array.markers.push_back(cylinder("setpoint", 0, pose, 1.15 * vehicle_.radius_m, 0.0, 0.01, kSetPoint));
    Marker nose = heading("setpoint", pose, 0.03, kSetPointNose);
    nose.scale.x = 1.8 * vehicle_.radius_m;
    array.markers.push_back(nose);
  }

  void draw(const ros::TimerEvent&) {
    visualization_msgs::MarkerArray array;
    Marker wipe = marker("thrust", 0, Marker::ARROW, kThrust);
    wipe.action = Marker::DELETEALL;
    array.markers.push_back(wipe);
    add_set_point(array);
    if (latest_odometry_) add_robot(array);
    publisher_.publish(array);
  }

  atmos::Vehicle vehicle_;
  double metres_per_newton_;
  std::optional<atmos_msgs::ThrusterCommand> latest_command_;
  std::optional<nav_msgs::Odometry> latest_odometry_;
  atmos::SetpointQueue setpoints_;
  ros::Publisher publisher_;
  ros::Subscriber command_, odometry_, setpoint_;
  ros::Timer timer_;
};

}  // namespace

int main(int argc, char** argv) {
  return atmos::run_node(argc, argv, "thrust_display", [] {
    ros::NodeHandle node;
    ThrustDisplay display(node, ros::NodeHandle("~"));
    ros::spin();
    return 0;
  });
}
