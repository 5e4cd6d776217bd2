#include "atmos_stl_planner/checker.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "atmos_stl_planner/bernstein.h"

namespace atmos::stl {

namespace {

constexpr double kResolution_m = 1e-8;
// Apart from the value by this much, the set of times around the one that decides has an extent.
constexpr double kNudge_m = 1e-6;

using bernstein::Coefficients;

std::vector<double> path_times(const std::vector<Region>& regions) {
  std::vector<double> times;
  for (const Region& region : regions) {
    for (const Region::PathPoint& point : region.path) times.push_back(point.time_s);
  }
  return times;
}

// A coordinate of a region's displacement over a segment within which its path is straight.
Coefficients displacement(const Region& region, const Coefficients& h, int axis) {
  if (region.path.empty()) return Coefficients::Zero(1);
  const double from = h[0], to = h[h.size() - 1];
  const double a = region.displacement(from)[axis], b = region.displacement(to)[axis];
  return (a + (h.array() - from) / (to - from) * (b - a)).matrix();
}

// A polynomial and its bounds, which decide most questions by themselves.
struct Bounded {
  explicit Bounded(Coefficients coefficients)
      : c(std::move(coefficients)), low(c.minCoeff()), high(c.maxCoeff()) {}

  // Where sign * c >= level.
  IntervalSet at_least(double sign, double level) const {
    const double least = sign > 0.0 ? low : -high, most = sign > 0.0 ? high : -low;
    if (least >= level) return {0.0, 1.0};
    if (most < level) return {};
    return bernstein::nonnegative(sign * c.array() - level);
  }

  Coefficients c;
  double low, high;
};

}  // namespace

struct Checker::Impl {
  std::vector<Region> regions;
  Motion motion;
  // Per robot and region: per segment, the distance to each side, positive inside.
  mutable std::map<std::pair<int, int>, std::vector<std::vector<Bounded>>> margins;
  double scale = 1.0;  // no distance to a region's side is larger
  double until_s = 0.0;
  std::function<double(const Formula&)> beyond;

  const std::vector<std::vector<Bounded>>& margins_of(int robot, int region) const {
    auto& cached = margins[{robot, region}];
    if (!cached.empty()) return cached;
    const Region& place = regions[static_cast<std::size_t>(region)];
    for (const Segment& segment : motion.segments()) {
      const Eigen::Matrix2Xd& r = segment.position[static_cast<std::size_t>(robot)];
      const Coefficients x = bernstein::sum(r.row(0).transpose(), -displacement(place, segment.time, 0));
      const Coefficients y = bernstein::sum(r.row(1).transpose(), -displacement(place, segment.time, 1));
      std::vector<Bounded> sides;
      for (Eigen::Index k = 0; k < place.polytope.offsets.size(); ++k) {
        const double nx = place.polytope.normals(k, 0), ny = place.polytope.normals(k, 1);
        sides.emplace_back(bernstein::sum(Coefficients::Constant(1, place.polytope.offsets[k]),
                                          bernstein::sum(-nx * x, -ny * y)));
      }
      cached.push_back(std::move(sides));
    }
    return cached;
  }

  // Maps a set of s in a segment to times and appends it.
  static void append_times(const Segment& segment, const IntervalSet& set, IntervalSet& times) {
    const Eigen::VectorXd& h = segment.time;
    const auto time = [&h](double s) {
      return s <= 0.0 ? h[0] : s >= 1.0 ? h[h.size() - 1] : bernstein::value(h, s);
    };
    for (const Interval& part : set.parts()) times.append(time(part.from), time(part.to));
  }

  IntervalSet membership(const Formula& formula, double level) const {
    const auto& segments = motion.segments();
    const auto& all = margins_of(formula.robot, formula.region);
    IntervalSet times;
    for (std::size_t k = 0; k < segments.size(); ++k) {
      IntervalSet set = formula.negated ? IntervalSet() : IntervalSet(0.0, 1.0);
      for (const Bounded& margin : all[k]) {
        set = formula.negated ? united(set, margin.at_least(-1.0, level))
                              : intersected(set, margin.at_least(1.0, level));
      }
      append_times(segments[k], set, times);
    }
    return times;
  }

  Coefficients linear(const Formula& formula, const Segment& segment) const {
    Coefficients value = Coefficients::Constant(1, formula.constant);
    for (const LinearTerm& term : formula.terms)
      value = bernstein::sum(
          value, term.coefficient *
                     segment.position[static_cast<std::size_t>(term.robot)].row(term.axis).transpose());
    return formula.negated ? -value : value;
  }

