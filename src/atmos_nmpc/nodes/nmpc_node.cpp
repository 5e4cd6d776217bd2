// Odometry and set-points in, commands out: messages and threads around atmos::Controller.
#include <atmos_msgs/MocapStatus.h>
#include <atmos_msgs/NmpcStatus.h>
#include <diagnostic_updater/diagnostic_updater.h>
#include <geometry_msgs/PoseStamped.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <ros/steady_timer.h>

#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "atmos_model/odometry_gate.h"
#include "atmos_model/steady_clock.h"
#include "atmos_model_ros/messages.h"
#include "atmos_model_ros/node.h"
#include "atmos_nmpc/controller.h"
#include "nmpc_messages.h"

namespace atmos {
namespace {

constexpr std::uint32_t kQueue = 10000;  // messages: nothing may be lost at many times real time

class NmpcNode {
 public:
  NmpcNode(const Vehicle& vehicle, const ControllerConfig& config, bool lockstep)
      : lockstep_(lockstep), controller_(vehicle, config, lockstep, steady_seconds) {
    std::string robot = node_.getNamespace();
    robot.erase(0, robot.find_first_not_of('/'));
    base_frame_ = base_frame(robot);

    // Every level is there whatever the formulation, so that nothing but the controller file depends on it.
    thrusters_pub_ = node_.advertise<atmos_msgs::ThrusterCommand>("nmpc/thrusters", kQueue);
    wrench_pub_ = node_.advertise<geometry_msgs::WrenchStamped>("nmpc/wrench", kQueue);
    rate_pub_ = node_.advertise<atmos_msgs::RateCommand>("nmpc/rate", kQueue);
    disturbance_pub_ = node_.advertise<atmos_msgs::Disturbance>("disturbance", kQueue);
    status_pub_ = node_.advertise<atmos_msgs::NmpcStatus>("nmpc/status", kQueue);
    path_pub_ = node_.advertise<nav_msgs::Path>("nmpc/predicted_path", kQueue);
    const ros::TransportHints no_delay = ros::TransportHints().tcpNoDelay();
    odometry_sub_ = node_.subscribe("odometry", 100, &NmpcNode::on_odometry, this, no_delay);
    mocap_status_sub_ = node_.subscribe("mocap/status", 100, &NmpcNode::on_mocap_status, this, no_delay);
    set_point_sub_ = node_.subscribe("setpoint", 10, &NmpcNode::on_set_point, this, no_delay);
    trajectory_sub_ = node_.subscribe("trajectory", 10, &NmpcNode::on_trajectory, this, no_delay);

    for (const std::string& other : config.robots) {
      const boost::function<void(const nav_msgs::Odometry&)> see =
          [this, other](const nav_msgs::Odometry& odometry) {
            const State13<double> x = state13_from(odometry);
            if (odometry.header.frame_id == kWorldFrame)
              controller_.see_robot(other, odometry.header.stamp.toSec(), x.head<2>(),
                                    x.segment<2>(state13::kVelocity));
          };
      robot_subs_.push_back(node_.subscribe<nav_msgs::Odometry>("/" + other + "/odometry", 10, see));
    }

    diagnostics_.setHardwareID(robot);
    diagnostics_.add("nmpc", this, &NmpcNode::diagnose);
    diagnostics_timer_ = node_.createSteadyTimer(
        ros::WallDuration(1.0), [this](const ros::SteadyTimerEvent&) { diagnostics_.force_update(); });
    // In lockstep every period brings odometry or a status; the clock stands still while the controller
    // thinks.
    if (!lockstep_) {
      watchdog_ = node_.createSteadyTimer(ros::WallDuration(controller_.period_s() / 5.0),
                                          [this](const ros::SteadyTimerEvent&) { on_watchdog(); });
    }
  }

 private:
  void on_odometry(const nav_msgs::Odometry& message) {
    OdometrySample sample;
    sample.stamp_s = message.header.stamp.toSec();
    sample.x = state13_from(message);
    sample.frames_match = message.header.frame_id == kWorldFrame && message.child_frame_id == base_frame_;
    feed([this, sample] {
      const double begin = steady_seconds();
      // In lockstep simulated time waits for this answer, while roscpp may hand on its ticks much later: a
      // clock that lags must not make the frame one of the future.
      const double now = lockstep_ ? sample.stamp_s : ros::Time::now().toSec();
      publish(controller_.on_odometry(sample, now), sample.stamp_s, begin);
    });
    gate_.on_odometry(sample.stamp_s);
    pass_on_missing_frames();
  }

