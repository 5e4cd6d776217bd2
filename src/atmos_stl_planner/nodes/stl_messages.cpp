#include "stl_messages.h"

#include <algorithm>
#include <cmath>

#include "atmos_model_ros/marker.h"
#include "atmos_model_ros/planar_trajectory.h"
#include "atmos_stl_planner/trajectory_samples.h"

namespace atmos::stl {

namespace {

constexpr double kSample_s = 0.1;
constexpr double kPath_s = 0.25;
constexpr double kLabel_m = 0.09;  // height of a line of text

geometry_msgs::Point point(const Eigen::Vector2d& p) { return point_at({p.x(), p.y(), 0.0}); }

visualization_msgs::Marker marker(const std::string& space, int id, int type, double size) {
  visualization_msgs::Marker made = make_marker(space, id, type, {});
  made.scale.x = made.scale.y = made.scale.z = size;
  return made;
}

// Outline, a tinted face and, above it where nothing of it is hidden, the text.
void add_region(const Region& region, const std::string& label, bool keep_out,
                visualization_msgs::MarkerArray& array) {
  const int id = static_cast<int>(array.markers.size());
  auto outline = marker("stl_places", id, visualization_msgs::Marker::LINE_STRIP, 0.02);
  outline.color = keep_out ? color(0.75, 0.1, 0.1, 1.0) : color(0.1, 0.3, 0.8, 1.0);
  auto face = marker("stl_places", id + 1, visualization_msgs::Marker::TRIANGLE_LIST, 1.0);
  face.color = outline.color;
  face.color.a = 0.12F;
  std::vector<Eigen::Vector2d> corners = corners_of(region.polytope);
  for (Eigen::Vector2d& corner : corners) corner += region.displacement(0.0);
  Eigen::Vector2d low = corners.front(), high = low;
  for (const Eigen::Vector2d& corner : corners) {
    low = low.cwiseMin(corner);
    high = high.cwiseMax(corner);
  }
  for (std::size_t k = 2; k < corners.size(); ++k) {
    for (const std::size_t corner : {std::size_t{0}, k - 1, k}) face.points.push_back(point(corners[corner]));
  }
  corners.push_back(corners.front());
  for (const Eigen::Vector2d& corner : corners) outline.points.push_back(point(corner));
  auto text = marker("stl_places", id + 2, visualization_msgs::Marker::TEXT_VIEW_FACING, kLabel_m);
  const auto lines = 1 + std::count(label.begin(), label.end(), '\n');
  text.pose.position =
      point({0.5 * (low.x() + high.x()), high.y() + 0.04 + 0.6 * kLabel_m * static_cast<double>(lines)});
  text.color = outline.color;
  text.text = label;
  array.markers.push_back(outline);
  array.markers.push_back(face);
  array.markers.push_back(text);
}

// A colour of its own for each robot's plan.
std_msgs::ColorRGBA plan_color(std::size_t robot) {
  static const double kHues[][3] = {
      {0.05, 0.50, 0.35}, {0.55, 0.20, 0.75}, {0.90, 0.50, 0.05}, {0.00, 0.45, 0.75}};
  const auto& hue = kHues[robot % 4];
  return color(hue[0], hue[1], hue[2], 1.0);
}

// Whether clauses speak of a region only to keep robots out of it.
bool only_kept_out(const Specification& spec, const std::string& region) {
  bool spoken_of = false;
  for (const Clause& clause : spec.clauses) {
    if (clause.text.find("in(" + region + ")") == std::string::npos) continue;
    spoken_of = true;
    if (clause.text.find("not ") == std::string::npos) return false;
  }
  return spoken_of;
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
  trajectory_msgs::MultiDOFJointTrajectory message = planar_trajectory(t0_s + from_s);
  for (const TrajectorySample& sample : samples(spec, motion, robot, kSample_s, from_s)) {
    const auto& at = sample.state;
    message.points.push_back(trajectory_point({sample.time_s - from_s,
                                               {at.p_WB.x(), at.p_WB.y(), sample.yaw_rad},
                                               {at.v_WB.x(), at.v_WB.y(), sample.yaw_rate_rad_s},
                                               {at.a_WB.x(), at.a_WB.y(), sample.yaw_acceleration_rad_s2}}));
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
    add_region(spec.regions[i], windows_of(spec, i), only_kept_out(spec, spec.regions[i].name), array);
  for (const Region& obstacle : spec.obstacles) add_region(obstacle, obstacle.name, true, array);
  if (plan == nullptr || plan->motion.empty()) return array;
  for (std::size_t robot = 0; robot < spec.robots.size(); ++robot) {
    auto path = marker("stl_plan", static_cast<int>(robot), visualization_msgs::Marker::LINE_STRIP, 0.02);
    for (double t = 0.0; t <= spec.horizon_s; t += kPath_s) {
      const std::vector<Eigen::Vector2d> positions = positions_at(spec, plan->motion, t);
      const double share = std::clamp(
          demand_now(spec, t, positions) / std::max(1e-6, plan->certificate.robustness_m), 0.0, 1.0);
      path.points.push_back(point(positions[robot]));
      // Its colour where the plan is as robust as it was proven to be; red where it is less.
      auto tint = plan_color(robot);
      tint.r = static_cast<float>(share * static_cast<double>(tint.r) + (1.0 - share));
      tint.g *= static_cast<float>(share);
      tint.b *= static_cast<float>(share);
      path.colors.push_back(tint);
    }
    auto name = marker("stl_plan", static_cast<int>(spec.robots.size() + robot),
                       visualization_msgs::Marker::TEXT_VIEW_FACING, kLabel_m);
    name.pose.position = path.points.front();
    name.pose.position.y -= 0.08;
    name.pose.position.z = 0.02;
    name.color = plan_color(robot);
    name.text = "plan of " + spec.robots[robot].name;
    array.markers.push_back(path);
    array.markers.push_back(name);
  }
  return array;
}

}  // namespace atmos::stl
