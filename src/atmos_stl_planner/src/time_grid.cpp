#include <algorithm>
#include <cmath>

#include "atmos_stl_planner/grid_encoding.h"

namespace atmos::stl {

namespace {

constexpr double kMinGap_s = 0.05;  // nearer knots would make segments with huge coefficients
constexpr double kPastStep_s = 0.25;

void add_ends(const Formula& formula, const std::vector<double>& at, std::vector<double>& ends) {
  ends.insert(ends.end(), at.begin(), at.end());
  std::vector<double> next;
  for (const double t : at) {
    next.push_back(t + formula.from_s);
    next.push_back(t + formula.to_s);
  }
  std::sort(next.begin(), next.end());
  next.erase(std::unique(next.begin(), next.end()), next.end());
  // Deep nesting doubles the ends at every level; beyond this many they no longer make a better grid.
  if (next.size() > 64) return;
  for (const FormulaPtr& child : formula.children) add_ends(*child, next, ends);
}

}  // namespace

std::vector<double> time_grid(const Specification& spec, double step_s, double now_s) {
  std::vector<double> wanted = {0.0, spec.horizon_s};
  if (now_s > 0.0) wanted.push_back(now_s);
  std::vector<double> ends;
  for (const Clause& clause : spec.clauses) add_ends(*clause.formula, {0.0}, ends);
  for (const auto* places : {&spec.regions, &spec.obstacles}) {
    for (const Region& region : *places) {
      for (const Region::PathPoint& point : region.path) ends.push_back(point.time_s);
    }
  }
  std::sort(ends.begin(), ends.end());
  for (const double t : ends) {
    const bool apart = std::all_of(wanted.begin(), wanted.end(),
                                   [t](double other) { return std::abs(t - other) >= kMinGap_s; });
    if (apart && t > 0.0 && t < spec.horizon_s) wanted.push_back(t);
  }
  std::sort(wanted.begin(), wanted.end());
  std::vector<double> knots = {wanted.front()};
  for (std::size_t i = 1; i < wanted.size(); ++i) {
    const double from = wanted[i - 1], to = wanted[i];
    const double step = to <= now_s ? kPastStep_s : step_s;
    const int parts = std::max(1, static_cast<int>(std::ceil((to - from) / step - 1e-9)));
    for (int k = 1; k < parts; ++k) knots.push_back(from + (to - from) * k / parts);
    knots.push_back(to);
  }
  return knots;
}

}  // namespace atmos::stl
