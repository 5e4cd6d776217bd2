// nmpc/thrusters, nmpc/wrench, nmpc/rate, odometry -> thruster_command, flight_controller/status,
// diagnostics. Parameters: ~vehicle, ~config (paths of the vehicle and the flight controller file), ~lockstep
// (bool).
#include <atmos_msgs/FlightControllerStatus.h>
#include <atmos_msgs/MocapStatus.h>
#include <atmos_msgs/RateCommand.h>
#include <atmos_msgs/ThrusterCommand.h>
#include <diagnostic_updater/diagnostic_updater.h>
#include <geometry_msgs/WrenchStamped.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>

#include <cmath>
#include <deque>
#include <optional>

#include "atmos_model/odometry_gate.h"
#include "atmos_model_ros/messages.h"
#include "atmos_model_ros/node.h"
#include "atmos_px4_bridge/flight_controller.h"

namespace atmos {

namespace {

constexpr std::uint32_t kQueue = 10000;  // messages: nothing may be lost at many times real time
constexpr double kTick_s = 0.005;

// Microseconds are what a double resolves; the rest would be noise in the stamp.
ros::Time ros_time(double seconds) {
  const double whole = std::floor(seconds);
  const double micros = std::round((seconds - whole) * 1e6);
  return ros::Time(static_cast<std::uint32_t>(whole), 0) +
         ros::Duration(0, static_cast<std::int32_t>(micros) * 1000);
}

bool is_finite(const nav_msgs::Odometry& odometry) {
  const auto& p = odometry.pose.pose.position;
  const auto& q = odometry.pose.pose.orientation;
  const auto& v = odometry.twist.twist.linear;
  const auto& w = odometry.twist.twist.angular;
  return std::isfinite(p.x + p.y + p.z + q.x + q.y + q.z + q.w + v.x + v.y + v.z + w.x + w.y + w.z);
}

class FlightControllerNode {
 public:
  FlightControllerNode(const Vehicle& vehicle, const FlightControllerConfig& config, Pacing pacing)
      : lockstep_(pacing == Pacing::kLockstep), core_(vehicle, config, pacing) {
    command_publisher_ = node_.advertise<atmos_msgs::ThrusterCommand>("thruster_command", kQueue);
    status_publisher_ =
        node_.advertise<atmos_msgs::FlightControllerStatus>("flight_controller/status", kQueue);
    diagnostics_.setHardwareID("none");
    diagnostics_.add("flight controller", this, &FlightControllerNode::diagnose);

    const auto hints = ros::TransportHints().tcpNoDelay();
    command_subscriber_ =
        node_.subscribe("nmpc/thrusters", kQueue, &FlightControllerNode::on_command, this, hints);
    wrench_subscriber_ =
        node_.subscribe("nmpc/wrench", kQueue, &FlightControllerNode::on_wrench, this, hints);
    rate_subscriber_ = node_.subscribe("nmpc/rate", kQueue, &FlightControllerNode::on_rate, this, hints);
    odometry_subscriber_ =
        node_.subscribe("odometry", kQueue, &FlightControllerNode::on_odometry, this, hints);
    mocap_status_subscriber_ =
        node_.subscribe("mocap/status", kQueue, &FlightControllerNode::on_mocap_status, this, hints);
    if (!lockstep_) timer_ = node_.createTimer(ros::Duration(kTick_s), &FlightControllerNode::on_tick, this);
  }

 private:
  void on_command(const atmos_msgs::ThrusterCommand& message) {
    publish(core_.take_command(from_message(message), ros::Time::now().toSec()));
    diagnostics_.update();
  }

  void on_wrench(const geometry_msgs::WrenchStamped& message) {
    const auto& wrench = message.wrench;
    publish(core_.take_wrench(message.header.stamp.toSec(), {wrench.force.x, wrench.force.y, wrench.torque.z},
                              ros::Time::now().toSec()));
    diagnostics_.update();
  }

  void on_rate(const atmos_msgs::RateCommand& message) {
    held_.push_back(message);
    pass_on_rates();
  }

  // In lockstep a rate command waits for the odometry of its period: which came first would differ from run
  // to run.
  void pass_on_rates() {
    while (!held_.empty() && (!lockstep_ || gate_.complete(held_.front().header.stamp.toSec()))) {
      const atmos_msgs::RateCommand message = held_.front();
      held_.pop_front();
      publish(core_.take_rate(message.header.stamp.toSec(), {message.force.x, message.force.y},
                              message.angular_rate.z, ros::Time::now().toSec()));
      diagnostics_.update();
    }
  }

  void on_odometry(const nav_msgs::Odometry& message) {
    const double stamp = message.header.stamp.toSec();
    if (is_finite(message))
      core_.take_odometry(stamp, message.twist.twist.angular.z, ros::Time::now().toSec());
    gate_.on_odometry(stamp);
    pass_on_rates();
  }

  void on_mocap_status(const atmos_msgs::MocapStatus& message) {
    gate_.on_status(message.header.stamp.toSec(), message.published);
    pass_on_rates();
  }

  void on_tick(const ros::TimerEvent&) {
    publish(core_.tick(ros::Time::now().toSec()));
    diagnostics_.update();
  }

  void publish(const std::optional<ValveOrder>& order) {
    if (!order) return;
    atmos_msgs::ThrusterCommand command;
    command.header.stamp = ros_time(order->command.stamp_s);
    command.period = order->command.period_s;
    command.duty = order->command.duty;
    command_publisher_.publish(command);

    const FlightStatus& status = order->status;
    atmos_msgs::FlightControllerStatus message;
    message.header.stamp = command.header.stamp;
    message.state = status.flying ? atmos_msgs::FlightControllerStatus::FLYING
                                  : atmos_msgs::FlightControllerStatus::CLOSED;
    message.reason = status.reason;
    message.commands = status.commands;
    message.late = status.late;
    message.expired = status.expired;
    message.malformed = status.malformed;
    status_publisher_.publish(message);
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& out) {
    const FlightStatus& status = core_.status();
    if (status.flying) {
      out.summary(diagnostic_msgs::DiagnosticStatus::OK, "flying");
    } else {
      out.summary(diagnostic_msgs::DiagnosticStatus::WARN, "valves closed: " + status.reason);
    }
    out.add("commands", status.commands);
    out.add("late", status.late);
    out.add("expired", status.expired);
    out.add("malformed", status.malformed);
    out.add("wrenches scaled", status.scaled);
  }

  ros::NodeHandle node_;
  bool lockstep_;
  FlightController core_;
  OdometryGate gate_;
  std::deque<atmos_msgs::RateCommand> held_;
  diagnostic_updater::Updater diagnostics_;
  ros::Publisher command_publisher_, status_publisher_;
  ros::Subscriber command_subscriber_, wrench_subscriber_, rate_subscriber_, odometry_subscriber_,
      mocap_status_subscriber_;
  ros::Timer timer_;
};

}  // namespace

}  // namespace atmos

int main(int argc, char** argv) {
  return atmos::run_node(argc, argv, "flight_controller", [] {
    const ros::NodeHandle parameters("~");
    const auto vehicle = atmos::load_vehicle(atmos::required_parameter<std::string>(parameters, "vehicle"));
    const auto config =
        atmos::load_flight_controller(atmos::required_parameter<std::string>(parameters, "config"), vehicle);
    const bool lockstep = atmos::required_parameter<bool>(parameters, "lockstep");
    const atmos::FlightControllerNode node(vehicle, config,
                                           lockstep ? atmos::Pacing::kLockstep : atmos::Pacing::kRealTime);
    ros::spin();
    return 0;
  });
}
