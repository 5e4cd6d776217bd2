// mocap/pose, thruster_command -> odometry, mocap/status, tf world -> <robot>/base_link, diagnostics.
// Parameters: ~vehicle and ~config (paths), ~lockstep (bool).
#include <atmos_msgs/MocapStatus.h>
#include <atmos_msgs/ThrusterCommand.h>
#include <diagnostic_updater/diagnostic_updater.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <tf2_ros/transform_broadcaster.h>

#include <algorithm>
#include <string>

#include "atmos_mocap_bridge/lockstep_gate.h"
#include "atmos_mocap_bridge/pose_filter.h"
#include "atmos_model_ros/messages.h"
#include "atmos_model_ros/node.h"

namespace atmos {

namespace {

constexpr std::uint32_t kQueue = 10000;  // messages: nothing may be lost at many times real time

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

class MocapBridgeNode {
 public:
  MocapBridgeNode(const MocapConfig& config, const Vehicle& vehicle, bool lockstep)
      : filter_(config, vehicle), gate_(vehicle.pwm.period_s), lockstep_(lockstep) {
    base_frame_ = base_frame(robot_name(config, vehicle, node_));
    odometry_publisher_ = node_.advertise<nav_msgs::Odometry>("odometry", kQueue);
    status_publisher_ = node_.advertise<atmos_msgs::MocapStatus>("mocap/status", kQueue);
    diagnostics_.setHardwareID("none");
    diagnostics_.add("odometry filter", this, &MocapBridgeNode::diagnose);
    const auto hints = ros::TransportHints().tcpNoDelay();
    command_subscriber_ =
        node_.subscribe("thruster_command", kQueue, &MocapBridgeNode::on_command, this, hints);
    pose_subscriber_ = node_.subscribe("mocap/pose", kQueue, &MocapBridgeNode::on_pose, this, hints);
  }

 private:
  void on_command(const atmos_msgs::ThrusterCommand& message) {
    const ThrusterCommand command = from_message(message);
    if (!lockstep_) {
      filter_.take_command(command, ros::Time::now().toSec());
      return;
    }
    gate_.add_command(command);
    take_ready_frames();
  }

  void on_pose(const geometry_msgs::PoseStamped& message) {
    const auto& p = message.pose.position;
    const auto& q = message.pose.orientation;
    const PoseFrame frame{message.header.stamp.toSec(), {p.x, p.y, p.z}, {q.w, q.x, q.y, q.z}};
    stamps_.push_back(message.header.stamp);
    if (lockstep_) {
      gate_.add_frame(frame);
      take_ready_frames();
    } else {
      take_frame(frame);
    }
    diagnostics_.update();
  }

  void take_ready_frames() {
    while (const auto ready = gate_.next()) {
      for (const ThrusterCommand& command : ready->commands) filter_.take_command(command);
      take_frame(ready->frame);
    }
  }

  void take_frame(const PoseFrame& frame) {
    // Exactly the frame's stamp goes out again, without a way through a double.
    const ros::Time stamp = stamps_.front();
    stamps_.pop_front();
    const FrameResult result = filter_.take_frame(frame);
    if (result.published) publish_odometry(stamp);
    publish_status(stamp, result);
  }

  void publish_odometry(const ros::Time& stamp) {
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

  void publish_status(const ros::Time& stamp, const FrameResult& result) {
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

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& out) {
    using diagnostic_msgs::DiagnosticStatus;
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
    const FrameCounters& counters = filter_.counters();
    out.add("frames", counters.frames);
    out.add("accepted", counters.accepted);
    out.add("rejected_not_finite", counters.rejected_not_finite);
    out.add("rejected_order", counters.rejected_order);
    out.add("rejected_gate", counters.rejected_gate);
    out.add("reinitialisations", counters.reinitialisations);
    out.add("frames held for a command", gate_.held());
  }

  ros::NodeHandle node_;
  PoseFilter filter_;
  LockstepGate gate_;
  bool lockstep_;
  std::string base_frame_;
  std::deque<ros::Time> stamps_;  // of the frames not yet taken
  diagnostic_updater::Updater diagnostics_;
  tf2_ros::TransformBroadcaster transforms_;
  ros::Publisher odometry_publisher_, status_publisher_;
  ros::Subscriber command_subscriber_, pose_subscriber_;
};

}  // namespace

}  // namespace atmos

int main(int argc, char** argv) {
  return atmos::run_node(argc, argv, "mocap_bridge", [] {
    const ros::NodeHandle parameters("~");
    const auto config =
        atmos::load_mocap_config(atmos::required_parameter<std::string>(parameters, "config"));
    const auto vehicle = atmos::load_vehicle(atmos::required_parameter<std::string>(parameters, "vehicle"));
    const bool lockstep = atmos::required_parameter<bool>(parameters, "lockstep");
    const atmos::MocapBridgeNode node(config, vehicle, lockstep);
    ros::spin();
    return 0;
  });
}
