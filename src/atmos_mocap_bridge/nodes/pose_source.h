// Where the bridge's frames come from: one interface for every kind of motion capture.
#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>

#include <functional>
#include <memory>
#include <string>

#include "atmos_mocap_bridge/config.h"
#include "atmos_mocap_bridge/pose_filter.h"

namespace atmos {

struct SourceFrame {
  ros::Time stamp;  // of the exposure; the odometry bears exactly this one
  PoseFrame pose;
  ros::SteadyTime received;
};

// Delivers frames until it is destroyed, one at a time and in the order of the mocap, perhaps from a thread
// of its own.
class PoseSource {
 public:
  using Sink = std::function<void(const SourceFrame&)>;

  virtual ~PoseSource() = default;
  virtual void diagnose(diagnostic_updater::DiagnosticStatusWrapper& out) = 0;
  // True where the frames are read from mocap/pose itself, so that nobody needs them published there.
  virtual bool is_pose_topic() const { return false; }
};

struct SourceContext {
  ros::NodeHandle node;
  std::string robot;
  bool lockstep;
  PoseSource::Sink sink;
  MocapConfig config;  // all of it: a source may need the noise settings
};

std::unique_ptr<PoseSource> make_topic_source(const TopicSourceConfig& config, const SourceContext& context);
std::unique_ptr<PoseSource> make_camera_source(const CameraSourceConfig& config,
                                               const SourceContext& context);
std::unique_ptr<PoseSource> make_qtm_source(const QtmSourceConfig& config, const SourceContext& context);

}  // namespace atmos
