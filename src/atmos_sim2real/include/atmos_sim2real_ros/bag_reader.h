// Reads a recording out of a ROS 1 bag.
#pragma once

#include <string>

#include "atmos_sim2real/recording.h"

namespace atmos {

// Topics are found by type: poses from geometry_msgs/PoseStamped on a topic that ends in mocap/pose, else
// nav_msgs/Odometry, else geometry_msgs/TransformStamped, else any PoseStamped that is not a set-point;
// commands from atmos_msgs/ThrusterCommand. Throws std::invalid_argument, naming the file, when the bag
// cannot be read or one of the two is missing or ambiguous. A child process reads, within limits of memory
// and time, because rosbag believes the lengths that a damaged file states.
Recording read_bag(const std::string& path);

}  // namespace atmos
