// Keeps the newest of what a robot says of itself, for the panel.
#pragma once

#include <ros/ros.h>

#include <string>
#include <vector>

#include "atmos_operator/robot_report.h"

namespace atmos {

// Callbacks come from the queue that rviz serves in its own thread: nothing here is locked.
class RobotListener {
 public:
  // Listens to the topics below `robot` ("/snap") from now on, and forgets what another one said.
  void listen_to(const std::string& robot);
  const RobotReport& report() const { return report_; }

 private:
  template <class Message, class Take>
  void subscribe(ros::NodeHandle& node, const std::string& topic, const Take& take);

  RobotReport report_;
  std::vector<ros::Subscriber> subscribers_;
};

// Seconds of the clock that a report's ages are measured with: wall time, because simulated time may stand
// still.
double report_time();

}  // namespace atmos
