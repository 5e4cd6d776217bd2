#include "px4_services.h"

#include <ros/ros.h>

#include <cmath>
#include <limits>
#include <utility>

namespace atmos {

namespace {

constexpr double kAnswer_s = 1.0;  // wall time that the autopilot may take
constexpr double kPoll_s = 0.001;
constexpr const char* kNoAnswer = "no answer: no link, or no such parameter";
constexpr const char* kNeedsMavlink = "needs MAVLink: link:=mavlink or both";

bool within(double value, double least, double most) { return value >= least && value <= most; }

}  // namespace

Px4Services::Px4Services(ros::NodeHandle node, Px4Bridge& bridge, int thrusters,
                         std::function<void()> serve_line)
    : bridge_(bridge), thrusters_(thrusters), serve_line_(std::move(serve_line)) {
  servers_.push_back(node.advertiseService("px4/arm", &Px4Services::arm, this));
  servers_.push_back(node.advertiseService("px4/kill", &Px4Services::kill, this));
  servers_.push_back(node.advertiseService("px4/set_mode", &Px4Services::set_mode, this));
  servers_.push_back(node.advertiseService("px4/get_parameter", &Px4Services::get_parameter, this));
  servers_.push_back(node.advertiseService("px4/set_parameter", &Px4Services::set_parameter, this));
  servers_.push_back(node.advertiseService("px4/test_thruster", &Px4Services::test_thruster, this));
}

bool Px4Services::arm(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response) {
  bridge_.manager().request(request.data);
  response.success = true;
  response.message = request.data ? "streaming set-points, then offboard, then armed: see px4/supervisor"
                                  : "manual, then disarmed: see px4/supervisor";
  return true;
}

bool Px4Services::kill(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response) {
  bridge_.manager().set_kill(request.data);
  bridge_.manager().tick(ros::Time::now().toSec());
  response.success = true;
  return true;
}

bool Px4Services::set_mode(atmos_msgs::SetFlightMode::Request& request,
                           atmos_msgs::SetFlightMode::Response& response) {
  const FlightMode mode = mode_named(request.mode);
  response.success = mode != FlightMode::kUnknown && mode != FlightMode::kOffboard;
  if (response.success) {
    bridge_.link().send_mode(mode, ros::Time::now().toSec());
  } else {
    response.message = mode == FlightMode::kOffboard ? "use px4/arm" : "no such mode";
  }
  return true;
}

bool Px4Services::wait_for(const std::string& name) {
  const ros::WallTime limit = ros::WallTime::now() + ros::WallDuration(kAnswer_s);
  const auto done = [&] { return parameter_ && parameter_->name == name; };
  while (ros::ok() && !done() && ros::WallTime::now() < limit) {
    serve_line_();
    ros::WallDuration(kPoll_s).sleep();
  }
  return done();
}

bool Px4Services::read_parameter(const std::string& name) {
  parameter_.reset();
  bridge_.mavlink()->request_parameter(name);
  return wait_for(name);
}

bool Px4Services::get_parameter(atmos_msgs::GetParameter::Request& request,
                                atmos_msgs::GetParameter::Response& response) {
  if (bridge_.mavlink() == nullptr) {
    response.message = kNeedsMavlink;
    return true;
  }
  response.success = read_parameter(request.name);
  if (response.success) response.value = parameter_->value;
  if (!response.success) response.message = kNoAnswer;
  return true;
}

bool Px4Services::set_parameter(atmos_msgs::SetParameter::Request& request,
                                atmos_msgs::SetParameter::Response& response) {
  if (bridge_.mavlink() == nullptr) {
    response.message = kNeedsMavlink;
    return true;
  }
  // Its type is known only to the autopilot.
  if (!read_parameter(request.name)) {
    response.message = kNoAnswer;
    return true;
  }
  const Parameter wanted{request.name, request.value, parameter_->type};
  parameter_.reset();
  bridge_.mavlink()->set_parameter(wanted);
  const bool answered = wait_for(wanted.name);
  response.value = answered ? parameter_->value : std::numeric_limits<double>::quiet_NaN();
  response.success =
      answered && std::abs(response.value - request.value) <= 1e-6 * (1.0 + std::abs(request.value));
  if (!response.success) response.message = answered ? "the autopilot kept another value" : "no confirmation";
  return true;
}

bool Px4Services::test_thruster(atmos_msgs::TestThruster::Request& request,
                                atmos_msgs::TestThruster::Response& response) {
  if (bridge_.mavlink() == nullptr) {
    response.message = kNeedsMavlink;
    return true;
  }
  response.success = request.thruster >= 1 && request.thruster <= thrusters_ &&
                     within(request.duty, 0.0, 1.0) && within(request.duration, 0.0, 3.0) &&
                     !bridge_.manager().status().autopilot.armed;
  if (response.success) {
    bridge_.mavlink()->send_actuator_test(request.thruster, request.duty, request.duration);
  } else {
    response.message =
        "refused: thruster, duty [0, 1] or duration [0, 3] s out of range, or the vehicle is armed";
  }
  return true;
}

}  // namespace atmos
