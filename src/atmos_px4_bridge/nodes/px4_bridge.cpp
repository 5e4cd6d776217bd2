// nmpc/*, odometry -> Pixhawk -> px4/*, imu, thruster_command (docs/px4_bridge.md, "Node"). Parameters:
// ~vehicle, ~config (paths), ~link (mavlink, xrce or both), ~device (of MAVLink: serial device or udp:...),
// ~baud, ~xrce_device (serial device), ~xrce_baud, ~arm_at_start (bool). Devices that the link does not use
// are not read.
#include <atmos_msgs/NmpcStatus.h>
#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <std_msgs/String.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "atmos_model/strict_yaml.h"
#include "atmos_model_ros/messages.h"
#include "atmos_model_ros/node.h"
#include "atmos_px4_bridge/link_budget.h"
#include "atmos_px4_bridge/pwm_grid.h"
#include "px4_messages.h"
#include "px4_services.h"

namespace atmos {
namespace {

constexpr double kTick_s = 0.02, kPoll_s = 0.001, kStatus_s = 0.1;

std::string own_base_frame() {
  std::string robot = ros::this_node::getNamespace();
  return base_frame(robot.erase(0, robot.find_first_not_of('/')));
}

class Px4BridgeNode {
 public:
  // A port is there for each link that `config` has.
  Px4BridgeNode(const Vehicle& vehicle, const BridgeConfig& config, Ports ports, int mavlink_baud)
      : base_frame_(own_base_frame()),
        period_s_(vehicle.pwm.period_s),
        grid_(vehicle.pwm.period_s),
        ports_(std::move(ports)),
        bridge_(config, vehicle, {writer(ports_.mavlink), writer(ports_.xrce)}, telemetry()),
        services_(node_, bridge_, static_cast<int>(vehicle.thrusters.size()), [this] { serve_lines(); }) {
    imu_ = node_.advertise<sensor_msgs::Imu>("imu", 100);
    battery_ = node_.advertise<sensor_msgs::BatteryState>("px4/battery", 10);
    motion_ = node_.advertise<nav_msgs::Odometry>("px4/odometry", 100);
    outputs_ = node_.advertise<atmos_msgs::ThrusterCommand>("thruster_command", 100);
    state_ = node_.advertise<atmos_msgs::AutopilotState>("px4/state", 10, true);
    supervisor_ = node_.advertise<atmos_msgs::SupervisorStatus>("px4/supervisor", 10, true);
    text_ = node_.advertise<std_msgs::String>("px4/status_text", 100);

    listen<atmos_msgs::ThrusterCommand>("nmpc/thrusters");
    listen<geometry_msgs::WrenchStamped>("nmpc/wrench");
    listen<atmos_msgs::RateCommand>("nmpc/rate");
    listen<atmos_msgs::AttitudeCommand>("px4/attitude_setpoint");
    listen<geometry_msgs::PoseStamped>("px4/position_setpoint");
    const auto hints = ros::TransportHints().tcpNoDelay();
    subscribers_.push_back(node_.subscribe("nmpc/status", 100, &Px4BridgeNode::on_nmpc, this, hints));
    subscribers_.push_back(node_.subscribe("odometry", 100, &Px4BridgeNode::on_odometry, this, hints));

    diagnostics_.setHardwareID("pixhawk");
    diagnostics_.add("px4 bridge", this, &Px4BridgeNode::diagnose);
    state_what_is_flown(config, mavlink_baud);
  }

  void run(bool arm_at_start) {
    if (arm_at_start) bridge_.manager().request(true);
    while (ros::ok()) {
      // Set-points wake this up; the line is looked at every millisecond.
      ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(kPoll_s));
      serve_lines();
    }
  }

