#include "stl_messages.h"

#include <algorithm>
#include <cmath>

#include "atmos_model_ros/messages.h"
#include "atmos_stl_planner/trajectory_samples.h"

namespace atmos::stl {

namespace {

constexpr double kSample_s = 0.1;
constexpr double kPath_s = 0.25;

std_msgs::ColorRGBA color(double r, double g, double b, double a) {
  std_msgs::ColorRGBA result;
  result.r = static_cast<float>(r);
  result.g = static_cast<float>(g);
  result.b = static_cast<float>(b);
  result.a = static_cast<float>(a);
  return result;
}

geometry_msgs::Point point(const Eigen::Vector2d& p) {
  geometry_msgs::Point result;
  result.x = p.x();
  result.y = p.y();
  return result;
}

visualization_msgs::Marker marker(const std::string& space, int id, int type, double size) {
  visualization_msgs::Marker made;
  made.header.frame_id = kWorldFrame;
  made.ns = space;
  made.id = id;
  made.type = type;
  made.action = visualization_msgs::Marker::ADD;
  made.pose.orientation.w = 1.0;
  made.scale.x = made.scale.y = made.scale.z = size;
  return made;
}

void add_region(const Region& region, const std::string& label, bool obstacle,
                visualization_msgs::MarkerArray& array) {
  const int id = static_cast<int>(array.markers.size());
  auto outline = marker("stl_places", id, visualization_msgs::Marker::LINE_STRIP, 0.02);
  outline.color = obstacle ? color(0.8, 0.1, 0.1, 1.0) : color(0.1, 0.3, 0.8, 1.0);
  std::vector<Eigen::Vector2d> corners = corners_of(region.polytope);
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& corner : corners) middle += corner / static_cast<double>(corners.size());
  corners.push_back(corners.front());
  for (const Eigen::Vector2d& corner : corners)
    outline.points.push_back(point(corner + region.displacement(0.0)));
  array.markers.push_back(outline);
  auto text = marker("stl_places", id + 1, visualization_msgs::Marker::TEXT_VIEW_FACING, 0.12);
  text.pose.position = point(middle + region.displacement(0.0));
  text.color = outline.color;
  text.text = label;
  array.markers.push_back(text);
}

std::vector<Eigen::Vector2d> positions_at(const Specification& spec, const Motion& motion, double time_s) {
  std::vector<Eigen::Vector2d> positions;
  for (std::size_t i = 0; i < spec.robots.size(); ++i) positions.push_back(motion.at(i, time_s).p_WB);
  return positions;
}

// The windows in which clauses speak of a region.
std::string windows_of(const Specification& spec, std::size_t region) {
  std::string label = spec.regions[region].name;
  for (const Clause& clause : spec.clauses) {
    if (clause.text.find("in(" + spec.regions[region].name + ")") != std::string::npos)
      label += "\n" + clause.text;
  }
  return label;
}

}  // namespace

trajectory_msgs::MultiDOFJointTrajectory trajectory_message(const Specification& spec, const Motion& motion,
                                                            std::size_t robot, double t0_s, double from_s) {
  trajectory_msgs::MultiDOFJointTrajectory message;
  message.header.frame_id = kWorldFrame;
  message.header.stamp.fromSec(t0_s + from_s);
  message.joint_names = {"base_link"};
  for (const TrajectorySample& sample : samples(spec, motion, robot, kSample_s, from_s)) {
    trajectory_msgs::MultiDOFJointTrajectoryPoint to;
    to.time_from_start.fromSec(sample.time_s - from_s);
    geometry_msgs::Transform pose;
    pose.translation.x = sample.state.p_WB.x();
    pose.translation.y = sample.state.p_WB.y();
    pose.rotation = yaw_quaternion(sample.yaw_rad);
    geometry_msgs::Twist velocity, acceleration;
    velocity.linear.x = sample.state.v_WB.x();
    velocity.linear.y = sample.state.v_WB.y();
    velocity.angular.z = sample.yaw_rate_rad_s;
    acceleration.linear.x = sample.state.a_WB.x();
    acceleration.linear.y = sample.state.a_WB.y();
    acceleration.angular.z = sample.yaw_acceleration_rad_s2;
    to.transforms.push_back(pose);
    to.velocities.push_back(velocity);
    to.accelerations.push_back(acceleration);
    message.points.push_back(to);
  }
  return message;
}

