#include "atmos_sim2real_ros/bag_reader.h"

#include <atmos_msgs/ThrusterCommand.h>
#include <fcntl.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <nav_msgs/Odometry.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <vector>

#include "atmos_model_ros/messages.h"

namespace atmos {

namespace {

constexpr const char* kUnreadable = ": cannot be read as a ROS 1 bag: ";
constexpr rlim_t kReaderMemory = 1UL << 30;         // bytes
constexpr std::uintmax_t kSlowestReading = 500000;  // bytes/s

bool ends_with(const std::string& text, const std::string& ending) {
  return text.size() >= ending.size() &&
         text.compare(text.size() - ending.size(), ending.size(), ending) == 0;
}

// The topics of a type, sorted.
std::vector<std::string> topics_of(rosbag::View& view, const std::string& type) {
  std::vector<std::string> topics;
  for (const rosbag::ConnectionInfo* connection : view.getConnections()) {
    if (connection->datatype == type) topics.push_back(connection->topic);
  }
  std::sort(topics.begin(), topics.end());
  topics.erase(std::unique(topics.begin(), topics.end()), topics.end());
  return topics;
}

std::string one_of(const std::vector<std::string>& topics, const std::string& path, const std::string& what) {
  if (topics.size() == 1) return topics.front();
  std::string names;
  for (const std::string& topic : topics) names += " " + topic;
  throw std::invalid_argument(path + ": " + what + " on more than one topic:" + names);
}

// Where poses are to be read from, best first.
std::string pose_topic(rosbag::View& view, const std::string& path) {
  std::vector<std::string> mocap, other;
  for (const std::string& topic : topics_of(view, "geometry_msgs/PoseStamped")) {
    if (ends_with(topic, "mocap/pose")) {
      mocap.push_back(topic);
    } else if (!ends_with(topic, "setpoint")) {
      other.push_back(topic);
    }
  }
  std::vector<std::string> odometry;
  for (const std::string& topic : topics_of(view, "nav_msgs/Odometry")) {
    if (!ends_with(topic, "sim/truth")) odometry.push_back(topic);
  }
  const std::vector<std::string> transforms = topics_of(view, "geometry_msgs/TransformStamped");
  for (const auto& candidates : {mocap, odometry, transforms, other}) {
    if (!candidates.empty()) return one_of(candidates, path, "poses");
  }
  throw std::invalid_argument(path + ": no pose (PoseStamped, Odometry or TransformStamped)");
}

// An attitude that is none gives no yaw: the pose is dropped later, and counted.
PoseSample sample(const ros::Time& stamp, double x, double y, const geometry_msgs::Quaternion& q) {
  const double norm = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
  const bool unit = std::abs(norm - 1.0) < 0.01;
  return {stamp.toSec(), x, y, unit ? yaw_of(q) : std::numeric_limits<double>::quiet_NaN()};
}

// Believes what the file says of its lengths, as rosbag does: to be called by read_bag's child alone.
Recording read_trusting(const std::string& path) {
  Recording recording;
  try {
    rosbag::Bag bag(path, rosbag::bagmode::Read);
    rosbag::View all(bag);
    const std::vector<std::string> commands = topics_of(all, "atmos_msgs/ThrusterCommand");
    if (commands.empty()) throw std::invalid_argument(path + ": no atmos_msgs/ThrusterCommand");
    std::vector<std::string>
        carried_out;  // what the valves were told, rather than what the controller asked for
    for (const std::string& topic : commands) {
      if (ends_with(topic, "thruster_command")) carried_out.push_back(topic);
    }
    const std::string command_topic =
        one_of(carried_out.empty() ? commands : carried_out, path, "thruster commands");
    const std::string poses = pose_topic(all, path);

    rosbag::View view(bag, rosbag::TopicQuery(std::vector<std::string>{command_topic, poses}));
    for (const rosbag::MessageInstance& message : view) {
      if (message.getTopic() == command_topic) {
        if (const auto command = message.instantiate<atmos_msgs::ThrusterCommand>())
          recording.commands.push_back(from_message(*command));
      } else if (const auto pose = message.instantiate<geometry_msgs::PoseStamped>()) {
        recording.poses.push_back(
            sample(pose->header.stamp, pose->pose.position.x, pose->pose.position.y, pose->pose.orientation));
      } else if (const auto odometry = message.instantiate<nav_msgs::Odometry>()) {
        const auto& at = odometry->pose.pose;
        recording.poses.push_back(
            sample(odometry->header.stamp, at.position.x, at.position.y, at.orientation));
      } else if (const auto transform = message.instantiate<geometry_msgs::TransformStamped>()) {
        const auto& at = transform->transform;
        recording.poses.push_back(
            sample(transform->header.stamp, at.translation.x, at.translation.y, at.rotation));
      }
    }
  } catch (const rosbag::BagException& error) {
    throw std::invalid_argument(path + kUnreadable + error.what());
  } catch (const ros::Exception& error) {
    throw std::invalid_argument(path + kUnreadable + error.what());
  } catch (const std::bad_alloc&) {
    throw std::invalid_argument(path + kUnreadable + "it claims more data than it can hold");
  }
  return recording;
}

// What the child sends: a letter, then text, or counts and numbers.
class Pipe {
 public:
  explicit Pipe(int fd) : fd_(fd) {}
  void put(const void* data, std::size_t size) const {
    const char* from = static_cast<const char*>(data);
    while (size > 0) {
      const ssize_t n = write(fd_, from, size);
      if (n <= 0) _exit(3);
      from += n;
      size -= static_cast<std::size_t>(n);
    }
  }
  // False at the end of what was sent.
  bool take(void* data, std::size_t size) const {
    char* to = static_cast<char*>(data);
    while (size > 0) {
      const ssize_t n = read(fd_, to, size);
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) return false;
      to += n;
      size -= static_cast<std::size_t>(n);
    }
    return true;
  }

