#include "robot_markers.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "atmos_model_ros/marker.h"
#include "atmos_model_ros/messages.h"
#include "atmos_operator/thrust_arrows.h"

namespace atmos {

namespace {

using visualization_msgs::Marker;

const auto kBody = color(0.16f, 0.20f, 0.27f, 1.0f);
const auto kDeck = color(0.86f, 0.88f, 0.91f, 1.0f);
const auto kNose = color(0.20f, 0.55f, 0.90f, 1.0f);
const auto kThrust = color(1.0f, 0.45f, 0.05f, 0.95f);
const auto kSetPoint = color(0.10f, 0.62f, 0.35f, 0.35f);
const auto kSetPointNose = color(0.10f, 0.62f, 0.35f, 0.9f);
const auto kTrail = color(0.12f, 0.44f, 0.71f, 0.8f);
const auto kPredicted = color(0.85f, 0.27f, 0.63f, 1.0f);
const auto kReference = color(0.10f, 0.62f, 0.35f, 0.9f);
const auto kDisturbance = color(0.55f, 0.15f, 0.85f, 0.95f);
const auto kInk = color(0.10f, 0.12f, 0.16f, 1.0f);

constexpr double kLongestArrow_m = 1.0;
constexpr double kLine_m = 0.02;

}  // namespace

Marker& RobotMarkers::add(const std::string& part, int id, int type, const std_msgs::ColorRGBA& paint) {
  array_.markers.push_back(make_marker(robot_ + " " + part, id, type, paint));
  return array_.markers.back();
}

void RobotMarkers::add_cylinder(const std::string& part, int id, const geometry_msgs::Pose& pose,
                                double radius, double z, double height, const std_msgs::ColorRGBA& paint) {
  Marker& m = add(part, id, Marker::CYLINDER, paint);
  m.pose = pose;
  m.pose.position.z = z + 0.5 * height;
  m.scale.x = m.scale.y = 2.0 * radius;
  m.scale.z = height;
}

void RobotMarkers::add_heading(const std::string& part, const geometry_msgs::Pose& pose, double z,
                               double length, const std_msgs::ColorRGBA& paint) {
  Marker& m = add(part, 1, Marker::ARROW, paint);
  m.pose = pose;
  m.pose.position.z = z;
  m.scale.x = length;
  m.scale.y = m.scale.z = 0.04;
}

Marker& RobotMarkers::add_text(const std::string& part, int id, const geometry_msgs::Point& place,
                               const std::string& text, double height, const std_msgs::ColorRGBA& paint) {
  Marker& m = add(part, id, Marker::TEXT_VIEW_FACING, paint);
  m.pose.position = place;
  m.scale.z = height;
  m.text = text;
  return m;
}

void RobotMarkers::add_body(const geometry_msgs::Pose& pose) {
  const double height = vehicle_.height_m;
  add_cylinder("body", 0, pose, vehicle_.radius_m, 0.0, height, kBody);
  add_cylinder("body", 2, pose, 0.85 * vehicle_.radius_m, height, 0.01, kDeck);
  add_heading("body", pose, height + 0.03, 0.9 * vehicle_.radius_m, kNose);
  geometry_msgs::Point place = pose.position;
  place.y -= vehicle_.radius_m + 0.15;  // on the floor beside it, on the side one looks from
  place.z = 0.03;
  add_text("body", 3, place, robot_, 0.1, kInk);
}

// An arrow at every open nozzle, as long as its thrust, with the nozzle's number.
void RobotMarkers::add_thrust(const geometry_msgs::Pose& pose, const atmos_msgs::ThrusterCommand& command) {
  const double yaw = yaw_of(pose.orientation), z = vehicle_.height_m + 0.05;  // above the deck
  for (const ThrustArrow& arrow : thrust_arrows(vehicle_, command.duty, scales_.thrust_m_n)) {
    Marker& m = add("thrust", arrow.thruster, Marker::ARROW, kThrust);
    m.pose = pose;
    m.pose.position.z = z;
    m.points = {point_at(arrow.tail_B), point_at(arrow.head_B)};
    m.scale.x = 0.025;
    m.scale.y = 0.055;
    m.scale.z = 0.5 * (arrow.tail_B - arrow.head_B).norm();
    // Behind the jet, or two nozzles of one corner would write over each other.
    const Eigen::Vector2d jet = (arrow.tail_B - arrow.head_B).head<2>();
    const Eigen::Vector2d at_W = rotation_WB(yaw) * (arrow.tail_B.head<2>() + 0.05 * jet.normalized());
    geometry_msgs::Point place;
    place.x = pose.position.x + at_W.x();
    place.y = pose.position.y + at_W.y();
    place.z = z + 0.03;
    add_text("thrust", 100 + arrow.thruster, place, std::to_string(arrow.thruster), 0.06, kThrust);
  }
}

void RobotMarkers::add_set_point(const StampedSetPoint& point) {
  const geometry_msgs::Pose pose = planar_pose(point.x_m, point.y_m, point.yaw_rad);
  add_cylinder("set-point", 0, pose, 1.15 * vehicle_.radius_m, 0.0, 0.01, kSetPoint);
  add_heading("set-point", pose, 0.03, 1.8 * vehicle_.radius_m, kSetPointNose);
}

void RobotMarkers::add_disturbance(const geometry_msgs::Pose& pose,
                                   const atmos_msgs::Disturbance& disturbance) {
  const auto& a = disturbance.linear_acceleration;
  const Eigen::Vector2d force_W = vehicle_.mass_kg * Eigen::Vector2d(a.x, a.y);
  const double torque = vehicle_.inertia_kg_m2.z() * disturbance.angular_acceleration.z;
  if (!force_W.allFinite() || !std::isfinite(torque)) return;
  const double z = vehicle_.height_m + 0.12;
  const double length = std::min(scales_.disturbance_m_n * force_W.norm(), kLongestArrow_m);
  const Eigen::Vector2d tail(pose.position.x, pose.position.y);
  const Eigen::Vector2d head = tail + length * force_W.normalized();
  if (length > 0.01) {
    Marker& m = add("disturbance", 0, Marker::ARROW, kDisturbance);
    m.points = {point_at({tail.x(), tail.y(), z}), point_at({head.x(), head.y(), z})};
    m.scale.x = 0.03;
    m.scale.y = 0.07;
    m.scale.z = std::min(0.1, 0.5 * length);
  }
  char text[80];
  std::snprintf(text, sizeof(text), "disturbance %.0f mN, %.1f mN m", 1e3 * force_W.norm(), 1e3 * torque);
  add_text("disturbance", 1, point_at({tail.x(), tail.y() + vehicle_.radius_m + 0.12, z}), text, 0.07,
           kDisturbance);
}

void RobotMarkers::add_plans(const RobotPicture& picture) {
  if (picture.predicted && picture.predicted->poses.size() > 1) {
    Marker& m = add("predicted", 0, Marker::LINE_STRIP, kPredicted);
    m.scale.x = 1.25 * kLine_m;
    for (const auto& pose : picture.predicted->poses) m.points.push_back(pose.pose.position);
    for (auto& p : m.points) p.z = vehicle_.height_m + 0.15;  // over the robot, which would hide it
  }
  if (picture.reference && picture.reference->points.size() > 1) {
    Marker& m = add("reference", 0, Marker::LINE_STRIP, kReference);
    m.scale.x = kLine_m;
    for (const auto& from : picture.reference->points) {
      if (from.transforms.empty()) continue;
      m.points.push_back(
          point_at({from.transforms[0].translation.x, from.transforms[0].translation.y, 0.015}));
    }
    if (m.points.size() < 2) array_.markers.pop_back();
  }
}

visualization_msgs::MarkerArray RobotMarkers::finish(std::set<std::pair<std::string, int>>& shown) {
  visualization_msgs::MarkerArray layer;
  std::swap(layer, array_);
  std::set<std::pair<std::string, int>> now;
  for (const Marker& m : layer.markers) now.emplace(m.ns, m.id);
  for (const auto& [ns, id] : shown) {
    if (now.count({ns, id}) != 0) continue;
    Marker gone = make_marker(ns, id, Marker::CUBE, kInk);
    gone.action = Marker::DELETE;
    layer.markers.push_back(gone);
  }
  shown = now;
  return layer;
}

RobotLayers RobotMarkers::draw(const RobotPicture& picture) {
  RobotLayers layers;
  if (picture.set_point) add_set_point(*picture.set_point);
  if (picture.trail.size() > 1) {
    Marker& m = add("trail", 0, Marker::LINE_STRIP, kTrail);
    m.scale.x = kLine_m;
    m.points.assign(picture.trail.begin(), picture.trail.end());
  }
  if (picture.odometry) {
    add_body(picture.odometry->pose.pose);
    if (picture.command) add_thrust(picture.odometry->pose.pose, *picture.command);
  }
  layers.robots = finish(shown_robots_);

  add_plans(picture);
  if (picture.odometry && picture.disturbance)
    add_disturbance(picture.odometry->pose.pose, *picture.disturbance);
  layers.control = finish(shown_control_);
  return layers;
}

}  // namespace atmos
