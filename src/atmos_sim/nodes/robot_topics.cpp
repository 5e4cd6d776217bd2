#include "robot_topics.h"

#include <atmos_msgs/Pneumatics.h>
#include <geometry_msgs/PoseStamped.h>
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/BatteryState.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "atmos_model_ros/messages.h"

namespace atmos {

namespace {

constexpr int kQueue = 10000;  // messages: nothing may be lost at many times real time
constexpr double kSameInstant = 1e-6;
constexpr double kPascalPerBar = 1e5;

}  // namespace

RobotTopics::RobotTopics(const ros::NodeHandle& node, const std::string& name, const Scenario& scenario,
                         Robot& robot, double start_s, std::function<void()> before_command)
    : base_frame_(base_frame(name)),
      scenario_(scenario),
      robot_(robot),
      before_command_(std::move(before_command)),
      mocap_(scenario.mocap, scenario.seed, start_s),
      node_(node) {
  pose_ = node_.advertise<geometry_msgs::PoseStamped>("mocap/pose", kQueue);
  truth_ = node_.advertise<nav_msgs::Odometry>("sim/truth", kQueue);
  if (scenario.vehicle.pneumatics)
    pneumatics_ = node_.advertise<atmos_msgs::Pneumatics>("pneumatics", kQueue);
  if (scenario.vehicle.battery) battery_ = node_.advertise<sensor_msgs::BatteryState>("battery", kQueue);
  commands_ = node_.subscribe("thruster_command", kQueue, &RobotTopics::take, this,
                              ros::TransportHints().tcpNoDelay());
}

void RobotTopics::take(const atmos_msgs::ThrusterCommand& message) {
  before_command_();
  const ThrusterCommand command = from_message(message);
  const ValveSchedule::Taken taken = robot_.command(command);
  newest_stamp_ = std::max(newest_stamp_, command.stamp_s);
  ++counts_.taken[static_cast<int>(taken)];
  if (taken == ValveSchedule::Taken::kMalformed)
    ROS_WARN_THROTTLE(1.0, "malformed command on %s ignored", commands_.getTopic().c_str());
}

double RobotTopics::next_publication_s() const {
  return frames_.empty() ? std::numeric_limits<double>::infinity() : frames_.front().publish_s;
}

void RobotTopics::expose(double now_s, double delay_s) {
  frames_.push_back({now_s + delay_s, mocap_.expose(robot_)});
}

void RobotTopics::publish_frames(double now_s) {
  while (!frames_.empty() && frames_.front().publish_s <= now_s + kSameInstant) {
    publish(frames_.front().frame);
    frames_.pop_front();
  }
}

void RobotTopics::publish(const MocapFrame& frame) const {
  geometry_msgs::PoseStamped message;
  message.header.stamp.fromSec(frame.stamp_s);
  message.header.frame_id = kWorldFrame;
  message.pose = planar_pose(frame.pose.p_W.x(), frame.pose.p_W.y(), frame.pose.yaw);
  if (std::isnan(frame.pose.yaw)) {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    message.pose.position.z = message.pose.orientation.x = message.pose.orientation.y = nan;
  }
  pose_.publish(message);
}

void RobotTopics::publish_truth(double now_s) const {
  const PlanarState<double> truth = robot_.truth();
  const Vec2<double> v_B = rotation_WB(truth.yaw).transpose() * truth.v_WC;
  nav_msgs::Odometry message;
  message.header.stamp.fromSec(now_s);
  message.header.frame_id = kWorldFrame;
  message.child_frame_id = base_frame_;
  message.pose.pose = planar_pose(truth.p_WC.x(), truth.p_WC.y(), truth.yaw);
  message.twist.twist.linear.x = v_B.x();
  message.twist.twist.linear.y = v_B.y();
  message.twist.twist.angular.z = truth.yaw_rate;
  truth_.publish(message);
}

void RobotTopics::publish_supplies(double now_s) const {
  if (const auto air = robot_.air()) {
    atmos_msgs::Pneumatics message;
    message.header.stamp.fromSec(now_s);
    message.header.frame_id = base_frame_;
    message.gas_used = air->gas_used_kg;
    message.gas_remaining = air->gas_remaining_kg;
    message.bottle_pressure = kPascalPerBar * air->bottle_bar;
    message.thruster_pressure = kPascalPerBar * air->thruster_bar;
    message.bearing_pressure = kPascalPerBar * air->bearing_bar;
    message.flow = robot_.air_flow_kg_s();
    message.tethered = scenario_.pneumatics && scenario_.pneumatics->tethered;
    pneumatics_.publish(message);
  }
  if (const auto battery = robot_.battery()) {
    sensor_msgs::BatteryState message;
    message.header.stamp.fromSec(now_s);
    message.header.frame_id = base_frame_;
    message.voltage = static_cast<float>(battery->voltage_v);
    message.current = static_cast<float>(-battery->current_a);  // negative: discharging
    message.charge = static_cast<float>(battery->charge_ah);
    message.capacity = message.design_capacity = static_cast<float>(scenario_.vehicle.battery->capacity_ah);
    message.percentage = static_cast<float>(battery->share);
    message.power_supply_status = sensor_msgs::BatteryState::POWER_SUPPLY_STATUS_DISCHARGING;
    message.power_supply_health = sensor_msgs::BatteryState::POWER_SUPPLY_HEALTH_GOOD;
    message.power_supply_technology = sensor_msgs::BatteryState::POWER_SUPPLY_TECHNOLOGY_LIPO;
    message.present = true;
    battery_.publish(message);
  }
}

}  // namespace atmos
