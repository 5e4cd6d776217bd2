#include "bridge_node.h"

#include <atmos_msgs/MocapStatus.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <nav_msgs/Odometry.h>

#include <algorithm>

#include "atmos_model_ros/messages.h"

namespace atmos {

namespace {

constexpr std::uint32_t kQueue = 10000;  // messages: nothing may be lost at many times real time
constexpr double kDiagnosticsPeriod_s = 1.0;

std::uint8_t message_state(TrackingState state) {
  using atmos_msgs::MocapStatus;
  switch (state) {
    case TrackingState::kTracking:
      return MocapStatus::TRACKING;
    case TrackingState::kCoasting:
      return MocapStatus::COASTING;
    case TrackingState::kLost:
      return MocapStatus::LOST;
    case TrackingState::kWaiting:
      break;
  }
  return MocapStatus::WAITING;
}

template <class From, class To>
void copy_xyz(const From& from, To& to) {
  to.x = from.x();
  to.y = from.y();
  to.z = from.z();
}

// "/atmos" -> "atmos"; without a namespace the vehicle's name.
std::string robot_name(const MocapConfig& config, const Vehicle& vehicle, const ros::NodeHandle& node) {
  if (!config.robot.empty()) return config.robot;
  std::string name = node.getNamespace();
  name.erase(0, name.find_first_not_of('/'));
  return name.empty() ? vehicle.name : name;
}

std::unique_ptr<PoseSource> make_source(const SourceConfig& config, const SourceContext& context) {
  if (const auto* qtm = std::get_if<QtmSourceConfig>(&config)) return make_qtm_source(*qtm, context);
  if (const auto* camera = std::get_if<CameraSourceConfig>(&config))
    return make_camera_source(*camera, context);
  return make_topic_source(std::get<TopicSourceConfig>(config), context);
}

}  // namespace

BridgeNode::BridgeNode(const MocapConfig& config, const Vehicle& vehicle, bool lockstep)
    : filter_(config, vehicle), gate_(vehicle.pwm.period_s), lockstep_(lockstep) {
  const std::string robot = robot_name(config, vehicle, node_);
  base_frame_ = base_frame(robot);
  odometry_publisher_ = node_.advertise<nav_msgs::Odometry>("odometry", kQueue);
  status_publisher_ = node_.advertise<atmos_msgs::MocapStatus>("mocap/status", kQueue);
  diagnostics_.setHardwareID("none");
  diagnostics_.add("odometry filter", this, &BridgeNode::diagnose_filter);
  diagnostics_.add("mocap source", this, &BridgeNode::diagnose_source);
  // Wall time: a source that delivers nothing has to show when simulated time stands still, too.
  diagnostics_timer_ = node_.createWallTimer(ros::WallDuration(kDiagnosticsPeriod_s),
                                             [this](const ros::WallTimerEvent&) { update_diagnostics(); });
  command_subscriber_ = node_.subscribe("thruster_command", kQueue, &BridgeNode::on_command, this,
                                        ros::TransportHints().tcpNoDelay());
  // The lock keeps early frames waiting until the source is known to be complete.
  const std::lock_guard<std::mutex> lock(mutex_);
  source_ = make_source(
      config.source, {node_, robot, lockstep, [this](const SourceFrame& frame) { on_frame(frame); }, config});
  if (!source_->is_pose_topic())
    pose_publisher_ = node_.advertise<geometry_msgs::PoseStamped>("mocap/pose", kQueue);
}

LatencyRecord::Summary BridgeNode::latency() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return latency_.summary();
}

void BridgeNode::on_command(const atmos_msgs::ThrusterCommand& message) {
  const ThrusterCommand command = from_message(message);
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!lockstep_) {
    filter_.take_command(command, ros::Time::now().toSec());
    return;
  }
  gate_.add_command(command);
  take_ready_frames();
}

void BridgeNode::on_frame(const SourceFrame& frame) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (pose_publisher_) publish_pose(frame);
  pending_.push_back({frame.stamp, frame.received});
  if (lockstep_) {
    gate_.add_frame(frame.pose);
    take_ready_frames();
  } else {
    take_frame(frame.pose);
  }
}

void BridgeNode::take_ready_frames() {
  while (const auto ready = gate_.next()) {
    for (const ThrusterCommand& command : ready->commands) filter_.take_command(command);
    take_frame(ready->frame);
  }
}

void BridgeNode::take_frame(const PoseFrame& frame) {
  // Exactly the frame's stamp goes out again, without a way through a double.
  const Pending pending = pending_.front();
  pending_.pop_front();
  const FrameResult result = filter_.take_frame(frame);
  if (result.published) publish_odometry(pending.stamp);
  publish_status(pending.stamp, result);
  // In lockstep a frame waits for its command: that is no latency of the node.
  if (!lockstep_) latency_.add((ros::SteadyTime::now() - pending.received).toSec());
}

