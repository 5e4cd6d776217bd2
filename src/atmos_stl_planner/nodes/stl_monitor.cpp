// Odometry of the robots of a specification (~specification) in, intervals of the robustness that is still
// possible out. Time counts from the stamp of the planner's `stl/plan`; ~start_s, a ROS time, takes its place
// where nobody plans.
#include <atmos_msgs/StlMonitor.h>
#include <atmos_msgs/StlPlan.h>
#include <ros/ros.h>

#include <optional>

#include "atmos_model_ros/node.h"
#include "fleet_odometry.h"
#include "stl_messages.h"

namespace atmos::stl {
namespace {

class MonitorNode {
 public:
  explicit MonitorNode(const Specification& spec, double start_s)
      : spec_(spec),
        monitor_(spec),
        odometry_(node_, spec, [this](double stamp, const auto& p) { on_sample(stamp, p); }) {
    if (start_s > 0.0) t0_s_ = start_s;
    monitor_pub_ = node_.advertise<atmos_msgs::StlMonitor>("stl/monitor", 10000);
    verdict_pub_ = node_.advertise<atmos_msgs::StlMonitor>("stl/verdict", 1, true);
    marker_pub_ = node_.advertise<visualization_msgs::MarkerArray>("stl/monitor_markers", 10, true);
    plan_sub_ = node_.subscribe("stl/plan", 10, &MonitorNode::on_plan, this);
  }

 private:
  void on_plan(const atmos_msgs::StlPlan& plan) {
    if (plan.status != atmos_msgs::StlPlan::PLANNED || plan.clauses.size() != spec_.clauses.size()) return;
    if (!t0_s_) t0_s_ = plan.header.stamp.toSec();
    plan_ = plan;
  }

  void on_sample(double stamp_s, const std::vector<Eigen::Vector2d>& p) {
    if (!t0_s_ || stamp_s < *t0_s_ || stamp_s > *t0_s_ + spec_.horizon_s + 1.0) return;
    const double time = stamp_s - *t0_s_;
    const Verdict before = monitor_.verdict();
    monitor_.update(time, p);
    atmos_msgs::StlMonitor message = monitor_message(spec_, monitor_, *t0_s_, time, p);
    for (std::size_t i = 0; i < plan_.clauses.size(); ++i) {
      message.clauses[i].planned_robustness = plan_.clauses[i].planned_robustness;
      message.clauses[i].planned_time = plan_.clauses[i].planned_time;
    }
    monitor_pub_.publish(message);
    if (monitor_.verdict() != before) {
      verdict_pub_.publish(message);
      publish_marker(message);
      ROS_INFO("%s is %s after %.2f s, robustness in [%.3f, %.3f] m", spec_.name.c_str(),
               monitor_.verdict() == Verdict::kSatisfied ? "satisfied" : "violated", time,
               message.robustness_low, message.robustness_high);
    } else if (time >= next_marker_s_) {
      publish_marker(message);
    }
  }

  void publish_marker(const atmos_msgs::StlMonitor& message) {
    next_marker_s_ = message.time + 0.5;
    visualization_msgs::Marker text;
    text.header.frame_id = kWorldFrame;
    text.ns = "stl_monitor";
    text.type = visualization_msgs::Marker::TEXT_VIEW_FACING;
    text.pose.orientation.w = 1.0;
    text.scale.z = 0.08;
    text.color.r = text.color.g = text.color.b = 0.12F;
    text.color.a = 1.0F;
    // Below the workspace, where it hides nothing.
    Eigen::Vector2d low = corners_of(spec_.workspace).front(), high = low;
    for (const Eigen::Vector2d& corner : corners_of(spec_.workspace)) {
      low = low.cwiseMin(corner);
      high = high.cwiseMax(corner);
    }
    text.pose.position.x = 0.5 * (low.x() + high.x());
    text.pose.position.y = low.y() - 0.1 - 0.05 * static_cast<double>(message.clauses.size() + 1);
    char line[200];
    std::snprintf(line, sizeof line, "%s %.1f s: robustness in [%.2f, %.2f] m", spec_.name.c_str(),
                  message.time, message.robustness_low, message.robustness_high);
    text.text = line;
    for (const auto& clause : message.clauses) {
      static const char* const kMarks[] = {"open", "satisfied", "VIOLATED"};
      text.text += "\n" + clause.formula + ": " + kMarks[std::min<int>(clause.verdict, 2)];
    }
    visualization_msgs::MarkerArray array;
    array.markers.push_back(text);
    marker_pub_.publish(array);
  }

  ros::NodeHandle node_;
  const Specification spec_;
  Monitor monitor_;
  std::optional<double> t0_s_;
  atmos_msgs::StlPlan plan_;
  double next_marker_s_ = 0.0;
  ros::Publisher monitor_pub_, verdict_pub_, marker_pub_;
  ros::Subscriber plan_sub_;
  FleetOdometry odometry_;  // last: its callbacks use the rest
};

int run() {
  ros::NodeHandle private_node("~");
  const Specification spec =
      load_specification(required_parameter<std::string>(private_node, "specification"));
  MonitorNode node(spec, private_node.param("start_s", 0.0));
  ros::spin();
  return 0;
}

}  // namespace
}  // namespace atmos::stl

int main(int argc, char** argv) { return atmos::run_node(argc, argv, "stl_monitor", atmos::stl::run); }