 private:
  // Nothing is ever silently not sent: what does not reach this firmware is said before it is missed.
  void state_what_is_flown(const BridgeConfig& config, int mavlink_baud) {
    for (const Level level :
         {Level::kPosition, Level::kAttitude, Level::kRate, Level::kWrench, Level::kThrusters}) {
      const LevelSupport support = bridge_.link().support(level);
      if (support.how == LevelSupport::How::kNatural) {
        ROS_INFO("level %s: %s", name_of(level), support.statement.c_str());
      } else {
        ROS_WARN("level %s: %s", name_of(level), support.statement.c_str());
      }
    }
    const auto state_load = [](const char* name, const std::vector<BudgetRow>& rows, double baud) {
      ROS_INFO("%s line: %.0f %% of %.0f baud to the autopilot, %.0f %% from it", name,
               100.0 * line_share(rows, true, baud), baud, 100.0 * line_share(rows, false, baud));
    };
    if (config.mavlink) state_load("MAVLink", mavlink_traffic(), mavlink_baud);
    if (config.xrce) state_load("XRCE", xrce_traffic(config.xrce->firmware), config.xrce->baud);
  }

  static MavlinkLink::Write writer(const std::unique_ptr<Port>& port) {
    return [&port](const std::uint8_t* data, std::size_t size) { port->write(data, size); };
  }

  TelemetryListener telemetry() {
    TelemetryListener listener;
    listener.imu = [this](const ImuReading& reading) { imu_.publish(imu_message(reading, base_frame_)); };
    listener.motion = [this](const MotionEstimate& motion) {
      motion_.publish(motion_message(motion, base_frame_));
    };
    listener.battery = [this](const BatteryReading& reading) {
      battery_.publish(battery_message(reading, now(), base_frame_));
    };
    listener.actuators = [this](const ActuatorReading& reading) { publish_outputs(reading); };
    listener.text = [this](int severity, const std::string& text) {
      constexpr int kWarning = 4;
      if (severity <= kWarning) ROS_WARN("autopilot: %s", text.c_str());
      std_msgs::String message;
      message.data = text;
      text_.publish(message);
    };
    listener.parameter = [this](const Parameter& parameter) { services_.on_parameter(parameter); };
    return listener;
  }

  void publish_outputs(const ActuatorReading& reading) {
    atmos_msgs::ThrusterCommand message;
    message.header.stamp.fromSec(std::max(0.0, grid_.align(reading.stamp_s)));
    message.header.frame_id = base_frame_;
    message.period = period_s_;
    message.duty = reading.duty;
    outputs_.publish(message);
  }

  template <class Message>
  void listen(const std::string& topic) {
    const boost::function<void(const Message&)> take = [this](const Message& message) {
      bridge_.manager().take_setpoint(setpoint_from(message), now());
    };
    subscribers_.push_back(
        node_.subscribe<Message>(topic, 10, take, ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay()));
  }

  void on_odometry(const nav_msgs::Odometry& message) {
    if (message.header.frame_id != kWorldFrame || message.child_frame_id != base_frame_) {
      ROS_WARN_THROTTLE(1.0, "odometry of '%s' in '%s' ignored", message.child_frame_id.c_str(),
                        message.header.frame_id.c_str());
      return;
    }
    bridge_.manager().take_odometry(odometry_from(message), now());
  }

  void on_nmpc(const atmos_msgs::NmpcStatus& message) {
    using Status = atmos_msgs::NmpcStatus;
    bridge_.manager().take_nmpc(message.mode == Status::MODE_CLOSED || message.mode == Status::MODE_WAITING);
  }

  double now() const { return ros::Time::now().toSec(); }

  template <class Link>
  void serve(Port& port, Link& link, double time) {
    if (port.poll(ros::WallTime::now().toSec())) {
      ROS_INFO("device opened");
      link.restart();
    } else if (!port.is_open()) {
      ROS_WARN_THROTTLE(5.0, "no device: %s", port.fault().c_str());
    }
    if (time <= 0.0) return;  // simulated time has not begun
    std::uint8_t buffer[1024];
    while (const std::size_t size = port.read(buffer, sizeof(buffer))) link.receive(buffer, size, time);
  }

  void serve_lines() {
    const double time = now();
    if (bridge_.mavlink() != nullptr) serve(*ports_.mavlink, *bridge_.mavlink(), time);
    if (bridge_.xrce() != nullptr) serve(*ports_.xrce, *bridge_.xrce(), time);
    if (time <= 0.0) return;
    if (bridge_.xrce() != nullptr) bridge_.xrce()->tick(time);  // the pace of the line is finer than ours
    if (time >= ticked_s_ && time < ticked_s_ + kTick_s) return;
    ticked_s_ = time;
    bridge_.tick(time);
    publish_status(time);
    diagnostics_.update();
  }

