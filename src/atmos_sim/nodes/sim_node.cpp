// The simulator as a node: mocap frames, truth and the clock out, thruster commands in (docs/architecture.md,
// "Lockstep").
#include <atmos_msgs/ThrusterCommand.h>
#include <geometry_msgs/PoseStamped.h>
#include <nav_msgs/Odometry.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Clock.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <deque>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "atmos_model_ros/messages.h"
#include "atmos_model_ros/node.h"
#include "atmos_sim/mocap_sensor.h"
#include "atmos_sim/simulation.h"
#include "connections.h"
#include "options.h"

namespace atmos {
namespace {

constexpr double kStart = 1000.0;        // t0, ROS time
constexpr double kTruthRate = 100.0;     // Hz
constexpr double kClockRate = 250.0;     // Hz of ROS time in real time, besides the frames
constexpr double kProgressPeriod = 5.0;  // s of ROS time
constexpr double kSameInstant = 1e-6;    // s: above the rounding of a stamp, far below a frame
constexpr int kQueue = 10000;            // messages: nothing may be lost at many times real time

// Whole multiples of a period in ROS time.
class Beat {
 public:
  Beat(double period_s, double from_s)
      : period_s_(period_s), count_(std::ceil((from_s - kSameInstant) / period_s)) {}
  double next() const { return count_ * period_s_; }
  bool due(double t) const { return next() <= t + kSameInstant; }
  void pass() { count_ += 1.0; }

 private:
  double period_s_;
  double count_;
};

class SimNode {
 public:
  explicit SimNode(Options options)
      : options_(std::move(options)),
        end_s_(kStart + options_.scenario.duration_s),
        simulation_(options_.scenario, kStart),
        mocap_(options_.scenario.mocap, options_.scenario.seed, kStart),
        period_(options_.scenario.vehicle.pwm.period_s, kStart),
        truth_beat_(1.0 / kTruthRate, kStart),
        clock_beat_(1.0 / kClockRate, kStart),
        progress_beat_(kProgressPeriod, kStart + kProgressPeriod) {
    const std::string robot =
        ros::this_node::getNamespace().substr(ros::this_node::getNamespace().rfind('/') + 1);
    base_frame_ = base_frame(robot.empty() ? options_.scenario.vehicle.name : robot);
    // Latched in lockstep, where time stands still until a node that came late has answered. In real time the
    // next tick follows at once, and a latched one may overtake it: time would run back for that node.
    clock_ = node_.advertise<rosgraph_msgs::Clock>("/clock", kQueue, options_.lockstep);
    pose_ = node_.advertise<geometry_msgs::PoseStamped>("mocap/pose", kQueue);
    truth_ = node_.advertise<nav_msgs::Odometry>("sim/truth", kQueue);
    commands_ =
        node_.subscribe("thruster_command", kQueue, &SimNode::take, this, ros::TransportHints().tcpNoDelay());
  }

  // Flies the scenario; the exit code.
  int fly() {
    if (!wait_for_connections()) return ros::ok() ? 1 : 0;
    wall_start_ = ros::WallTime::now();
    flying_ = true;
    while (ros::ok()) {
      if (!reach_next_event()) break;
      const double now = simulation_.time_s();
      const bool frame_due = mocap_.next_frame_s() <= now + kSameInstant;
      if (frame_due || clock_beat_.due(now) || (options_.lockstep && period_.due(now))) publish_clock(now);
      while (clock_beat_.due(now)) clock_beat_.pass();
      if (frame_due) frames_.push_back({now + publish_delay(), mocap_.expose(simulation_)});
      while (!frames_.empty() && frames_.front().publish_s <= now + kSameInstant) {
        publish_frame(frames_.front().frame);
        frames_.pop_front();
      }
      if (truth_beat_.due(now)) publish_truth(now);
      if (progress_beat_.due(now)) report_progress(now);
      if (now >= end_s_ - kSameInstant) return finish();
      if (period_.due(now)) {
        if (options_.lockstep && !wait_for_answer(period_.next())) return ros::ok() ? 1 : 0;
        period_.pass();
      }
    }
    return 0;
  }

 private:
  struct PendingFrame {
    double publish_s;
    MocapFrame frame;
  };

  double publish_delay() const { return options_.lockstep ? 0.0 : options_.scenario.mocap.publish_delay_s; }
  double wall_elapsed() const { return (ros::WallTime::now() - wall_start_).toSec(); }
  void spin_for(double wall_s) { ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(wall_s)); }

  double next_event() const {
    double next = std::min({end_s_, mocap_.next_frame_s(), truth_beat_.next(), period_.next()});
    if (!options_.lockstep) next = std::min(next, clock_beat_.next());
    if (!frames_.empty()) next = std::min(next, frames_.front().publish_s);
    return next;
  }

  // False when the node is shut down before.
  bool reach_next_event() {
    target_s_ = next_event();
    if (!options_.lockstep) {
      for (;;) {
        const double ahead = (target_s_ - kStart) / options_.speed - wall_elapsed();
        spin_for(std::max(ahead, 0.0));
        if (!ros::ok()) return false;
        if (ahead <= 0.0) break;
      }
    }
    simulation_.advance_to(target_s_);
    return true;
  }

