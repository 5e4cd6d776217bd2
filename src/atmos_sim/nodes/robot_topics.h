// The topics of one simulated robot, in its namespace.
#pragma once

#include <atmos_msgs/ThrusterCommand.h>
#include <ros/node_handle.h>

#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <string>

#include "atmos_model/scenario.h"
#include "atmos_sim/mocap_sensor.h"
#include "atmos_sim/robot.h"

namespace atmos {

// How commands were taken, by ValveSchedule::Taken.
struct CommandCounts {
  std::uint64_t taken[4] = {};
};

class RobotTopics {
 public:
  // `name`: of the robot, for frames. `before_command` is called when a command has come, before the valves
  // get it.
  RobotTopics(const ros::NodeHandle& node, const std::string& name, const Scenario& scenario, Robot& robot,
              double start_s, std::function<void()> before_command);

  double next_frame_s() const { return mocap_.next_frame_s(); }
  // When the oldest exposed frame is to be published; +inf: there is none.
  double next_publication_s() const;
  // Exposes the frame due now; publish_frames() publishes it `delay_s` later.
  void expose(double now_s, double delay_s);
  void publish_frames(double now_s);
  void publish_truth(double now_s) const;
  // Air and battery, as far as the vehicle has them.
  void publish_supplies(double now_s) const;

  // Stamp of the newest command; -inf before.
  double newest_stamp_s() const { return newest_stamp_; }
  const CommandCounts& counts() const { return counts_; }
  std::string command_topic() const { return commands_.getTopic(); }

 private:
  struct PendingFrame {
    double publish_s;
    MocapFrame frame;
  };

  void take(const atmos_msgs::ThrusterCommand& message);
  void publish(const MocapFrame& frame) const;

  std::string base_frame_;
  const Scenario& scenario_;
  Robot& robot_;
  std::function<void()> before_command_;
  MocapSensor mocap_;
  std::deque<PendingFrame> frames_;
  ros::NodeHandle node_;
  ros::Publisher pose_, truth_, pneumatics_, battery_;
  ros::Subscriber commands_;
  double newest_stamp_ = -std::numeric_limits<double>::infinity();
  CommandCounts counts_;
};

}  // namespace atmos