  void publish_status(double time) {
    const FlightManagerStatus status = bridge_.manager().status();
    const bool changed = status.state != last_.state || status.verdict.rule != last_.verdict.rule ||
                         status.refusal != last_.refusal || status.autopilot.armed != last_.autopilot.armed;
    if (!changed && time >= status_s_ && time < status_s_ + kStatus_s) return;
    if (status.state != last_.state) {
      ROS_INFO("%s%s%s", name_of(status.state), status.verdict.text.empty() ? "" : ": ",
               status.verdict.text.c_str());
    }
    if (status.refusal != last_.refusal && !status.refusal.empty())
      ROS_WARN("refused: %s", status.refusal.c_str());
    last_ = status;
    status_s_ = time;
    supervisor_.publish(supervisor_message(status, time));
    state_.publish(state_message(bridge_, ports_, time));
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& out) {
    using Level = diagnostic_msgs::DiagnosticStatus;
    const FlightManagerStatus status = bridge_.manager().status();
    const bool acts = status.verdict.reaction != Reaction::kFly;
    out.summary(!status.connected ? Level::ERROR
                : acts            ? Level::WARN
                                  : Level::OK,
                std::string(name_of(status.state)) + (acts ? ": " + status.verdict.text : ""));
    out.add("set-points", status.setpoints);
    out.add("set-points malformed", status.malformed);
    out.add("set-points of a level without a message", status.unsupported);
    const atmos_msgs::AutopilotState line = state_message(bridge_, ports_, 0.0);
    out.add("bad checksums", line.bad_checksum);
    out.add("frames dropped", line.dropped);
  }

  ros::NodeHandle node_;
  std::string base_frame_;
  double period_s_;
  PwmGrid grid_;
  Ports ports_;
  ros::Publisher imu_, battery_, motion_, outputs_, state_, supervisor_, text_;
  Px4Bridge bridge_;
  Px4Services services_;
  diagnostic_updater::Updater diagnostics_;
  std::vector<ros::Subscriber> subscribers_;
  FlightManagerStatus last_;
  double ticked_s_ = -1e9, status_s_ = -1e9;
};

}  // namespace
}  // namespace atmos

namespace {

atmos::LinkChoice link_named(const std::string& name, const std::string& node) {
  if (name == "mavlink") return atmos::LinkChoice::kMavlink;
  if (name == "xrce") return atmos::LinkChoice::kXrce;
  if (name == "both") return atmos::LinkChoice::kBoth;
  throw atmos::ConfigError({{node, 0, "link", "must be one of mavlink, xrce, both"}});
}

}  // namespace

int main(int argc, char** argv) {
  return atmos::run_node(argc, argv, "px4_bridge", [] {
    const ros::NodeHandle node("~");
    const auto vehicle = atmos::load_vehicle(atmos::required_parameter<std::string>(node, "vehicle"));
    const auto link = link_named(atmos::required_parameter<std::string>(node, "link"), node.getNamespace());
    auto config = atmos::load_bridge(atmos::required_parameter<std::string>(node, "config"), link);
    atmos::Ports ports;
    int mavlink_baud = 0;
    if (config.mavlink) {
      mavlink_baud = atmos::required_parameter<int>(node, "baud");
      ports.mavlink = atmos::make_port(atmos::required_parameter<std::string>(node, "device"), mavlink_baud);
    }
    if (config.xrce) {
      const auto device = atmos::required_parameter<std::string>(node, "xrce_device");
      const int baud = atmos::required_parameter<int>(node, "xrce_baud");
      if (device.rfind("udp:", 0) == 0)
        throw atmos::ConfigError({{node.getNamespace(), 0, "xrce_device", "must be a serial device"}});
      ports.xrce = atmos::make_port(device, baud);
      config.xrce->baud = baud;
    }
    const bool arm = atmos::required_parameter<bool>(node, "arm_at_start");
    atmos::Px4BridgeNode(vehicle, config, std::move(ports), mavlink_baud).run(arm);
    return 0;
  });
}