  void on_mocap_status(const atmos_msgs::MocapStatus& message) {
    const double stamp = message.header.stamp.toSec();
    gate_.on_status(stamp, message.published);
    if (!message.published) missing_.push_back(stamp);
    pass_on_missing_frames();
  }

  // In lockstep a missing frame waits for the odometry before it, which comes over another connection: which
  // is first would differ from run to run.
  void pass_on_missing_frames() {
    while (!missing_.empty() && (!lockstep_ || gate_.complete(missing_.front()))) {
      const double stamp = missing_.front();
      missing_.pop_front();
      feed([this, stamp] {
        const double begin = steady_seconds();
        publish(controller_.on_missing_frame(stamp), stamp, begin);
      });
    }
  }

  void on_set_point(const geometry_msgs::PoseStamped& message) {
    const auto& p = message.pose.position;
    const auto& q = message.pose.orientation;
    if (message.header.frame_id != kWorldFrame) {
      ROS_WARN_THROTTLE(1.0, "set-point in frame '%s' ignored: it must be '%s'",
                        message.header.frame_id.c_str(), kWorldFrame);
      return;
    }
    controller_.add_goal({message.header.stamp.toSec(), {p.x, p.y, p.z}, {q.w, q.x, q.y, q.z}});
    release();
  }

  void on_trajectory(const trajectory_msgs::MultiDOFJointTrajectory& message) {
    if (message.header.frame_id != kWorldFrame) {
      ROS_WARN_THROTTLE(1.0, "trajectory in frame '%s' ignored: it must be '%s'",
                        message.header.frame_id.c_str(), kWorldFrame);
      return;
    }
    const std::uint64_t before = controller_.counters().rejected_goals;
    controller_.add_trajectory(trajectory_points(message));
    if (controller_.counters().rejected_goals != before)
      ROS_WARN("trajectory of %zu points ignored: it is over, or %s", message.points.size(),
               trajectory_fault(trajectory_points(message)).c_str());
    release();
  }

  void release() {
    if (!controller_.has_goal()) return;
    while (!held_.empty()) {
      held_.front()();
      held_.pop_front();
    }
  }

  // In lockstep nothing is decided before the first set-point, which is certain to come, so that no race
  // decides in which period the flight starts.
  void feed(std::function<void()> event) {
    if (lockstep_ && !controller_.has_goal()) {
      held_.push_back(std::move(event));
    } else {
      event();
    }
  }

  void on_watchdog() {
    const double begin = steady_seconds(), now = ros::Time::now().toSec();
    if (now > 0.0) publish(controller_.on_silence(now), now, begin);
  }

  void publish(const ControlDecision* decision, double event_stamp_s, double begin) {
    if (decision == nullptr) return;
    const ros::Time stamp(decision->command.stamp_s);
    publish_command(*decision);
    publish_status(*decision, stamp, event_stamp_s, begin);
    if (decision->disturbance) disturbance_pub_.publish(disturbance_message(*decision));
    if (!decision->path.empty() && path_pub_.getNumSubscribers() > 0)
      path_pub_.publish(path_message(*decision));
    controller_.prepare();
  }

  void publish_command(const ControlDecision& decision) {
    // Closed valves are a thruster command at every level.
    const bool closed = decision.mode == ControlMode::kClosed || decision.mode == ControlMode::kWaiting;
    if (closed || controller_.level() == CommandLevel::kThrusters) {
      thrusters_pub_.publish(thruster_message(decision, base_frame_));
    } else if (controller_.level() == CommandLevel::kWrench) {
      wrench_pub_.publish(wrench_message(decision, base_frame_));
    } else {
      rate_pub_.publish(rate_message(decision, base_frame_));
    }
  }