void BridgeNode::publish_pose(const SourceFrame& frame) const {
  geometry_msgs::PoseStamped message;
  message.header.stamp = frame.stamp;
  message.header.frame_id = kWorldFrame;
  copy_xyz(frame.pose.p_WB, message.pose.position);
  copy_xyz(frame.pose.q_WB, message.pose.orientation);
  message.pose.orientation.w = frame.pose.q_WB.w();
  pose_publisher_.publish(message);
}

void BridgeNode::publish_odometry(const ros::Time& stamp) {
  const OdometryEstimate estimate = to_odometry(filter_.estimate());
  nav_msgs::Odometry odometry;
  odometry.header.stamp = stamp;
  odometry.header.frame_id = kWorldFrame;
  odometry.child_frame_id = base_frame_;
  copy_xyz(estimate.p_WB, odometry.pose.pose.position);
  copy_xyz(estimate.q_WB, odometry.pose.pose.orientation);
  odometry.pose.pose.orientation.w = estimate.q_WB.w();
  copy_xyz(estimate.v_WB_B, odometry.twist.twist.linear);
  copy_xyz(estimate.w_WB_B, odometry.twist.twist.angular);
  // Symmetric, so that row-major and column-major are the same.
  std::copy_n(estimate.pose_covariance.data(), 36, odometry.pose.covariance.begin());
  std::copy_n(estimate.twist_covariance.data(), 36, odometry.twist.covariance.begin());
  odometry_publisher_.publish(odometry);

  geometry_msgs::TransformStamped transform;
  transform.header = odometry.header;
  transform.child_frame_id = base_frame_;
  copy_xyz(estimate.p_WB, transform.transform.translation);
  transform.transform.rotation = odometry.pose.pose.orientation;
  transforms_.sendTransform(transform);
}

void BridgeNode::publish_status(const ros::Time& stamp, const FrameResult& result) const {
  const FrameCounters& counters = filter_.counters();
  atmos_msgs::MocapStatus status;
  status.header.stamp = stamp;
  status.state = message_state(result.state);
  status.published = result.published;
  status.age = result.age_s;
  status.frames = counters.frames;
  status.accepted = counters.accepted;
  status.rejected_not_finite = counters.rejected_not_finite;
  status.rejected_order = counters.rejected_order;
  status.rejected_gate = counters.rejected_gate;
  status.reinitialisations = counters.reinitialisations;
  status_publisher_.publish(status);
}

void BridgeNode::diagnose_filter(diagnostic_updater::DiagnosticStatusWrapper& out) {
  using diagnostic_msgs::DiagnosticStatus;
  const std::lock_guard<std::mutex> lock(mutex_);
  switch (filter_.state()) {
    case TrackingState::kTracking:
      out.summary(DiagnosticStatus::OK, "tracking");
      break;
    case TrackingState::kCoasting:
      out.summary(DiagnosticStatus::WARN, "coasting: no acceptable frame");
      break;
    case TrackingState::kLost:
      out.summary(DiagnosticStatus::ERROR, "lost: no odometry");
      break;
    case TrackingState::kWaiting:
      out.summary(DiagnosticStatus::WARN, "waiting for the first frame");
      break;
  }
  const NisMonitor& monitor = filter_.nis_monitor();
  if (monitor.verdict() == NisMonitor::Verdict::kUnderstated)
    out.mergeSummary(DiagnosticStatus::WARN, "frames scatter more than the settings' measurement noise");
  if (monitor.verdict() == NisMonitor::Verdict::kOverstated)
    out.mergeSummary(DiagnosticStatus::OK, "frames scatter less than the settings' measurement noise");
  const FrameCounters& counters = filter_.counters();
  out.add("frames", counters.frames);
  out.add("accepted", counters.accepted);
  out.add("rejected_not_finite", counters.rejected_not_finite);
  out.add("rejected_order", counters.rejected_order);
  out.add("rejected_gate", counters.rejected_gate);
  out.add("reinitialisations", counters.reinitialisations);
  out.add("frames held for a command", gate_.held());
  out.add("mean NIS over its expectation", monitor.ratio());
  const LatencyRecord::Summary latency = latency_.summary();
  out.add("frame to odometry, median [ms]", 1e3 * latency.median_s);
  out.add("frame to odometry, 99 % [ms]", 1e3 * latency.p99_s);
  out.add("frame to odometry, max [ms]", 1e3 * latency.max_s);
  out.add("frame to odometry, frames", latency.count);
}

void BridgeNode::diagnose_source(diagnostic_updater::DiagnosticStatusWrapper& out) {
  if (source_) source_->diagnose(out);
}

void BridgeNode::update_diagnostics() { diagnostics_.force_update(); }

}  // namespace atmos
