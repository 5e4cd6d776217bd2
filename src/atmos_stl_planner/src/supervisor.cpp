#include "atmos_stl_planner/supervisor.h"

#include <algorithm>
#include <cmath>

#include "atmos_stl_planner/checker.h"

namespace atmos::stl {

namespace {

constexpr double kRecord_s = 0.1;
constexpr double kReturn_s = 2.0;

}  // namespace

Supervisor::Supervisor(const Specification& specification, Motion plan)
    : spec_(specification), plan_(std::move(plan)) {}

void Supervisor::fly(double time_s, const std::vector<Eigen::Vector2d>& p_WB) {
  bool good = std::isfinite(time_s) && p_WB.size() == spec_.robots.size() && time_s <= spec_.horizon_s;
  for (const Eigen::Vector2d& p : p_WB) good = good && p.allFinite();
  if (!good || time_s < 0.0) return;
  if (times_.empty()) {
    // The first sample stands for the time before it.
    times_.push_back(0.0);
    points_.push_back(p_WB);
  }
  if (time_s < times_.back() + kRecord_s - 1e-6) return;
  times_.push_back(time_s);
  points_.push_back(p_WB);
}

std::optional<double> Supervisor::predicted_m() const {
  if (times_.size() < 2 || times_.back() >= spec_.horizon_s) return std::nullopt;
  std::vector<double> times = times_;
  std::vector<std::vector<Eigen::Vector2d>> points = points_;
  const double now = times.back();
  for (double t = now + kRecord_s; t < spec_.horizon_s; t += kRecord_s) times.push_back(t);
  times.push_back(spec_.horizon_s);
  for (std::size_t k = points.size(); k < times.size(); ++k) {
    const double share = std::max(0.0, 1.0 - (times[k] - now) / kReturn_s);
    std::vector<Eigen::Vector2d> at;
    for (std::size_t robot = 0; robot < spec_.robots.size(); ++robot) {
      const Eigen::Vector2d beside = points_.back()[robot] - plan_.at(robot, now).p_WB;
      at.push_back(plan_.at(robot, times[k]).p_WB + share * beside);
    }
    points.push_back(at);
  }
  const Motion motion = polyline(times, points);
  const Checker checker(spec_.regions, motion);
  double least = std::numeric_limits<double>::infinity();
  for (const Clause& clause : spec_.clauses) least = std::min(least, checker.robustness(clause.formula));
  return least;
}

std::optional<Past> Supervisor::past_at(double time_s) const {
  if (times_.size() < 2 || time_s < times_.back()) return std::nullopt;
  std::vector<double> times = times_;
  std::vector<std::vector<Eigen::Vector2d>> points = points_;
  Past past;
  const auto add = [&](double t) {
    std::vector<Eigen::Vector2d> at;
    for (std::size_t robot = 0; robot < spec_.robots.size(); ++robot)
      at.push_back(points_.back()[robot] + plan_.at(robot, t).p_WB - plan_.at(robot, times_.back()).p_WB);
    times.push_back(t);
    points.push_back(at);
  };
  for (double t = times_.back() + kRecord_s; t < time_s - 1e-6; t += kRecord_s) add(t);
  if (time_s > times.back() + 1e-6) {
    add(time_s);
  } else {
    times.back() = time_s;
  }
  for (std::size_t robot = 0; robot < spec_.robots.size(); ++robot)
    past.v_WB.push_back(plan_.at(robot, time_s).v_WB);
  past.motion = polyline(times, points);
  return past;
}

}  // namespace atmos::stl
