#include "robot_listener.h"

#include <atmos_msgs/AutopilotState.h>
#include <atmos_msgs/DistanceMonitorStatus.h>
#include <atmos_msgs/FlightControllerStatus.h>
#include <atmos_msgs/MocapStatus.h>
#include <atmos_msgs/NmpcStatus.h>
#include <atmos_msgs/Pneumatics.h>
#include <atmos_msgs/SupervisorStatus.h>
#include <sensor_msgs/BatteryState.h>
#include <std_msgs/String.h>

#include <algorithm>

namespace atmos {

double report_time() { return ros::WallTime::now().toSec(); }

template <class Message, class Take>
void RobotListener::subscribe(ros::NodeHandle& node, const std::string& topic, const Take& take) {
  const boost::function<void(const Message&)> callback = take;
  subscribers_.push_back(node.subscribe<Message>(topic, 2, callback));
}

void RobotListener::listen_to(const std::string& robot) {
  subscribers_.clear();
  report_ = {};
  if (robot.empty()) return;
  ros::NodeHandle node(robot);
  const auto now = report_time;

  subscribe<atmos_msgs::AutopilotState>(node, "px4/state", [this, now](const auto& m) {
    report_.autopilot = {{m.connected != 0, m.armed != 0, m.mode, m.round_trip}, now()};
  });
  subscribe<atmos_msgs::SupervisorStatus>(node, "px4/supervisor", [this, now](const auto& m) {
    report_.supervisor = {{static_cast<SupervisorReport::State>(m.state),
                           m.rule == atmos_msgs::SupervisorStatus::KILL, m.text, m.refusal},
                          now()};
  });
  subscribe<atmos_msgs::NmpcStatus>(node, "nmpc/status", [this, now](const auto& m) {
    report_.controller = {{static_cast<ControllerReport::Mode>(m.mode), m.solve_time, m.deadline_misses},
                          now()};
  });
  subscribe<atmos_msgs::FlightControllerStatus>(node, "flight_controller/status", [this, now](const auto& m) {
    report_.flight_controller = {{m.state == atmos_msgs::FlightControllerStatus::FLYING, m.reason}, now()};
  });
  subscribe<atmos_msgs::MocapStatus>(node, "mocap/status", [this, now](const auto& m) {
    report_.tracked = {m.published != 0, now()};
  });
  // In serial simulation both the simulator and the autopilot have one: what the autopilot says counts.
  subscribe<sensor_msgs::BatteryState>(node, "px4/battery", [this, now](const auto& m) {
    report_.battery = {{m.percentage, m.voltage}, now()};
  });
  subscribe<sensor_msgs::BatteryState>(node, "battery", [this, now](const auto& m) {
    if (!report_.autopilot) report_.battery = {{m.percentage, m.voltage}, now()};
  });
  subscribe<atmos_msgs::Pneumatics>(node, "pneumatics", [this, now](const auto& m) {
    report_.gas = {{m.gas_remaining, m.bottle_pressure, m.tethered != 0}, now()};
  });
  subscribe<std_msgs::String>(node, "setpoint_player/state", [this, now](const auto& m) {
    report_.mission = {m.data, now()};
  });
  // One monitor for all robots; it names them without slashes.
  const std::string name = robot.substr(1);
  subscribe<atmos_msgs::DistanceMonitorStatus>(
      node, "/distance_monitor/status", [this, now, name](const auto& m) {
        const auto i =
            static_cast<std::size_t>(std::find(m.robots.begin(), m.robots.end(), name) - m.robots.begin());
        if (i < m.distance.size() && i < m.held.size())
          report_.distance = {{m.distance[i], m.held[i] != 0, m.reason}, now()};
      });
}

}  // namespace atmos
