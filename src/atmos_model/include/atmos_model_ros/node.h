// What every node's main does alike. For nodes only: cores include no ROS header.
#pragma once

#include <ros/ros.h>

#include <cstdio>
#include <stdexcept>
#include <string>

#include "atmos_model/strict_yaml.h"

namespace atmos {

// Runs `body` as the node `name`. Bad configuration: one line per fault on stderr, exit code 2, nothing
// started. So too for what no file shows by itself (std::invalid_argument: thrusters that cannot control the
// robot).
template <class Body>
int run_node(int argc, char** argv, const std::string& name, const Body& body) {
  try {
    ros::init(argc, argv, name);
    return body();
  } catch (const ConfigError& error) {
    std::fprintf(stderr, "%s\n", error.what());
  } catch (const std::invalid_argument& error) {
    std::fprintf(stderr, "%s: %s\n", name.c_str(), error.what());
  }
  return 2;
}

// A private parameter that the launch file must set; ConfigError when it is missing.
template <class T>
T required_parameter(const ros::NodeHandle& private_node, const std::string& name) {
  T value;
  if (!private_node.getParam(name, value))
    throw ConfigError({{private_node.getNamespace(), 0, name, "is a required parameter of this type"}});
  return value;
}

}  // namespace atmos
