#include "atmos_sim2real_ros/bag_reader.h"

#include <atmos_msgs/ThrusterCommand.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <nav_msgs/Odometry.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>

#include <algorithm>
#include <filesystem>
#include <stdexcept>
#include <vector>

#include "atmos_model_ros/messages.h"

namespace atmos {

namespace {

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

PoseSample sample(const ros::Time& stamp, double x, double y, const geometry_msgs::Quaternion& q) {
  return {stamp.toSec(), x, y, yaw_of(q)};
}

}  // namespace

Recording read_bag(const std::string& path) {
  Recording recording;
  recording.name = std::filesystem::path(path).stem().string();
  if (!std::filesystem::exists(path)) throw std::invalid_argument(path + ": no such file");
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
    throw std::invalid_argument(path + ": cannot be read as a ROS 1 bag: " + error.what());
  }
  return recording;
}

}  // namespace atmos
