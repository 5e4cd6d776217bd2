// The services of the bridge: arm, kill, mode, parameters, thruster test (docs/px4_bridge.md, "Node").
#pragma once

#include <atmos_msgs/GetParameter.h>
#include <atmos_msgs/SetFlightMode.h>
#include <atmos_msgs/SetParameter.h>
#include <atmos_msgs/TestThruster.h>
#include <ros/node_handle.h>
#include <std_srvs/SetBool.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "atmos_px4_bridge/px4_bridge.h"

namespace atmos {

class Px4Services {
 public:
  // `serve_line` is called while a service waits for an answer of the autopilot.
  Px4Services(ros::NodeHandle node, Px4Bridge& bridge, int thrusters, std::function<void()> serve_line);
  void on_parameter(const Parameter& parameter) { parameter_ = parameter; }

 private:
  bool arm(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response);
  bool kill(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response);
  bool set_mode(atmos_msgs::SetFlightMode::Request& request, atmos_msgs::SetFlightMode::Response& response);
  bool get_parameter(atmos_msgs::GetParameter::Request& request,
                     atmos_msgs::GetParameter::Response& response);
  bool set_parameter(atmos_msgs::SetParameter::Request& request,
                     atmos_msgs::SetParameter::Response& response);
  bool test_thruster(atmos_msgs::TestThruster::Request& request,
                     atmos_msgs::TestThruster::Response& response);
  // Waits until a value of the parameter has come; false when it took too long.
  bool wait_for(const std::string& name);
  bool read_parameter(const std::string& name);

  Px4Bridge& bridge_;
  int thrusters_;
  std::function<void()> serve_line_;
  std::optional<Parameter> parameter_;
  std::vector<ros::ServiceServer> servers_;
};

}  // namespace atmos