  void publish_status(const ControlDecision& decision, const ros::Time& stamp, double event_stamp_s,
                      double begin) {
    const ControllerCounters& counters = controller_.counters();
    atmos_msgs::NmpcStatus status;
    status.header.stamp = stamp;
    status.header.frame_id = kWorldFrame;
    status.mode = static_cast<std::uint8_t>(decision.mode);
    status.solver = static_cast<std::uint8_t>(decision.solve.status);
    status.odometry = static_cast<std::uint8_t>(decision.odometry);
    status.solve_time = decision.solve.solve_time_s;
    status.latency = steady_seconds() - begin;
    status.iterations = static_cast<std::uint32_t>(decision.solve.iterations);
    status.objective = decision.solve.objective;
    status.feedback = decision.feedback;
    status.active_inputs = static_cast<std::uint32_t>(decision.active.inputs);
    status.active_states = static_cast<std::uint32_t>(decision.active.states);
    status.odometry_age = decision.odometry_age_s;
    // In lockstep ROS time waits for the command, so that only the steady clock can tell.
    const double delay = lockstep_ ? status.latency : ros::Time::now().toSec() - event_stamp_s;
    if (delay > controller_.period_s()) ++deadline_misses_;
    status.solves = counters.solves;
    status.solver_failures = counters.solver_failures;
    status.deadline_misses = deadline_misses_;
    status.rejected_odometry =
        counters.rejected_not_finite + counters.rejected_order + counters.rejected_frame;
    status_pub_.publish(status);
    last_status_ = status;
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& out) {
    using atmos_msgs::NmpcStatus;
    const ControllerCounters& counters = controller_.counters();
    if (last_status_.mode == NmpcStatus::MODE_WAITING) {
      out.summary(diagnostic_msgs::DiagnosticStatus::OK, "waiting for odometry and a set-point");
    } else if (last_status_.odometry == NmpcStatus::ODOMETRY_LOST) {
      out.summary(diagnostic_msgs::DiagnosticStatus::ERROR, "odometry lost: valves closed");
    } else if (last_status_.mode != NmpcStatus::MODE_SOLVED) {
      out.summaryf(diagnostic_msgs::DiagnosticStatus::ERROR, "solver fails: %s",
                   name_of(static_cast<SolverStatus>(last_status_.solver)));
    } else if (last_status_.odometry == NmpcStatus::ODOMETRY_PREDICTED) {
      out.summary(diagnostic_msgs::DiagnosticStatus::WARN, "odometry is late: flying on the prediction");
    } else {
      out.summary(diagnostic_msgs::DiagnosticStatus::OK, "flying");
    }
    out.add("solves", counters.solves);
    out.add("solver failures", counters.solver_failures);
    out.add("commands by feedback", counters.feedbacks);
    out.add("deadline misses", deadline_misses_);
    out.add("odometry rejected, not finite", counters.rejected_not_finite);
    out.add("odometry rejected, out of order", counters.rejected_order);
    out.add("odometry rejected, wrong frame", counters.rejected_frame);
    out.add("set-points and trajectories rejected", counters.rejected_goals);
    out.add("solve time, s", last_status_.solve_time);
  }

  ros::NodeHandle node_;
  bool lockstep_;
  Controller controller_;
  std::string base_frame_;
  OdometryGate gate_;
  std::deque<double> missing_;  // stamps of frames without odometry, not yet passed on
  std::deque<std::function<void()>> held_;
  std::uint64_t deadline_misses_ = 0;
  atmos_msgs::NmpcStatus last_status_ = [] {
    atmos_msgs::NmpcStatus status;
    status.mode = atmos_msgs::NmpcStatus::MODE_WAITING;
    return status;
  }();
  diagnostic_updater::Updater diagnostics_;
  ros::Publisher thrusters_pub_, wrench_pub_, rate_pub_, disturbance_pub_, status_pub_, path_pub_;
  ros::Subscriber odometry_sub_, mocap_status_sub_, set_point_sub_, trajectory_sub_;
  std::vector<ros::Subscriber> robot_subs_;
  ros::SteadyTimer diagnostics_timer_, watchdog_;
};

int run() {
  ros::NodeHandle private_node("~");
  const auto vehicle_path = required_parameter<std::string>(private_node, "vehicle");
  const auto controller_path = required_parameter<std::string>(private_node, "controller");
  const Vehicle vehicle = load_vehicle(vehicle_path);
  const ControllerConfig config = load_controller(controller_path, vehicle);
  NmpcNode node(vehicle, config, private_node.param("lockstep", false));
  if (!riccati_available())
    ROS_WARN("this Ipopt takes no linear solver from outside: MUMPS is several times slower");
  ros::spin();
  return 0;
}

}  // namespace
}  // namespace atmos

int main(int argc, char** argv) { return atmos::run_node(argc, argv, "nmpc", atmos::run); }
