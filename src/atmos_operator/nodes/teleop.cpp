// joy -> nmpc/wrench, nmpc/rate (closed valves: nmpc/thrusters) or setpoint: a hand in the controller's
// place, or one that moves the set-point it flies to (docs/operator.md, "Teleoperation"). Parameters:
// ~vehicle, ~config (files), ~mode (wrench, rate, position). Ends with exit code 1 when another node may
// command too.
#include <atmos_msgs/RateCommand.h>
#include <atmos_msgs/ThrusterCommand.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/WrenchStamped.h>
#include <nav_msgs/Odometry.h>
#include <ros/master.h>
#include <ros/ros.h>
#include <ros/steady_timer.h>
#include <sensor_msgs/Joy.h>

#include <algorithm>
#include <cmath>

#include "atmos_model/steady_clock.h"
#include "atmos_model_ros/messages.h"
#include "atmos_model_ros/node.h"
#include "atmos_operator/teleop.h"

namespace atmos {
namespace {

constexpr double kTick_s = 0.01, kOwner_s = 1.0;
constexpr double kLead_s = 0.03;       // a command is sent this long before its period starts
constexpr double kSetPoint_s = 0.1;    // between two set-points
constexpr double kSameInstant = 1e-6;  // s

// The hand's time is the steady clock's: it goes on when simulated time stands still.
class TeleopNode {
 public:
  TeleopNode(const TeleopConfig& config, const Vehicle& vehicle, TeleopMode mode)
      : mode_(mode), pwm_(vehicle.pwm), thrusters_(vehicle.thrusters.size()), core_(config, vehicle, mode) {
    std::string robot = node_.getNamespace();
    base_frame_ = base_frame(robot.erase(0, robot.find_first_not_of('/')));
    if (mode == TeleopMode::kPosition) {
      set_points_ = node_.advertise<geometry_msgs::PoseStamped>("setpoint", 10);
      odometry_ = node_.subscribe("odometry", 1, &TeleopNode::on_odometry, this);
    } else {
      closed_ = node_.advertise<atmos_msgs::ThrusterCommand>("nmpc/thrusters", 10);
      if (mode == TeleopMode::kWrench)
        commands_ = node_.advertise<geometry_msgs::WrenchStamped>("nmpc/wrench", 10);
      else
        commands_ = node_.advertise<atmos_msgs::RateCommand>("nmpc/rate", 10);
      owner_timer_ =
          node_.createSteadyTimer(ros::WallDuration(kOwner_s), [this](const ros::SteadyTimerEvent&) {
            if (!commands_alone()) ros::shutdown();
          });
    }
    joy_ = node_.subscribe("joy", 1, &TeleopNode::on_joy, this, ros::TransportHints().tcpNoDelay());
    timer_ =
        node_.createSteadyTimer(ros::WallDuration(kTick_s), [this](const ros::SteadyTimerEvent&) { tick(); });
  }

  // Exit code.
  int run() {
    if (mode_ != TeleopMode::kPosition && !commands_alone()) return 1;
    ros::spin();
    return alone_ ? 0 : 1;
  }

 private:
  // Two nodes that command are none: the valves would follow whoever speaks last.
  bool commands_alone() {
    XmlRpc::XmlRpcValue request, response, state;
    request[0] = ros::this_node::getName();
    if (!ros::master::execute("getSystemState", request, response, state, false)) return true;
    XmlRpc::XmlRpcValue& published = state[0];
    for (int i = 0; i < published.size(); ++i) {
      const std::string topic = published[i][0];
      if (topic != node_.resolveName("nmpc/thrusters") && topic != node_.resolveName("nmpc/wrench") &&
          topic != node_.resolveName("nmpc/rate"))
        continue;
      for (int k = 0; k < published[i][1].size(); ++k) {
        const std::string who = published[i][1][k];
        if (who == ros::this_node::getName()) continue;
        ROS_ERROR("%s publishes %s: start the robot with nmpc:=false, or fly mode:=position", who.c_str(),
                  topic.c_str());
        alone_ = false;
        return false;
      }
    }
    return true;
  }

