// Gives the nodes of a robot the inputs of a recorded flight again: mocap/pose, setpoint, trajectory, and the
// commands that acted (on recorded/thruster_command: the odometry filter's known input), with the clock.
// In lockstep every recorded command is answered by the nodes' own before time goes on, so that the outcome
// does not depend on speed; in real time each message comes when it was received. launch/replay.launch
// explains the parameters.
#include <atmos_msgs/RunConfiguration.h>
#include <atmos_msgs/ThrusterCommand.h>
#include <geometry_msgs/PoseStamped.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <rosgraph_msgs/Clock.h>
#include <trajectory_msgs/MultiDOFJointTrajectory.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "atmos_model_ros/connections.h"
#include "atmos_model_ros/node.h"
#include "atmos_operator/replay_order.h"
#include "atmos_operator/run_configuration.h"

namespace atmos {
namespace {

constexpr std::uint32_t kQueue = 100000;  // messages: nothing may be lost at many times real time
constexpr double kTick_s = 0.004;         // of ROS time between two ticks of the clock in real time
constexpr double kSameInstant = 1e-4;     // s, as replay_order has it
const char* const kInputs[] = {"mocap/pose", "setpoint", "trajectory", "thruster_command"};

struct Settings {
  std::vector<std::string> bags;
  bool lockstep;
  double speed;  // recorded seconds per wall second; 0: as fast as the answers come
  double answer_limit_s;
  std::vector<Connection> wait_for;
};

Settings read_settings(const ros::NodeHandle& node) {
  std::vector<ConfigFault> faults;
  const auto fault = [&](const char* key, const char* rule) {
    faults.push_back({node.getNamespace(), 0, key, rule});
  };
  const auto clock = required_parameter<std::string>(node, "clock");
  Settings settings{{},
                    clock == "lockstep",
                    required_parameter<double>(node, "speed"),
                    required_parameter<double>(node, "answer_limit_s"),
                    parse_connections(required_parameter<std::string>(node, "wait_for"))};
  std::istringstream names(required_parameter<std::string>(node, "bag"));
  for (std::string name; names >> name;) settings.bags.push_back(name);
  if (settings.bags.empty()) fault("bag", "must name a bag");
  if (clock != "lockstep" && clock != "real") fault("clock", "must be one of lockstep, real");
  if (!(settings.speed >= 0.0) || std::isinf(settings.speed)) fault("speed", "must be >= 0");
  if (!settings.lockstep && settings.speed == 0.0) fault("speed", "must be > 0 with clock:=real");
  if (!(settings.answer_limit_s > 0.0)) fault("answer_limit_s", "must be > 0");
  if (!faults.empty()) throw ConfigError(faults);
  return settings;
}

class Replay {
 public:
  explicit Replay(Settings settings) : settings_(std::move(settings)) {
    clock_ = node_.advertise<rosgraph_msgs::Clock>("/clock", kQueue, settings_.lockstep);
    poses_ = node_.advertise<geometry_msgs::PoseStamped>("mocap/pose", kQueue);
    goals_ = node_.advertise<geometry_msgs::PoseStamped>("setpoint", kQueue);
    trajectories_ = node_.advertise<trajectory_msgs::MultiDOFJointTrajectory>("trajectory", kQueue);
    acted_ = node_.advertise<atmos_msgs::ThrusterCommand>("recorded/thruster_command", kQueue);
    answers_ = node_.subscribe("thruster_command", kQueue, &Replay::on_answer, this,
                               ros::TransportHints().tcpNoDelay());
    load();
  }

