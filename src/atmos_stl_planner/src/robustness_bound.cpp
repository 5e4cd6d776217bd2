#include <algorithm>
#include <cmath>

#include "atmos_stl_planner/grid_encoding.h"

namespace atmos::stl {

namespace {

// Bounds of a formula's robustness over all motions inside the workspace.
double most(const Specification& spec, const std::vector<Eigen::Vector2d>& corners, const Formula& f) {
  const auto child = [&](std::size_t i) { return most(spec, corners, *f.children[i]); };
  switch (f.op) {
    case Op::kTrue:
      return f.negated ? -kUnbounded : kUnbounded;
    case Op::kIn: {
      const Region& region = spec.regions[static_cast<std::size_t>(f.region)];
      if (!f.negated) return inscribed_disc(region.polytope).radius;
      if (!region.path.empty()) return kUnbounded;
      double largest = -kUnbounded;
      for (const Eigen::Vector2d& corner : corners)
        largest = std::max(largest, (region.polytope.normals * corner - region.polytope.offsets).maxCoeff());
      return largest;
    }
    case Op::kLinear: {
      double value = f.constant * (f.negated ? -1.0 : 1.0);
      for (const LinearTerm& term : f.terms) {
        double largest = -kUnbounded;
        const double coefficient = term.coefficient * (f.negated ? -1.0 : 1.0);
        for (const Eigen::Vector2d& corner : corners)
          largest = std::max(largest, coefficient * corner[term.axis]);
        value += largest;
      }
      return value;
    }
    case Op::kOr: {
      double largest = -kUnbounded;
      for (std::size_t i = 0; i < f.children.size(); ++i) largest = std::max(largest, child(i));
      return largest;
    }
    case Op::kRelease:
      return child(1);
    default: {
      double least = kUnbounded;
      for (std::size_t i = 0; i < f.children.size(); ++i) least = std::min(least, child(i));
      return least;
    }
  }
}

}  // namespace

double robustness_bound(const Specification& spec, const Scope& scope) {
  const std::vector<Eigen::Vector2d> corners = corners_of(spec.workspace);
  double bound = kUnbounded;
  for (std::size_t i = 0; i < spec.clauses.size(); ++i) {
    if (scope.clauses[i]) bound = std::min(bound, most(spec, corners, *normal_form(spec.clauses[i].formula)));
  }
  // Without a formula that says how much, more than the workspace is wide means nothing.
  double width = 0.0;
  for (const Eigen::Vector2d& a : corners) {
    for (const Eigen::Vector2d& b : corners) width = std::max(width, (a - b).norm());
  }
  return std::min(bound, width);
}

}  // namespace atmos::stl
