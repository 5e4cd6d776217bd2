// The simulator as a node: for every robot mocap frames, truth, air and battery out and thruster commands in,
// in the robot's namespace, and one clock (docs/architecture.md, "Lockstep").
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Clock.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "atmos_model_ros/connections.h"
#include "atmos_model_ros/node.h"
#include "atmos_sim/simulation.h"
#include "options.h"
#include "robot_topics.h"

namespace atmos {
namespace {

constexpr double kStart = 1000.0;        // t0, ROS time
constexpr double kTruthRate = 100.0;     // Hz
constexpr double kSupplyRate = 10.0;     // Hz of air and battery
constexpr double kClockRate = 250.0;     // Hz of ROS time in real time, besides the frames
constexpr double kProgressPeriod = 5.0;  // s of ROS time
constexpr double kSameInstant = 1e-6;    // s: above the rounding of a stamp, far below a frame
constexpr int kClockQueue = 10000;       // messages: nothing may be lost at many times real time

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

// A fleet's robots have namespaces of their own below the node's; a robot alone has the node's.
std::string alone_name(const Scenario& scenario) {
  const std::string space = ros::this_node::getNamespace();
  const std::string robot = space.substr(space.rfind('/') + 1);
  return robot.empty() ? scenario.vehicle.name : robot;
}

class SimNode {
 public:
  explicit SimNode(Options options)
      : options_(std::move(options)),
        end_s_(kStart + options_.fleet.front().duration_s),
        simulation_(options_.fleet, kStart),
        period_(options_.fleet.front().vehicle.pwm.period_s, kStart),
        truth_beat_(1.0 / kTruthRate, kStart),
        supply_beat_(1.0 / kSupplyRate, kStart),
        clock_beat_(1.0 / kClockRate, kStart),
        progress_beat_(kProgressPeriod, kStart + kProgressPeriod) {
    // Latched in lockstep, where time stands still until a node that came late has answered. In real time the
    // next tick follows at once, and a latched one may overtake it: time would run back for that node.
    clock_ = node_.advertise<rosgraph_msgs::Clock>("/clock", kClockQueue, options_.lockstep);
    for (std::size_t i = 0; i < simulation_.size(); ++i) {
      const Scenario& scenario = options_.fleet[i];
      const std::string& name = scenario.robot;
      robots_.push_back(std::make_unique<RobotTopics>(name.empty() ? node_ : ros::NodeHandle(node_, name),
                                                      name.empty() ? alone_name(scenario) : name, scenario,
                                                      simulation_.robot(i), kStart, [this] { catch_up(); }));
    }
  }

  // Flies the scenario; the exit code.
  int fly() {
    if (!wait_for_connections()) return ros::ok() ? 1 : 0;
    wall_start_ = ros::WallTime::now();
    flying_ = true;
    while (ros::ok()) {
      if (!reach_next_event()) break;
      const double now = simulation_.time_s();
      const bool frame_due = next_frame_s() <= now + kSameInstant;
      if (frame_due || clock_beat_.due(now) || (options_.lockstep && period_.due(now))) publish_clock(now);
      while (clock_beat_.due(now)) clock_beat_.pass();
      const bool truth_due = truth_beat_.due(now), supply_due = supply_beat_.due(now);
      for (const auto& robot : robots_) {
        if (frame_due) robot->expose(now, publish_delay());
        robot->publish_frames(now);
        if (truth_due) robot->publish_truth(now);
        if (supply_due) robot->publish_supplies(now);
      }
      if (truth_due) truth_beat_.pass();
      if (supply_due) supply_beat_.pass();
      if (progress_beat_.due(now)) report_progress(now);
      if (now >= end_s_ - kSameInstant) return finish();
      if (period_.due(now)) {
        if (options_.lockstep && !wait_for_answers(period_.next())) return ros::ok() ? 1 : 0;
        period_.pass();
      }
    }
    return 0;
  }

 private:
  double publish_delay() const {
    return options_.lockstep ? 0.0 : options_.fleet.front().mocap.publish_delay_s;
  }
  double wall_elapsed() const { return (ros::WallTime::now() - wall_start_).toSec(); }
  void spin_for(double wall_s) { ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(wall_s)); }
  // All robots are seen by the same cameras.
  double next_frame_s() const { return robots_.front()->next_frame_s(); }

  double next_event() const {
    double next = std::min({end_s_, next_frame_s(), truth_beat_.next(), supply_beat_.next(), period_.next(),
                            robots_.front()->next_publication_s()});
    if (!options_.lockstep) next = std::min(next, clock_beat_.next());
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

  // In real time a command acts from the moment it arrives, not from the last event before.
  void catch_up() {
    if (!options_.lockstep && flying_)
      simulation_.advance_to(std::min(target_s_, kStart + wall_elapsed() * options_.speed));
  }

  bool wait_for_connections() {
    return atmos::wait_for_connections(options_.wait_for, options_.answer_limit_s, "sim", [this] {
      publish_clock(kStart);
      spin_for(0.02);
    });
  }

  bool wait_for_answers(double stamp_s) {
    const ros::WallTime limit = ros::WallTime::now() + ros::WallDuration(options_.answer_limit_s);
    for (const auto& robot : robots_) {
      while (robot->newest_stamp_s() < stamp_s - kSameInstant) {
        spin_for(0.05);
        if (!ros::ok()) return false;
        if (ros::WallTime::now() > limit) {
          std::fprintf(stderr, "sim: no answer for %.3g s: topic %s has no message stamped %.3f\n",
                       options_.answer_limit_s, robot->command_topic().c_str(), stamp_s);
          return false;
        }
      }
    }
    return true;
  }

  void publish_clock(double now) {
    rosgraph_msgs::Clock message;
    message.clock.fromSec(now);
    clock_.publish(message);
  }

  void report_progress(double now) {
    progress_beat_.pass();
    const double flown = now - kStart;
    std::printf("sim: t = %.0f / %.0f s, %.1f x real time\n", flown, end_s_ - kStart, flown / wall_elapsed());
    std::fflush(stdout);
  }

  int finish() {
    const double wall_s = wall_elapsed();
    const double flight_s = simulation_.time_s() - kStart;
    for (std::size_t i = 0; i < robots_.size(); ++i) {
      const std::string& name = options_.fleet[i].robot;
      const auto& taken = robots_[i]->counts().taken;
      std::printf("sim: flight over%s%s: commands %lu in time, %lu late, %lu expired, %lu malformed\n",
                  name.empty() ? "" : ", ", name.c_str(), taken[0], taken[1], taken[2], taken[3]);
    }
    if (robots_.size() > 1)
      std::printf("sim: contact points, summed over the steps: %lu\n", simulation_.contacts());
    std::fflush(stdout);
    if (!options_.summary.empty()) {
      const nlohmann::json summary = {{"realtime_factor", flight_s / wall_s},
                                      {"flight_s", flight_s},
                                      {"wall_s", wall_s},
                                      {"steps", simulation_.steps()},
                                      {"contacts", simulation_.contacts()}};
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
  Beat period_, truth_beat_, supply_beat_, clock_beat_, progress_beat_;
  ros::NodeHandle node_;
  ros::Publisher clock_;
  std::vector<std::unique_ptr<RobotTopics>> robots_;
  ros::WallTime wall_start_;
  bool flying_ = false;
  double target_s_ = kStart;
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