 private:
  int fd_;
};

void send(const Pipe& pipe, const Recording& recording) {
  pipe.put("R", 1);
  const std::uint64_t counts[2] = {recording.poses.size(), recording.commands.size()};
  pipe.put(counts, sizeof(counts));
  pipe.put(recording.poses.data(), recording.poses.size() * sizeof(PoseSample));
  for (const ThrusterCommand& command : recording.commands) {
    const double head[3] = {command.stamp_s, command.period_s, static_cast<double>(command.duty.size())};
    pipe.put(head, sizeof(head));
    pipe.put(command.duty.data(), command.duty.size() * sizeof(double));
  }
}

bool receive(const Pipe& pipe, Recording& recording) {
  std::uint64_t counts[2];
  if (!pipe.take(counts, sizeof(counts))) return false;
  recording.poses.resize(counts[0]);
  if (!pipe.take(recording.poses.data(), counts[0] * sizeof(PoseSample))) return false;
  for (std::uint64_t i = 0; i < counts[1]; ++i) {
    double head[3];
    if (!pipe.take(head, sizeof(head))) return false;
    ThrusterCommand command{head[0], head[1], std::vector<double>(static_cast<std::size_t>(head[2]))};
    if (!pipe.take(command.duty.data(), command.duty.size() * sizeof(double))) return false;
    recording.commands.push_back(std::move(command));
  }
  return true;
}

// A damaged file must cost neither the memory it claims nor the time it can waste.
void limit_child(const std::string& path) {
  std::uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  const rlim_t memory = pages * static_cast<rlim_t>(sysconf(_SC_PAGESIZE)) + kReaderMemory;
  const rlim_t seconds = 20 + std::filesystem::file_size(path) / kSlowestReading;
  const rlimit memory_limit{memory, memory}, time_limit{seconds, seconds}, no_core{0, 0};
  setrlimit(RLIMIT_AS, &memory_limit);
  setrlimit(RLIMIT_CPU, &time_limit);
  setrlimit(RLIMIT_CORE, &no_core);
}

[[noreturn]] void read_as_child(const std::string& path, const Pipe& pipe) {
  try {
    // rosbag's own complaints and a failed assertion would only hide the one sentence that is sent.
    if (const int nowhere = open("/dev/null", O_WRONLY); nowhere >= 0) dup2(nowhere, STDERR_FILENO);
    limit_child(path);
    send(pipe, read_trusting(path));
  } catch (const std::exception& error) {
    pipe.put("E", 1);
    pipe.put(error.what(), std::strlen(error.what()));
  }
  _exit(0);
}

}  // namespace

Recording read_bag(const std::string& path) {
  if (!std::filesystem::is_regular_file(path)) throw std::invalid_argument(path + ": no such file");
  int ends[2];
  if (pipe(ends) != 0) throw std::runtime_error("no pipe to be had");
  const pid_t child = fork();
  if (child == 0) {
    close(ends[0]);
    read_as_child(path, Pipe(ends[1]));
  }
  close(ends[1]);
  Recording recording;
  recording.name = std::filesystem::path(path).stem().string();
  const Pipe pipe(ends[0]);
  char kind = 0;
  bool whole = child > 0 && pipe.take(&kind, 1);
  std::string refusal;
  if (whole && kind == 'R') whole = receive(pipe, recording);
  if (whole && kind == 'E') {
    for (char c; pipe.take(&c, 1);) refusal += c;
  }
  close(ends[0]);
  int status = 0;
  while (child > 0 && waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (!refusal.empty()) throw std::invalid_argument(refusal);
  if (!whole || !WIFEXITED(status) || WEXITSTATUS(status) != 0)
    throw std::invalid_argument(path + kUnreadable + "it is damaged, its reader had to be stopped");
  return recording;
}

}  // namespace atmos