  // The exit code.
  int run() {
    const double start = first_frame_s_;
    if (!wait_for_connections(settings_.wait_for, settings_.answer_limit_s, "replay",
                              [&] { publish_clock(start); }))
      return ros::ok() ? 1 : 0;
    const ros::WallTime wall_start = ros::WallTime::now();
    for (const ReplayEvent& event : events_) {
      if (settings_.speed > 0.0) pace(event.time_s, start, wall_start);
      if (!ros::ok()) return 0;
      if (event.time_s > now_) publish_clock(event.time_s);
      // Part of a split recording may hold a command without the frame that it answers.
      const bool answered = event.kind == ReplayKind::kCommand &&
                            event.time_s > first_frame_s_ - kSameInstant &&
                            event.time_s < last_frame_s_ + kSameInstant;
      if (settings_.lockstep && answered && !wait_for_answer(event.time_s)) return ros::ok() ? 1 : 0;
      messages_[event.message]();
    }
    std::printf("replay: over, %.1f s at %.1f x real time, %zu commands of the nodes\n", now_ - start,
                (now_ - start) / (ros::WallTime::now() - wall_start).toSec(), answered_);
    std::fflush(stdout);
    ros::WallDuration(0.5).sleep();  // the last messages leave the queues before the process ends
    return 0;
  }

 private:
  void load() {
    std::vector<rosbag::Bag> bags(settings_.bags.size());
    rosbag::View view;
    std::vector<std::string> topics{node_.resolveName("configuration")};
    for (const char* name : kInputs) topics.push_back(node_.resolveName(name));
    for (std::size_t i = 0; i < bags.size(); ++i) {
      bags[i].open(settings_.bags[i], rosbag::bagmode::Read);
      view.addQuery(bags[i], rosbag::TopicQuery(topics));
    }
    for (const rosbag::MessageInstance& instance : view) {
      if (instance.getTopic() == topics[1]) {
        keep<geometry_msgs::PoseStamped>(instance, ReplayKind::kFrame, poses_);
      } else if (instance.getTopic() == topics[2]) {
        keep<geometry_msgs::PoseStamped>(instance, ReplayKind::kGoal, goals_);
      } else if (instance.getTopic() == topics[3]) {
        keep<trajectory_msgs::MultiDOFJointTrajectory>(instance, ReplayKind::kGoal, trajectories_);
      } else if (instance.getTopic() == topics[4]) {
        keep<atmos_msgs::ThrusterCommand>(instance, ReplayKind::kCommand, acted_);
      } else if (const auto run = instance.instantiate<atmos_msgs::RunConfiguration>()) {
        compare(*run);
      }
    }
    first_frame_s_ = std::numeric_limits<double>::infinity();
    for (const ReplayEvent& event : events_) {
      if (event.kind != ReplayKind::kFrame) continue;
      first_frame_s_ = std::min(first_frame_s_, event.time_s);
      last_frame_s_ = std::max(last_frame_s_, event.time_s);
    }
    if (std::isinf(first_frame_s_))
      throw std::invalid_argument("no " + topics[1] + " in " + settings_.bags.front());
    // What was received before the flight's time began holds from its begin.
    for (ReplayEvent& event : events_) {
      if (event.kind == ReplayKind::kGoal) event.time_s = std::max(event.time_s, first_frame_s_);
    }
    events_ = replay_order(std::move(events_));
  }

  template <class Message>
  void keep(const rosbag::MessageInstance& instance, ReplayKind kind, const ros::Publisher& publisher) {
    const boost::shared_ptr<Message> message = instance.instantiate<Message>();
    if (message == nullptr) throw std::invalid_argument(instance.getTopic() + " is not of the expected type");
    const ros::Time stamp = message->header.stamp;
    const bool goal = kind == ReplayKind::kGoal;
    if (goal) {
      // At the head of a split file the last goal stands again.
      const ros::SerializedMessage bytes = ros::serialization::serializeMessage(*message);
      std::string content(reinterpret_cast<const char*>(bytes.buf.get()), bytes.num_bytes);
      std::string& last = last_goal_[instance.getTopic()];
      if (content == last) return;
      last = std::move(content);
    }
    // In lockstep frames and commands are due when they say; a goal has been heard of when it was received.
    const ros::Time due = settings_.lockstep && !goal ? stamp : instance.getTime();
    events_.push_back({due.toSec(), kind, messages_.size()});
    messages_.push_back([publisher, message] { publisher.publish(message); });
  }

