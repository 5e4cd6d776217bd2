// Frames of a source and thruster_command in; odometry, mocap/status, tf and diagnostics out.
#pragma once

#include <atmos_msgs/ThrusterCommand.h>
#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>
#include <tf2_ros/transform_broadcaster.h>

#include <deque>
#include <memory>
#include <mutex>
#include <string>

#include "atmos_mocap_bridge/latency_record.h"
#include "atmos_mocap_bridge/lockstep_gate.h"
#include "atmos_mocap_bridge/pose_filter.h"
#include "pose_source.h"

namespace atmos {

class BridgeNode {
 public:
  BridgeNode(const MocapConfig& config, const Vehicle& vehicle, bool lockstep);

  // From the arrival of a frame's last byte or message to the end of publishing its odometry.
  LatencyRecord::Summary latency() const;

 private:
  void on_command(const atmos_msgs::ThrusterCommand& message);
  void on_frame(const SourceFrame& frame);
  void take_ready_frames();
  void take_frame(const PoseFrame& frame);
  void publish_pose(const SourceFrame& frame) const;
  void publish_odometry(const ros::Time& stamp);
  void publish_status(const ros::Time& stamp, const FrameResult& result) const;
  void diagnose_filter(diagnostic_updater::DiagnosticStatusWrapper& out);
  void diagnose_source(diagnostic_updater::DiagnosticStatusWrapper& out);
  void update_diagnostics();

  struct Pending {
    ros::Time stamp;
    ros::SteadyTime received;
  };

  ros::NodeHandle node_;
  mutable std::mutex mutex_;  // sources may deliver from a thread of their own
  PoseFilter filter_;
  LockstepGate gate_;
  bool lockstep_;
  std::string base_frame_;
  std::deque<Pending> pending_;  // frames not yet taken
  LatencyRecord latency_;
  diagnostic_updater::Updater diagnostics_;
  tf2_ros::TransformBroadcaster transforms_;
  ros::Publisher odometry_publisher_, status_publisher_, pose_publisher_;
  ros::Subscriber command_subscriber_;
  ros::WallTimer diagnostics_timer_;
  std::unique_ptr<PoseSource> source_;  // last: it delivers as soon as it exists, and stops first
};

}  // namespace atmos
