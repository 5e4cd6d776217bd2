#include <algorithm>
#include <cmath>

#include "atmos_stl_planner/grid_encoding.h"

namespace atmos::stl {

double most_possible(const Specification& spec, const Formula& f) {
  const std::vector<Eigen::Vector2d> corners = corners_of(spec.workspace);
  if (f.op == Op::kTrue) return f.negated ? -kUnbounded : kUnbounded;
  if (f.op == Op::kLinear) {
    const double sign = f.negated ? -1.0 : 1.0;
    double value = sign * f.constant;
    for (const LinearTerm& term : f.terms) {
      double largest = -kUnbounded;
      for (const Eigen::Vector2d& corner : corners)
        largest = std::max(largest, sign * term.coefficient * corner[term.axis]);
      value += largest;
    }
    return value;
  }
  const Region& region = spec.regions[static_cast<std::size_t>(f.region)];
  if (!f.negated) return inscribed_disc(region.polytope).radius;
  // A moving region is out of the way at most as far as its path goes.
  double largest = -kUnbounded, moved = 0.0;
  for (const Region::PathPoint& point : region.path) moved = std::max(moved, point.displacement_m.norm());
  for (const Eigen::Vector2d& corner : corners)
    largest = std::max(largest, (region.polytope.normals * corner - region.polytope.offsets).maxCoeff());
  return largest + moved;
}

double least_possible(const Specification& spec, const Formula& predicate) {
  Formula opposite = predicate;
  opposite.negated = !predicate.negated;
  return -most_possible(spec, opposite);
}

namespace {

// The most a formula's robustness can be over all motions inside the workspace.
double most(const Specification& spec, const Formula& f) {
  if (f.children.empty()) return most_possible(spec, f);
  if (f.op == Op::kRelease) return most(spec, *f.children[1]);
  double value = f.op == Op::kOr ? -kUnbounded : kUnbounded;
  for (const FormulaPtr& child : f.children)
    value = f.op == Op::kOr ? std::max(value, most(spec, *child)) : std::min(value, most(spec, *child));
  return value;
}

}  // namespace

double robustness_bound(const Specification& spec, const Scope& scope, const Past* past) {
  std::optional<Checker> flown;
  if (past != nullptr) {
    flown.emplace(spec.regions, past->motion);
    flown->assume_beyond(spec.horizon_s, [&spec](const Formula& f) { return most_possible(spec, f); });
  }
  double bound = kUnbounded;
  for (std::size_t i = 0; i < spec.clauses.size(); ++i) {
    if (!scope.clauses[i]) continue;
    bound = std::min(bound, most(spec, *normal_form(spec.clauses[i].formula)));
    if (flown) bound = std::min(bound, flown->robustness(spec.clauses[i].formula));
  }
  // Without a formula that says how much, more than the workspace is wide means nothing.
  const std::vector<Eigen::Vector2d> corners = corners_of(spec.workspace);
  double width = 0.0;
  for (const Eigen::Vector2d& a : corners) {
    for (const Eigen::Vector2d& b : corners) width = std::max(width, (a - b).norm());
  }
  return std::min(bound, width);
}

}  // namespace atmos::stl
