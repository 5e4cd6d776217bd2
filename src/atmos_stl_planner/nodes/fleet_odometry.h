// Odometry of all robots of a specification brought to common times.
#pragma once

#include <nav_msgs/Odometry.h>
#include <ros/ros.h>

#include <functional>
#include <vector>

#include "atmos_model_ros/messages.h"
#include "atmos_stl_planner/specification.h"

namespace atmos::stl {

// Calls `sample(stamp, positions)` whenever every robot has odometry not older than `stamp`; robots that are
// ahead are interpolated. Odometry in another frame, not finite or out of order is counted and ignored.
class FleetOdometry {
 public:
  using Sample = std::function<void(double stamp_s, const std::vector<Eigen::Vector2d>& p_WB)>;

  FleetOdometry(ros::NodeHandle& node, const Specification& specification, Sample sample)
      : sample_(std::move(sample)), tracks_(specification.robots.size()) {
    for (std::size_t i = 0; i < specification.robots.size(); ++i) {
      const boost::function<void(const nav_msgs::Odometry&)> see =
          [this, i](const nav_msgs::Odometry& message) { on_odometry(i, message); };
      subscribers_.push_back(
          node.subscribe<nav_msgs::Odometry>("/" + specification.robots[i].name + "/odometry", 1000, see, {},
                                             ros::TransportHints().tcpNoDelay()));
    }
  }

  unsigned long long rejected() const { return rejected_; }

 private:
  struct Track {
    double before_s = 0.0, last_s = 0.0;
    Eigen::Vector2d before = Eigen::Vector2d::Zero(), last = Eigen::Vector2d::Zero();
    bool seen = false;
  };

  void on_odometry(std::size_t robot, const nav_msgs::Odometry& message) {
    Track& track = tracks_[robot];
    const double stamp = message.header.stamp.toSec();
    const Eigen::Vector2d p(message.pose.pose.position.x, message.pose.pose.position.y);
    if (message.header.frame_id != kWorldFrame || !p.allFinite() || (track.seen && !(stamp > track.last_s))) {
      ++rejected_;
      return;
    }
    track.before_s = track.seen ? track.last_s : stamp;
    track.before = track.seen ? track.last : p;
    track.last_s = stamp;
    track.last = p;
    track.seen = true;

    double common = stamp;
    for (const Track& other : tracks_) {
      if (!other.seen) return;
      common = std::min(common, other.last_s);
    }
    if (!(common > common_s_)) return;
    common_s_ = common;
    std::vector<Eigen::Vector2d> positions;
    for (const Track& other : tracks_) {
      const double length = other.last_s - other.before_s;
      const double share = length > 0.0 ? std::max(0.0, (common - other.before_s) / length) : 1.0;
      positions.push_back(other.before + share * (other.last - other.before));
    }
    sample_(common, positions);
  }

  Sample sample_;
  std::vector<Track> tracks_;
  std::vector<ros::Subscriber> subscribers_;
  double common_s_ = -1.0;
  unsigned long long rejected_ = 0;
};

}  // namespace atmos::stl
