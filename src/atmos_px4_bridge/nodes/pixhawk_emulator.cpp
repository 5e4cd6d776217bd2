// An emulated Pixhawk on two pseudo-terminals, in front of the simulator's valves: sim/truth (as its inertial
// sensors), battery -> valves. Parameters: ~vehicle, ~config (paths; config: PX4 parameters), ~device (where
// the pseudo-terminal of MAVLink appears; that of uxrce_dds_client is beside it: <device>_xrce), ~firmware
// (stock or patched). Services to break the lines: ~unplug (SetBool), ~reboot (Trigger).
#include <atmos_msgs/ThrusterCommand.h>
#include <nav_msgs/Odometry.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sensor_msgs/BatteryState.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>

#include <optional>

#include "atmos_model_ros/messages.h"
#include "atmos_model_ros/node.h"
#include "atmos_px4_bridge/emulator/pixhawk_emulator.h"
#include "atmos_px4_bridge/emulator/pseudo_terminal.h"

namespace atmos {
namespace {

constexpr double kPoll_s = 0.001;

class PixhawkEmulatorNode {
 public:
  PixhawkEmulatorNode(const Vehicle& vehicle, const PixhawkConfig& config, const std::string& device)
      : vehicle_(vehicle), config_(config), mavlink_(device), xrce_(device + "_xrce") {
    valves_ = node_.advertise<atmos_msgs::ThrusterCommand>("valves", 100);
    const auto hints = ros::TransportHints().tcpNoDelay();
    truth_ = node_.subscribe("sim/truth", 100, &PixhawkEmulatorNode::on_truth, this, hints);
    battery_ = node_.subscribe("battery", 10, &PixhawkEmulatorNode::on_battery, this, hints);
    ros::NodeHandle own("~");
    unplug_ = own.advertiseService("unplug", &PixhawkEmulatorNode::unplug, this);
    reboot_ = own.advertiseService("reboot", &PixhawkEmulatorNode::reboot, this);
  }

  void run() {
    while (ros::ok()) {
      ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(kPoll_s));
      const double now = ros::Time::now().toSec();
      if (now <= 0.0) continue;
      if (!pixhawk_) pixhawk_.emplace(config_, vehicle_, writer(mavlink_), now, writer(xrce_));
      std::uint8_t buffer[1024];
      while (const std::size_t size = mavlink_.read(buffer, sizeof(buffer)))
        pixhawk_->receive(buffer, size, now);
      while (const std::size_t size = xrce_.read(buffer, sizeof(buffer)))
        pixhawk_->receive_xrce(buffer, size, now);
      // Simulated time stands still between two ticks of its clock.
      if (now == ticked_s_) continue;
      ticked_s_ = now;
      if (const auto order = pixhawk_->tick(now)) publish(*order);
    }
  }

 private:
  static PixhawkEmulator::Write writer(PseudoTerminal& terminal) {
    return [&terminal](const std::uint8_t* data, std::size_t size) { terminal.write(data, size); };
  }
  void on_truth(const nav_msgs::Odometry& message) {
    const auto& w = message.twist.twist.angular;
    if (pixhawk_) pixhawk_->sense({w.x, w.y, w.z}, {0.0, 0.0, kGravity});
  }
  void on_battery(const sensor_msgs::BatteryState& message) {
    if (pixhawk_) pixhawk_->take_battery(message.voltage, message.percentage);
  }

  void publish(const ThrusterCommand& order) {
    atmos_msgs::ThrusterCommand message;
    message.header.stamp.fromSec(order.stamp_s);
    message.period = order.period_s;
    message.duty = order.duty;
    valves_.publish(message);
  }

  bool unplug(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response) {
    for (PseudoTerminal* terminal : {&mavlink_, &xrce_}) {
      if (request.data) {
        terminal->unplug();
      } else {
        terminal->plug();
      }
    }
    response.success = true;
    return true;
  }
  bool reboot(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
    if (pixhawk_) publish(pixhawk_->reboot(ros::Time::now().toSec()));
    response.success = pixhawk_.has_value();
    return true;
  }

  ros::NodeHandle node_;
  Vehicle vehicle_;
  PixhawkConfig config_;
  PseudoTerminal mavlink_, xrce_;
  std::optional<PixhawkEmulator> pixhawk_;
  ros::Publisher valves_;
  ros::Subscriber truth_, battery_;
  ros::ServiceServer unplug_, reboot_;
  double ticked_s_ = -1.0;
};

}  // namespace
}  // namespace atmos

int main(int argc, char** argv) {
  return atmos::run_node(argc, argv, "pixhawk_emulator", [] {
    const ros::NodeHandle node("~");
    const auto vehicle = atmos::load_vehicle(atmos::required_parameter<std::string>(node, "vehicle"));
    atmos::PixhawkConfig config;
    config.parameters =
        atmos::PixhawkParameters::load(atmos::required_parameter<std::string>(node, "config"));
    const auto firmware = atmos::required_parameter<std::string>(node, "firmware");
    if (firmware != "stock" && firmware != "patched")
      throw atmos::ConfigError({{node.getNamespace(), 0, "firmware", "must be one of stock, patched"}});
    config.firmware = firmware == "patched" ? atmos::Firmware::kPatched : atmos::Firmware::kStock;
    const auto device = atmos::required_parameter<std::string>(node, "device");
    try {
      atmos::PixhawkEmulatorNode(vehicle, config, device).run();
    } catch (const std::runtime_error& error) {
      std::fprintf(stderr, "pixhawk_emulator: %s\n", error.what());
      return 1;
    }
    return 0;
  });
}
