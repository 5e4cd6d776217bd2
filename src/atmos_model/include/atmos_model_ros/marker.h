// What every marker of ours begins with.
#pragma once

#include <visualization_msgs/Marker.h>

#include <Eigen/Core>
#include <string>

#include "atmos_model_ros/messages.h"

namespace atmos {

inline std_msgs::ColorRGBA color(float r, float g, float b, float a) {
  std_msgs::ColorRGBA c;
  c.r = r;
  c.g = g;
  c.b = b;
  c.a = a;
  return c;
}

inline geometry_msgs::Point point_at(const Eigen::Vector3d& p) {
  geometry_msgs::Point point;
  point.x = p.x();
  point.y = p.y();
  point.z = p.z();
  return point;
}

// In the world frame, stamped 0: drawn where it was last said to be, whatever the age of transforms.
inline visualization_msgs::Marker make_marker(const std::string& ns, int id, int type,
                                              const std_msgs::ColorRGBA& paint) {
  visualization_msgs::Marker m;
  m.header.frame_id = kWorldFrame;
  m.ns = ns;
  m.id = id;
  m.type = type;
  m.action = visualization_msgs::Marker::ADD;
  m.color = paint;
  m.pose.orientation.w = 1.0;
  return m;
}

}  // namespace atmos