  // No predicate of the formula has a finite value that is larger.
  double scale_of(const Formula& formula) const {
    double largest = scale;
    for (const FormulaPtr& child : formula.children) largest = std::max(largest, scale_of(*child));
    if (beyond && formula.children.empty() && std::isfinite(beyond(formula)))
      largest = std::max(largest, std::abs(beyond(formula)));
    if (formula.op != Op::kLinear) return largest;
    for (const Segment& segment : motion.segments())
      largest = std::max(largest, linear(formula, segment).cwiseAbs().maxCoeff());
    return largest;
  }
};

Checker::Checker(const std::vector<Region>& regions, const Motion& motion) : impl_(new Impl) {
  impl_->regions = regions;
  impl_->motion = motion.cut_at(path_times(regions));
  double reach = 0.0;
  for (const Segment& segment : motion.segments()) {
    for (const Eigen::Matrix2Xd& r : segment.position) reach = std::max(reach, r.cwiseAbs().maxCoeff());
  }
  for (const Region& region : regions) {
    double moved = 0.0;
    for (const Region::PathPoint& point : region.path)
      moved = std::max(moved, point.displacement_m.cwiseAbs().maxCoeff());
    impl_->scale =
        std::max(impl_->scale, 2.0 * (reach + moved) + region.polytope.offsets.cwiseAbs().maxCoeff());
  }
}

Checker::~Checker() = default;
Checker::Checker(Checker&&) noexcept = default;

void Checker::assume_beyond(double until_s, std::function<double(const Formula&)> value) {
  impl_->until_s = until_s;
  impl_->beyond = std::move(value);
}

IntervalSet Checker::truth(const Formula& formula, double level) const {
  const double from = impl_->motion.start_s(), end = impl_->motion.end_s(),
               to = std::max(end, impl_->until_s);
  const auto child = [&](std::size_t i) { return truth(*formula.children[i], level); };
  switch (formula.op) {
    case Op::kTrue:
      return formula.negated ? IntervalSet() : IntervalSet(from, to);
    case Op::kIn: {
      IntervalSet times = impl_->membership(formula, level);
      if (to > end && impl_->beyond(formula) >= level) times.append(end, to);
      return times;
    }
    case Op::kLinear: {
      IntervalSet times;
      for (const Segment& segment : impl_->motion.segments())
        Impl::append_times(segment, bernstein::nonnegative(impl_->linear(formula, segment).array() - level),
                           times);
      if (to > end && impl_->beyond(formula) >= level) times.append(end, to);
      return times;
    }
    case Op::kAnd: {
      IntervalSet set(from, to);
      for (std::size_t i = 0; i < formula.children.size(); ++i) set = intersected(set, child(i));
      return set;
    }
    case Op::kOr: {
      IntervalSet set;
      for (std::size_t i = 0; i < formula.children.size(); ++i) set = united(set, child(i));
      return set;
    }
    case Op::kEventually:
      return intersected(eventually(child(0), formula.from_s, formula.to_s), {from, to});
    case Op::kAlways:
      return intersected(always(child(0), formula.from_s, formula.to_s), {from, to});
    case Op::kUntil:
      return until(child(0), child(1), formula.from_s, formula.to_s);
    case Op::kRelease:
      return release(child(0), child(1), formula.from_s, formula.to_s, from, to);
    case Op::kNot:
      break;
  }
  return {};
}

double Checker::robustness(const FormulaPtr& formula, double time_s) const {
  const FormulaPtr normal = normal_form(formula);
  double high = impl_->scale_of(*normal) + 1.0, low = -high;
  if (truth(*normal, high).contains(time_s)) return std::numeric_limits<double>::infinity();
  if (!truth(*normal, low).contains(time_s)) return -std::numeric_limits<double>::infinity();
  while (high - low > kResolution_m) {
    const double middle = 0.5 * (low + high);
    (truth(*normal, middle).contains(time_s) ? low : high) = middle;
  }
  return low;
}

double Checker::critical_time(const FormulaPtr& formula, double time_s) const {
  const FormulaPtr normal = normal_form(formula);
  const double value = robustness(normal, time_s);
  if (!std::isfinite(value)) return time_s;
  const Formula* node = normal.get();
  double time = time_s;
  for (;;) {
    const double from = time + node->from_s, to = time + node->to_s;
    const auto middle = [](const IntervalSet& set, double fallback) {
      return set.empty() ? fallback : 0.5 * (set.parts().front().from + set.parts().front().to);
    };
    switch (node->op) {
      case Op::kAnd:
      case Op::kOr: {
        const bool both = node->op == Op::kAnd;
        const Formula* next = node->children.front().get();
        for (const FormulaPtr& child : node->children) {
          const bool holds = truth(*child, both ? value + kNudge_m : value - kNudge_m).contains(time);
          if (holds != both) {
            next = child.get();
            break;
          }
        }
        node = next;
        break;
      }
      case Op::kEventually:
        time = middle(intersected(truth(*node->children[0], value - kNudge_m), {from, to}), from);
        node = node->children[0].get();
        break;
      case Op::kAlways:
        time = middle(complement(truth(*node->children[0], value + kNudge_m), from, to), from);
        node = node->children[0].get();
        break;
      case Op::kUntil:
        return middle(intersected(truth(*node->children[1], value - kNudge_m), {from, to}), from);
      default:
        return time;
    }
  }
}

}  // namespace atmos::stl