  void on_joy(const sensor_msgs::Joy& message) {
    core_.take({message.axes.begin(), message.axes.end()}, {message.buttons.begin(), message.buttons.end()},
               steady_seconds());
    if (!core_.fault().empty())
      ROS_WARN_THROTTLE(1.0, "joystick refused, valves closed: %s (%lu so far)", core_.fault().c_str(),
                        static_cast<unsigned long>(core_.refused()));
    tick();
  }

  void on_odometry(const nav_msgs::Odometry& message) {
    if (message.header.frame_id != kWorldFrame) return;
    const auto& p = message.pose.pose.position;
    core_.see({p.x, p.y, yaw_of(message.pose.pose.orientation)}, steady_seconds());
  }

  void tick() {
    const double now = ros::Time::now().toSec();
    const auto command = core_.due(steady_seconds());
    if (!command || now <= 0.0) return;
    if (command->closed != !flying_) ROS_INFO("%s", command->closed ? "released" : "the dead man is held");
    flying_ = !command->closed;
    if (mode_ == TeleopMode::kPosition)
      publish_set_point(*command, now);
    else
      publish_command(*command, now);
  }

  void publish_set_point(const TeleopCommand& command, double now) {
    if (!command.closed && std::abs(now - sent_s_) < kSetPoint_s) return;
    sent_s_ = now;
    geometry_msgs::PoseStamped message;
    message.header.frame_id = kWorldFrame;
    message.header.stamp.fromSec(now);
    message.pose = planar_pose(command.pose.x(), command.pose.y(), command.pose.z());
    set_points_.publish(message);
  }

  void publish_command(const TeleopCommand& command, double now) {
    if (sent_s_ > now + 2.0 * pwm_.period_s) sent_s_ = 0.0;  // a simulator that was started again
    const double current = std::floor((now + kSameInstant) / pwm_.period_s) * pwm_.period_s;
    std_msgs::Header header;
    header.frame_id = base_frame_;
    if (command.closed) {
      // Replaces what is left of the newest command; no other follows it.
      header.stamp.fromSec(std::max(sent_s_, current));
      atmos_msgs::ThrusterCommand message;
      message.header = header;
      message.period = pwm_.period_s;
      message.duty.assign(thrusters_, 0.0);
      closed_.publish(message);
      return;
    }
    const double next = std::floor((now + kLead_s + kSameInstant) / pwm_.period_s) * pwm_.period_s;
    if (next < sent_s_ + 0.5 * pwm_.period_s) return;
    sent_s_ = next;
    header.stamp.fromSec(next);
    if (mode_ == TeleopMode::kWrench) {
      geometry_msgs::WrenchStamped message;
      message.header = header;
      message.wrench.force.x = command.wrench[0];
      message.wrench.force.y = command.wrench[1];
      message.wrench.torque.z = command.wrench[2];
      commands_.publish(message);
    } else {
      atmos_msgs::RateCommand message;
      message.header = header;
      message.force.x = command.wrench[0];
      message.force.y = command.wrench[1];
      message.angular_rate.z = command.yaw_rate;
      commands_.publish(message);
    }
  }

  ros::NodeHandle node_;
  TeleopMode mode_;
  Pwm pwm_;
  std::size_t thrusters_;
  Teleop core_;
  std::string base_frame_;
  bool alone_ = true, flying_ = false;
  double sent_s_ = 0.0;  // stamp of the newest command or set-point
  ros::Publisher commands_, closed_, set_points_;
  ros::Subscriber joy_, odometry_;
  ros::SteadyTimer timer_, owner_timer_;
};

int run() {
  const ros::NodeHandle parameters("~");
  const Vehicle vehicle = load_vehicle(required_parameter<std::string>(parameters, "vehicle"));
  const TeleopConfig config = load_teleop(required_parameter<std::string>(parameters, "config"));
  const auto mode = required_parameter<std::string>(parameters, "mode");
  if (mode != "wrench" && mode != "rate" && mode != "position")
    throw ConfigError(
        {{parameters.getNamespace(), 0, "mode", "must be wrench, rate or position, is '" + mode + "'"}});
  TeleopNode node(
      config, vehicle,
      mode == "wrench" ? TeleopMode::kWrench : (mode == "rate" ? TeleopMode::kRate : TeleopMode::kPosition));
  return node.run();
}

}  // namespace
}  // namespace atmos

int main(int argc, char** argv) { return atmos::run_node(argc, argv, "teleop", atmos::run); }