atmos_msgs::StlPlan plan_message(const Specification& spec, const Plan& plan, double t0_s) {
  atmos_msgs::StlPlan message;
  message.header.frame_id = kWorldFrame;
  message.header.stamp.fromSec(t0_s);
  message.specification = spec.name;
  message.status = static_cast<std::uint8_t>(plan.status);
  message.method = plan.method;
  message.robustness = plan.certificate.robustness_m;
  message.robustness_bound = plan.bound_m;
  message.peak_velocity = plan.certificate.peak_velocity_share;
  message.peak_acceleration = plan.certificate.peak_acceleration_share;
  message.separation = plan.certificate.separation_m;
  message.planning_time = plan.total_s;
  for (std::size_t i = 0; i < plan.certificate.clauses.size(); ++i) {
    const ClauseCertificate& from = plan.certificate.clauses[i];
    atmos_msgs::StlClause clause;
    clause.formula = spec.clauses[i].text;
    clause.planned_robustness = clause.robustness_low = clause.robustness_high = from.robustness_m;
    clause.planned_time = from.time_s;
    clause.lateness = from.lateness_s;
    clause.earliness = from.earliness_s;
    message.clauses.push_back(clause);
  }
  if (plan.motion.empty()) return message;
  for (double t = 0.0; t <= spec.horizon_s; t += kPath_s) {
    message.curve_time.push_back(t);
    message.curve.push_back(demand_now(spec, t, positions_at(spec, plan.motion, t)));
  }
  return message;
}

atmos_msgs::StlMonitor monitor_message(const Specification& spec, const Monitor& monitor, double t0_s,
                                       double time_s, const std::vector<Eigen::Vector2d>& p_WB) {
  atmos_msgs::StlMonitor message;
  message.header.frame_id = kWorldFrame;
  message.header.stamp.fromSec(t0_s + time_s);
  message.specification = spec.name;
  message.time = time_s;
  message.now = demand_now(spec, time_s, p_WB);
  message.robustness_low = monitor.low_m();
  message.robustness_high = monitor.high_m();
  message.verdict = static_cast<std::uint8_t>(monitor.verdict());
  for (std::size_t i = 0; i < spec.clauses.size(); ++i) {
    const ClauseState& from = monitor.clauses()[i];
    atmos_msgs::StlClause clause;
    clause.formula = spec.clauses[i].text;
    clause.robustness_low = from.low_m;
    clause.robustness_high = from.high_m;
    clause.verdict = static_cast<std::uint8_t>(from.verdict);
    message.clauses.push_back(clause);
  }
  return message;
}

visualization_msgs::MarkerArray markers(const Specification& spec, const Plan* plan) {
  visualization_msgs::MarkerArray array;
  for (std::size_t i = 0; i < spec.regions.size(); ++i)
    add_region(spec.regions[i], windows_of(spec, i), false, array);
  for (const Region& obstacle : spec.obstacles) add_region(obstacle, obstacle.name, true, array);
  if (plan == nullptr || plan->motion.empty()) return array;
  for (std::size_t robot = 0; robot < spec.robots.size(); ++robot) {
    auto path = marker("stl_plan", static_cast<int>(robot), visualization_msgs::Marker::LINE_STRIP, 0.02);
    for (double t = 0.0; t <= spec.horizon_s; t += kPath_s) {
      const std::vector<Eigen::Vector2d> positions = positions_at(spec, plan->motion, t);
      const double share = std::clamp(
          demand_now(spec, t, positions) / std::max(1e-6, plan->certificate.robustness_m), 0.0, 1.0);
      path.points.push_back(point(positions[robot]));
      path.colors.push_back(color(1.0 - share, share, 0.1, 1.0));
    }
    array.markers.push_back(path);
  }
  return array;
}

}  // namespace atmos::stl