  // Once each; a split recording says in every file what was running.
  void warn(const std::string& text) {
    if (warned_.insert(text).second) std::fprintf(stderr, "replay: warning: %s\n", text.c_str());
  }

  // Says what of the nodes' configuration is not what was recorded.
  void compare(const atmos_msgs::RunConfiguration& run) {
    const std::string space = node_.getNamespace() + "/";
    for (const std::string& parameter : run.parameters) {
      if (settings_.lockstep && parameter == space + "nmpc/lockstep: false")
        warn("recorded in real time: repeated closely only with clock:=real");
    }
    for (const auto& file : run.files) {
      for (const std::string& parameter : file.used_by) {
        std::string path;
        if (parameter.compare(0, space.size(), space) != 0 ||
            parameter.find("setpoint_player") != parameter.npos || !ros::param::get(parameter, path))
          continue;
        const auto now = collect_configuration({{parameter, path}});
        for (const ConfigurationFile& other : now.files) {
          if (other.used_by.front() == parameter && other.sha256 != file.sha256)
            warn(parameter + " is not the recorded file " + file.path + " (sha256 " +
                 file.sha256.substr(0, 16) + "...): now it is " + path);
        }
      }
    }
  }

  void on_answer(const atmos_msgs::ThrusterCommand& message) {
    ++answered_;
    newest_answer_s_ = std::max(newest_answer_s_, message.header.stamp.toSec());
  }

  bool wait_for_answer(double stamp_s) {
    const ros::WallTime limit = ros::WallTime::now() + ros::WallDuration(settings_.answer_limit_s);
    while (newest_answer_s_ < stamp_s - kSameInstant) {
      ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.05));
      if (!ros::ok()) return false;
      if (ros::WallTime::now() > limit) {
        std::fprintf(stderr, "replay: no answer for %.3g s: topic %s has no message stamped %.3f\n",
                     settings_.answer_limit_s, answers_.getTopic().c_str(), stamp_s);
        return false;
      }
    }
    return true;
  }

  // Waits until `time_s` is due on the wall clock; in real time the nodes' clock ticks meanwhile.
  void pace(double time_s, double start_s, const ros::WallTime& wall_start) {
    while (ros::ok()) {
      const double ahead = (time_s - start_s) / settings_.speed - (ros::WallTime::now() - wall_start).toSec();
      if (ahead <= 0.0) return;
      ros::getGlobalCallbackQueue()->callAvailable(
          ros::WallDuration(settings_.lockstep ? ahead : std::min(ahead, kTick_s / settings_.speed)));
      const double now = start_s + (ros::WallTime::now() - wall_start).toSec() * settings_.speed;
      if (!settings_.lockstep && now > now_ && now < time_s) publish_clock(now);
    }
  }

  void publish_clock(double now_s) {
    now_ = now_s;
    rosgraph_msgs::Clock message;
    message.clock.fromSec(now_s);
    clock_.publish(message);
  }

  ros::NodeHandle node_;
  Settings settings_;
  ros::Publisher clock_, poses_, goals_, trajectories_, acted_;
  ros::Subscriber answers_;
  std::vector<std::function<void()>> messages_;
  std::vector<ReplayEvent> events_;
  std::set<std::string> warned_;
  std::map<std::string, std::string> last_goal_;  // of each topic, as bytes
  std::size_t answered_ = 0;
  double first_frame_s_ = 0.0, last_frame_s_ = 0.0, now_ = 0.0, newest_answer_s_ = 0.0;
};

}  // namespace
}  // namespace atmos

int main(int argc, char** argv) {
  return atmos::run_node(argc, argv, "replay", [] {
    const auto settings = atmos::read_settings(ros::NodeHandle("~"));
    try {
      return atmos::Replay(settings).run();
    } catch (const rosbag::BagException& error) {
      std::fprintf(stderr, "replay: %s: %s\n", settings.bags.front().c_str(), error.what());
      return 2;
    }
  });
}