  void take(const atmos_msgs::ThrusterCommand& message) {
    // In real time a command acts from the moment it arrives, not from the last event before.
    if (!options_.lockstep && flying_)
      simulation_.advance_to(std::min(target_s_, kStart + wall_elapsed() * options_.speed));
    const ThrusterCommand command = from_message(message);
    const ValveSchedule::Taken taken = simulation_.command(command);
    newest_stamp_ = std::max(newest_stamp_, command.stamp_s);
    ++taken_[static_cast<int>(taken)];
    if (taken == ValveSchedule::Taken::kMalformed)
      ROS_WARN_THROTTLE(1.0, "malformed command on %s ignored", commands_.getTopic().c_str());
  }

  bool wait_for_connections() {
    const ros::WallTime limit = ros::WallTime::now() + ros::WallDuration(options_.answer_limit_s);
    auto missing = options_.wait_for;
    while (ros::ok()) {
      publish_clock(kStart);
      missing.erase(std::remove_if(missing.begin(), missing.end(), is_connected), missing.end());
      if (missing.empty()) return true;
      if (ros::WallTime::now() > limit) {
        for (const Connection& connection : missing)
          std::fprintf(stderr, "sim: no connection after %.3g s: node %s does not receive topic %s\n",
                       options_.answer_limit_s, connection.node.c_str(), connection.topic.c_str());
        return false;
      }
      spin_for(0.02);
      ros::WallDuration(0.02).sleep();
    }
    return false;
  }

  bool wait_for_answer(double stamp_s) {
    const ros::WallTime limit = ros::WallTime::now() + ros::WallDuration(options_.answer_limit_s);
    while (newest_stamp_ < stamp_s - kSameInstant) {
      spin_for(0.05);
      if (!ros::ok()) return false;
      if (ros::WallTime::now() > limit) {
        std::fprintf(stderr, "sim: no answer for %.3g s: topic %s has no message stamped %.3f\n",
                     options_.answer_limit_s, commands_.getTopic().c_str(), stamp_s);
        return false;
      }
    }
    return true;
  }

  void publish_clock(double now) {
    rosgraph_msgs::Clock message;
    message.clock.fromSec(now);
    clock_.publish(message);
  }

  void publish_frame(const MocapFrame& frame) {
    geometry_msgs::PoseStamped message;
    message.header.stamp.fromSec(frame.stamp_s);
    message.header.frame_id = kWorldFrame;
    message.pose = planar_pose(frame.pose.p_W.x(), frame.pose.p_W.y(), frame.pose.yaw);
    if (std::isnan(frame.pose.yaw)) {
      const double nan = std::numeric_limits<double>::quiet_NaN();
      message.pose.position.z = message.pose.orientation.x = message.pose.orientation.y = nan;
    }
    pose_.publish(message);
  }

  void publish_truth(double now) {
    truth_beat_.pass();
    const PlanarState<double> truth = simulation_.truth();
    const Vec2<double> v_B = rotation_WB(truth.yaw).transpose() * truth.v_WC;
    nav_msgs::Odometry message;
    message.header.stamp.fromSec(now);
    message.header.frame_id = kWorldFrame;
    message.child_frame_id = base_frame_;
    message.pose.pose = planar_pose(truth.p_WC.x(), truth.p_WC.y(), truth.yaw);
    message.twist.twist.linear.x = v_B.x();
    message.twist.twist.linear.y = v_B.y();
    message.twist.twist.angular.z = truth.yaw_rate;
    truth_.publish(message);
  }

  void report_progress(double now) {
    progress_beat_.pass();
    const double flown = now - kStart;
    std::printf("sim: t = %.0f / %.0f s, %.1f x real time\n", flown, options_.scenario.duration_s,
                flown / wall_elapsed());
    std::fflush(stdout);
  }

  int finish() {
    const double wall_s = wall_elapsed();
    const double flight_s = simulation_.time_s() - kStart;
    std::printf("sim: flight over: commands %lu in time, %lu late, %lu expired, %lu malformed\n", taken_[0],
                taken_[1], taken_[2], taken_[3]);
    std::fflush(stdout);
    if (!options_.summary.empty()) {
      const nlohmann::json summary = {{"realtime_factor", flight_s / wall_s},
                                      {"flight_s", flight_s},
                                      {"wall_s", wall_s},
                                      {"steps", simulation_.steps()}};
      std::ofstream file(options_.summary);
      file << summary.dump(2) << "\n";
      if (!file.flush()) {
        std::fprintf(stderr, "sim: cannot write %s\n", options_.summary.c_str());
        return 1;
      }
    }
    ros::WallDuration(0.5).sleep();  // the last messages leave the queues before the process ends
    return 0;
  }

  Options options_;
  double end_s_;
  Simulation simulation_;
  MocapSensor mocap_;
  Beat period_, truth_beat_, clock_beat_, progress_beat_;
  std::deque<PendingFrame> frames_;
  std::string base_frame_;
  ros::NodeHandle node_;
  ros::Publisher clock_, pose_, truth_;
  ros::Subscriber commands_;
  ros::WallTime wall_start_;
  bool flying_ = false;
  double target_s_ = kStart;
  double newest_stamp_ = -std::numeric_limits<double>::infinity();
  std::uint64_t taken_[4] = {};  // by ValveSchedule::Taken
};

}  // namespace
}  // namespace atmos

int main(int argc, char** argv) {
  return atmos::run_node(argc, argv, "sim", [] {
    const atmos::Options options = atmos::read_options(ros::NodeHandle("~"));
    try {
      return atmos::SimNode(options).fly();
    } catch (const std::runtime_error& error) {
      std::fprintf(stderr, "sim: %s\n", error.what());
      return 1;
    }
  });
}
