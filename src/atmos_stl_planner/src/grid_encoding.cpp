#include "atmos_stl_planner/grid_encoding.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace atmos::stl {

namespace {

constexpr double kTime = 1e-9;  // s, two times this near are one

// A stretch of the grid on which a formula is asked for: from one knot to the next, or one knot alone.
struct Slot {
  std::size_t from, to;
};

using Point = std::array<LinearExpression, 2>;

LinearExpression constant(double value) { return {{}, value}; }
LinearExpression column(int index) { return {{{index, 1.0}}, 0.0}; }
const LinearExpression kOne = constant(1.0);

}  // namespace

Scope Scope::all(const Specification& specification) {
  Scope scope;
  scope.clauses.assign(specification.clauses.size(), true);
  scope.ends.assign(specification.robots.size(), true);
  return scope;
}

struct GridEncoding::Impl {
  const GridProblem problem;
  const Specification& spec;
  const std::vector<double>& knots;
  std::size_t now = 0;  // knot at which the past ends
  double least, most;   // robustness
  MilpModel model;
  int robustness = 0;
  std::optional<Checker> past;
  std::vector<Eigen::Vector2d> corners;  // of the workspace
  // Per planned robot and knot from `now` on: columns of x, y, vx, vy.
  std::map<std::size_t, std::vector<std::array<int, 4>>> states;
  std::vector<std::array<LinearExpression, 2>>
      accelerations;  // at both ends of a segment, over the limit, per axis
  std::vector<std::vector<int>> visits;
  struct VisitTimes {
    std::vector<int> columns;
    std::vector<double> margins_s;
  };
  std::vector<VisitTimes> visit_times;
  bool outermost = true;

  Impl(const GridProblem& from, double least_m, double most_m)
      : problem(from),
        spec(*from.specification),
        knots(problem.knots),
        least(least_m),
        most(most_m),
        corners(corners_of(spec.workspace)) {
    robustness = model.add_column(least, most);
    if (problem.past != nullptr) {
      const double end = problem.past->motion.end_s();
      while (now + 1 < knots.size() && knots[now] < end - kTime) ++now;
      past.emplace(spec.regions, problem.past->motion);
    }
    for (std::size_t robot = 0; robot < spec.robots.size(); ++robot) {
      if (problem.planned[robot]) add_robot(robot);
    }
    for (std::size_t i = 0; i < spec.clauses.size(); ++i) {
      if (problem.scope.clauses[i]) imply(kOne, *normal_form(spec.clauses[i].formula), {0, 0}, true);
    }
    if (problem.scope.separation) add_separation();
    if (problem.scope.obstacles) add_obstacles();
  }

  double length(std::size_t segment) const { return knots[segment + 1] - knots[segment]; }
  bool exists(std::size_t robot) const { return problem.planned[robot] || problem.fixed.count(robot) != 0; }

  // ---- motion ----

  void add_robot(std::size_t robot) {
    const Robot& of = spec.robots[robot];
    const double v_max =
        problem.scope.velocity ? problem.scope.velocity_factor * of.max_velocity_m_s : kUnbounded;
    Eigen::Vector2d low = corners[0], high = corners[0];
    for (const Eigen::Vector2d& corner : corners) {
      low = low.cwiseMin(corner);
      high = high.cwiseMax(corner);
    }
    auto& columns = states[robot];
    for (std::size_t k = now; k < knots.size(); ++k) {
      std::array<int, 4> state{};
      for (int axis = 0; axis < 2; ++axis) {
        double p_low = low[axis], p_high = high[axis], v_low = -v_max, v_high = v_max;
        if (k == now) {
          p_low = p_high = start(robot).p_WB[axis];
          v_low = v_high = start(robot).v_WB[axis];
        } else if (k + 1 == knots.size()) {
          v_low = v_high = 0.0;
          if (of.end && problem.scope.ends[robot]) p_low = p_high = of.end->p_WB[axis];
        }
        state[static_cast<std::size_t>(axis)] = model.add_column(p_low, p_high);
        state[static_cast<std::size_t>(axis) + 2] = model.add_column(v_low, v_high);
      }
      columns.push_back(state);
    }
    for (std::size_t k = now; k + 1 < knots.size(); ++k) {
      for (std::size_t i = 1; i < 4; ++i) add_inside(robot, k, i);
      for (int axis = 0; axis < 2; ++axis) add_limits(robot, k, axis, v_max);
    }
  }

  MotionState start(std::size_t robot) const {
    if (problem.past == nullptr)
      return {spec.robots[robot].start.p_WB, Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero()};
    MotionState state = problem.past->motion.at(robot, problem.past->motion.end_s());
    state.v_WB = problem.past->v_WB[robot];
    return state;
  }

  // Control point i of 0..3 on the segment after knot k.
  Point control(std::size_t robot, std::size_t k, std::size_t i) const {
    const auto fixed = problem.fixed.find(robot);
    if (fixed != problem.fixed.end()) {
      // Counted from the end: before now_s a motion has the segments that were flown.
      const std::vector<Segment>& segments = fixed->second->segments();
      const Eigen::Matrix2Xd& r = segments[segments.size() - (knots.size() - 1 - k)].position[robot];
      return {constant(r(0, static_cast<Eigen::Index>(i))), constant(r(1, static_cast<Eigen::Index>(i)))};
    }
    const auto& columns = states.at(robot);
    const std::array<int, 4>& state = columns[k - now + (i < 2 ? 0 : 1)];
    const double arm = i == 1 ? length(k) / 3.0 : i == 2 ? -length(k) / 3.0 : 0.0;
    Point point;
    for (std::size_t axis = 0; axis < 2; ++axis) {
      point[axis] = column(state[axis]);
      if (arm != 0.0) point[axis].add(column(state[axis + 2]), arm);
    }
    return point;
  }

  // The points that a slot's curve lies in the hull of; of a knot, the knot.
  std::vector<Point> hull(std::size_t robot, Slot slot) const {
    if (slot.from == slot.to)
      return {slot.from + 1 < knots.size() ? control(robot, slot.from, 0) : control(robot, slot.from - 1, 3)};
    std::vector<Point> points;
    for (std::size_t i = 0; i < 4; ++i) points.push_back(control(robot, slot.from, i));
    return points;
  }

  void add_inside(std::size_t robot, std::size_t k, std::size_t i) {
    if (k + 2 == knots.size() && i == 3 && problem.scope.ends[robot] && spec.robots[robot].end) return;
    const Point point = control(robot, k, i);
    for (Eigen::Index side = 0; side < spec.workspace.offsets.size(); ++side) {
      LinearExpression beyond;
      beyond.add(point[0], spec.workspace.normals(side, 0)).add(point[1], spec.workspace.normals(side, 1));
      model.add_row(-kUnbounded, beyond, spec.workspace.offsets[side]);
    }
  }

  void add_limits(std::size_t robot, std::size_t k, int axis, double v_max) {
    const auto a = static_cast<std::size_t>(axis);
    const double t = length(k);
    const Point b0 = control(robot, k, 0), b1 = control(robot, k, 1), b2 = control(robot, k, 2),
                b3 = control(robot, k, 3);
    LinearExpression v;
    v.add(b2[a], 3.0 / t).add(b1[a], -3.0 / t);
    if (v_max < kUnbounded) model.add_row(-v_max, v, v_max);
    // A cubic's acceleration is linear in time: its ends bound it.
    const double a_max = problem.scope.acceleration_factor * spec.robots[robot].max_acceleration_m_s2;
    const double scale = 6.0 / (t * t) / a_max;
    std::array<LinearExpression, 2> ends;
    ends[0].add(b2[a], scale).add(b1[a], -2.0 * scale).add(b0[a], scale);
    ends[1].add(b3[a], scale).add(b2[a], -2.0 * scale).add(b1[a], scale);
    if (problem.scope.acceleration) {
      for (const LinearExpression& end : ends) model.add_row(-1.0, end, 1.0);
    }
    accelerations.push_back(ends);
    acceleration_lengths.push_back(t);
  }
  std::vector<double> acceleration_lengths;

  // ---- logic ----

  // literal -> expression >= 0, where the expression is known to stay above -reach.
  void imply_nonnegative(const LinearExpression& literal, LinearExpression expression, double reach) {
    if (expression.is_constant()) {
      if (expression.constant < -1e-9) forbid(literal);
      return;
    }
    if (literal.is_constant()) {
      if (literal.constant < 0.5) return;
    } else {
      if (reach <= 0.0) return;
      expression.add(literal, -reach);
      expression.constant += reach;
    }
    model.add_row(0.0, expression, kUnbounded);
  }

  void forbid(const LinearExpression& literal) { model.add_row(-kUnbounded, literal, 0.0); }

  // Literals of which exactly one is true if `literal` is, and none if not.
  std::vector<LinearExpression> choose(std::size_t n, const LinearExpression& literal,
                                       std::vector<int>* columns = nullptr) {
    if (n == 1) return {literal};
    std::vector<LinearExpression> options;
    LinearExpression balance;
    balance.add(literal, -1.0);
    for (std::size_t i = 0; i < n; ++i) {
      const int binary = model.add_binary();
      options.push_back(column(binary));
      balance.add(options.back());
      if (columns != nullptr) columns->push_back(binary);
    }
    model.add_row(0.0, balance, 0.0);
    return options;
  }

  bool is_past(Slot slot) const { return past && slot.to <= now; }

  void imply(const LinearExpression& literal, const Formula& f, Slot slot, bool top = false) {
    if (literal.is_constant() && literal.constant < 0.5) return;
    const double begin = knots[slot.from], end = knots[slot.to];
    switch (f.op) {
      case Op::kTrue:
        if (f.negated) forbid(literal);
        return;
      case Op::kIn:
      case Op::kLinear:
        return imply_predicate(literal, f, slot);
      case Op::kAnd:
        for (const FormulaPtr& child : f.children) imply(literal, *child, slot, top);
        return;
      case Op::kOr: {
        const auto options = choose(f.children.size(), literal);
        for (std::size_t i = 0; i < options.size(); ++i) imply(options[i], *f.children[i], slot);
        return;
      }
      case Op::kAlways:
        for (const Slot& part : covering(begin + f.from_s, end + f.to_s))
          imply(literal, *f.children[0], part);
        return;
      case Op::kEventually:
        return imply_eventually(literal, f, slot, top);
      case Op::kUntil:
        return imply_until(literal, f, slot);
      case Op::kRelease:
        return imply_release(literal, f, slot);
      case Op::kNot:
        return;
    }
  }

  // Knots between two times, both included.
  std::vector<std::size_t> knots_in(double from, double to) const {
    std::vector<std::size_t> found;
    for (std::size_t k = 0; k < knots.size(); ++k) {
      if (knots[k] >= from - kTime && knots[k] <= to + kTime) found.push_back(k);
    }
    return found;
  }

  // Slots that together cover the times from one to the other.
  std::vector<Slot> covering(double from, double to) const {
    std::vector<Slot> slots;
    if (to - from <= kTime) {
      const std::vector<std::size_t> at = knots_in(from, from);
      if (!at.empty()) return {{at[0], at[0]}};
    }
    for (std::size_t k = 0; k + 1 < knots.size(); ++k) {
      if (knots[k + 1] > from + kTime && knots[k] < to - kTime) slots.push_back({k, k + 1});
    }
    if (slots.empty()) {
      for (std::size_t k = 0; k + 1 < knots.size() && slots.empty(); ++k) {
        if (knots[k] <= from && from <= knots[k + 1]) slots.push_back({k, k + 1});
      }
    }
    return slots;
  }

  // One witness must serve every time of the slot: a knot within all their windows, else a whole segment that
  // meets all of them, else the window's begin, moving along.
  void imply_eventually(const LinearExpression& literal, const Formula& f, Slot slot, bool top) {
    const double begin = knots[slot.from], end = knots[slot.to];
    std::vector<Slot> witnesses;
    for (const std::size_t k : knots_in(end + f.from_s, begin + f.to_s)) witnesses.push_back({k, k});
    if (witnesses.empty()) {
      for (std::size_t k = 0; k + 1 < knots.size(); ++k) {
        if (knots[k + 1] >= end + f.from_s - kTime && knots[k] <= begin + f.to_s + kTime)
          witnesses.push_back({k, k + 1});
      }
    }
    if (witnesses.empty()) {
      for (const Slot& part : covering(begin + f.from_s, end + f.from_s))
        imply(literal, *f.children[0], part);
      return;
    }
    std::vector<int> columns;
    const auto options = choose(witnesses.size(), literal, &columns);
    for (std::size_t i = 0; i < options.size(); ++i) imply(options[i], *f.children[0], witnesses[i]);
    if (!top || columns.empty()) return;
    visits.push_back(columns);
    VisitTimes times{columns, {}};
    for (const Slot& witness : witnesses)
      times.margins_s.push_back(std::min(knots[witness.from] - f.from_s, f.to_s - knots[witness.to]));
    visit_times.push_back(times);
  }

  void imply_until(const LinearExpression& literal, const Formula& f, Slot slot) {
    const double begin = knots[slot.from], end = knots[slot.to];
    const std::vector<std::size_t> witnesses = knots_in(end + f.from_s, begin + f.to_s);
    if (witnesses.empty()) {
      for (const Slot& part : covering(begin, end + f.from_s)) imply(literal, *f.children[0], part);
      for (const Slot& part : covering(begin + f.from_s, end + f.from_s))
        imply(literal, *f.children[1], part);
      return;
    }
    const auto options = choose(witnesses.size(), literal);
    for (std::size_t i = 0; i < options.size(); ++i)
      imply(options[i], *f.children[1], {witnesses[i], witnesses[i]});
    const std::size_t last = witnesses.back();
    if (last == slot.from) return imply(literal, *f.children[0], slot);
    for (std::size_t k = slot.from; k < last; ++k) {
      LinearExpression later;
      bool all = true;
      for (std::size_t i = 0; i < options.size(); ++i) {
        if (witnesses[i] > k) {
          later.add(options[i]);
        } else {
          all = false;
        }
      }
      imply(all ? literal : later, *f.children[0], {k, k + 1});
    }
    // A witness at the very first time still needs the first part there.
    if (slot.from == slot.to && witnesses.front() == slot.from) imply(options.front(), *f.children[0], slot);
  }

  // Either the first part comes true at some knot and ends the duty, or the duty lasts for the whole window.
  void imply_release(const LinearExpression& literal, const Formula& f, Slot slot) {
    const double begin = knots[slot.from], end = knots[slot.to];
    const std::vector<std::size_t> ends = knots_in(end, begin + f.to_s);
    const auto options = choose(ends.size() + 1, literal);  // the last one: the whole window
    for (std::size_t i = 0; i < ends.size(); ++i) imply(options[i], *f.children[0], {ends[i], ends[i]});
    for (const Slot& part : covering(begin + f.from_s, end + f.to_s)) {
      LinearExpression bound = options.back();
      for (std::size_t i = 0; i < ends.size(); ++i) {
        if (ends[i] > part.from) bound.add(options[i]);
      }
      imply(bound, *f.children[1], part);
    }
  }

  // ---- predicates ----

  void imply_predicate(const LinearExpression& literal, const Formula& f, Slot slot) {
    if (is_past(slot)) {
      const IntervalSet truth = past->truth(f, least);
      const Interval* part = truth.part_at(knots[slot.from]);
      if (part == nullptr || part->to < std::min(knots[slot.to], problem.past->motion.end_s()) - kTime)
        forbid(literal);
      return;
    }
    if (f.op == Op::kLinear) return imply_linear(literal, f, slot);
    const auto robot = static_cast<std::size_t>(f.robot);
    if (!exists(robot)) return;
    const Region& region = spec.regions[static_cast<std::size_t>(f.region)];
    const LinearExpression rho = column(robustness);
    if (f.negated) return imply_outside(literal, robot, region, slot, rho, most);
    for (Eigen::Index side = 0; side < region.polytope.offsets.size(); ++side)
      imply_side(literal, robot, region, side, 1.0, slot, rho, most);
  }

  void imply_outside(const LinearExpression& literal, std::size_t robot, const Region& region, Slot slot,
                     const LinearExpression& margin, double largest_margin) {
    // A side beyond which there is not enough room is no option.
    std::vector<Eigen::Index> sides;
    for (Eigen::Index side = 0; side < region.polytope.offsets.size(); ++side) {
      double room = -kUnbounded;
      for (const Eigen::Vector2d& corner : corners)
        room = std::max(room, region.polytope.normals.row(side).dot(corner) - region.polytope.offsets[side]);
      const double least_margin = margin.is_constant() ? margin.constant : least;
      if (!region.path.empty() || room >= least_margin) sides.push_back(side);
    }
    if (sides.empty()) return forbid(literal);
    const auto options = choose(sides.size(), literal);
    for (std::size_t i = 0; i < sides.size(); ++i)
      imply_side(options[i], robot, region, sides[i], -1.0, slot, margin, largest_margin);
  }

  // literal -> sign (offset + normal' displacement - normal' p) >= margin on the slot.
  void imply_side(const LinearExpression& literal, std::size_t robot, const Region& region, Eigen::Index side,
                  double sign, Slot slot, const LinearExpression& margin, double largest_margin) {
    const Eigen::Vector2d normal = region.polytope.normals.row(side).transpose();
    const std::vector<Point> points = hull(robot, slot);
    const std::vector<double> moved = displacements(region, sign * normal, slot, points.size());
    double lowest = kUnbounded;
    for (const Eigen::Vector2d& corner : corners) lowest = std::min(lowest, -sign * normal.dot(corner));
    for (std::size_t i = 0; i < points.size(); ++i) {
      LinearExpression inside = constant(sign * region.polytope.offsets[side] + moved[i]);
      const double reach = -(inside.constant + lowest - largest_margin);
      inside.add(points[i][0], -sign * normal.x()).add(points[i][1], -sign * normal.y()).add(margin, -1.0);
      imply_nonnegative(literal, inside, reach);
    }
  }

  // direction' displacement for each control point of a slot: exact while the path is straight, else the
  // least.
  std::vector<double> displacements(const Region& region, const Eigen::Vector2d& direction, Slot slot,
                                    std::size_t points) const {
    const double from = knots[slot.from], to = knots[slot.to];
    const double a = direction.dot(region.displacement(from)), b = direction.dot(region.displacement(to));
    std::vector<double> result;
    for (std::size_t i = 0; i < points; ++i) {
      const double share = points == 1 ? 0.0 : static_cast<double>(i) / static_cast<double>(points - 1);
      result.push_back((1.0 - share) * a + share * b);
    }
    for (const Region::PathPoint& bend : region.path) {
      if (!(bend.time_s > from + kTime && bend.time_s < to - kTime)) continue;
      double least_moved = std::min(a, b);
      for (const Region::PathPoint& point : region.path) {
        if (point.time_s > from && point.time_s < to)
          least_moved = std::min(least_moved, direction.dot(point.displacement_m));
      }
      return std::vector<double>(points, least_moved);
    }
    return result;
  }

  void imply_linear(const LinearExpression& literal, const Formula& f, Slot slot) {
    const double sign = f.negated ? -1.0 : 1.0;
    const std::size_t points = slot.from == slot.to ? 1 : 4;
    std::vector<LinearExpression> values(points, constant(sign * f.constant));
    double lowest = sign * f.constant;
    for (const LinearTerm& term : f.terms) {
      const auto robot = static_cast<std::size_t>(term.robot);
      if (!exists(robot)) return;
      const std::vector<Point> hull_of_robot = hull(robot, slot);
      double least_term = kUnbounded;
      for (const Eigen::Vector2d& corner : corners)
        least_term = std::min(least_term, sign * term.coefficient * corner[term.axis]);
      lowest += least_term;
      for (std::size_t i = 0; i < points; ++i)
        values[i].add(hull_of_robot[i][static_cast<std::size_t>(term.axis)], sign * term.coefficient);
    }
    for (LinearExpression& value : values) {
      value.add(column(robustness), -1.0);
      imply_nonnegative(literal, value, most - lowest);
    }
  }

  // ---- what is asked without a formula ----

  void add_obstacles() {
    for (std::size_t robot = 0; robot < spec.robots.size(); ++robot) {
      if (!problem.planned[robot]) continue;
      const double radius = spec.robots[robot].radius_m;
      for (const Region& obstacle : spec.obstacles) {
        for (std::size_t k = now; k + 1 < knots.size(); ++k)
          imply_outside(kOne, robot, obstacle, {k, k + 1}, constant(radius), radius);
      }
    }
  }

  // On every segment one direction in which the robots stay apart. On a common grid the difference of two
  // curves is a curve again.
  void add_separation() {
    Eigen::Vector2d extent = Eigen::Vector2d::Zero();
    for (const Eigen::Vector2d& a : corners) {
      for (const Eigen::Vector2d& b : corners) extent = extent.cwiseMax((a - b).cwiseAbs());
    }
    for (std::size_t i = 0; i < spec.robots.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        if (!exists(i) || !exists(j) || (!problem.planned[i] && !problem.planned[j])) continue;
        const double distance = spec.min_distance(i, j);
        for (std::size_t k = now; k + 1 < knots.size(); ++k) {
          const auto options = choose(4, kOne);
          for (std::size_t d = 0; d < 4; ++d) {
            const std::size_t axis = d / 2;
            const double sign = d % 2 == 0 ? 1.0 : -1.0;
            for (std::size_t point = 0; point < 4; ++point) {
              LinearExpression apart = constant(-distance);
              apart.add(control(i, k, point)[axis], sign).add(control(j, k, point)[axis], -sign);
              imply_nonnegative(options[d], apart, distance + extent[static_cast<Eigen::Index>(axis)]);
            }
          }
        }
      }
    }
  }
};

GridEncoding::GridEncoding(const GridProblem& problem, double least_robustness_m, double most_robustness_m)
    : impl_(new Impl(problem, least_robustness_m, most_robustness_m)) {}
GridEncoding::~GridEncoding() = default;
GridEncoding::GridEncoding(GridEncoding&&) noexcept = default;

const MilpModel& GridEncoding::model() const { return impl_->model; }
int GridEncoding::robustness_column() const { return impl_->robustness; }
const std::vector<std::vector<int>>& GridEncoding::visits() const { return impl_->visits; }

void GridEncoding::add_smoothness() {
  // |a| / a_max in pieces of growing price: the slopes of its square.
  constexpr std::array<double, 8> kEnds = {0.0, 0.05, 0.12, 0.22, 0.36, 0.54, 0.76, 1.0};
  MilpModel& model = impl_->model;
  for (std::size_t i = 0; i < impl_->accelerations.size(); ++i) {
    for (const LinearExpression& acceleration : impl_->accelerations[i]) {
      LinearExpression balance;
      balance.add(acceleration, -1.0);
      for (std::size_t piece = 0; piece + 1 < kEnds.size(); ++piece) {
        const double price = impl_->acceleration_lengths[i] * (kEnds[piece] + kEnds[piece + 1]);
        const bool last = piece + 2 == kEnds.size();
        const double size = last ? kUnbounded : kEnds[piece + 1] - kEnds[piece];
        balance.add(column(model.add_column(0.0, size, price)));
        balance.add(column(model.add_column(0.0, size, price)), -1.0);
      }
      model.add_row(0.0, balance, 0.0);
    }
  }
}

int GridEncoding::add_time_robustness() {
  double most = impl_->spec.horizon_s;
  const int theta = impl_->model.add_column(0.0, most);
  for (const Impl::VisitTimes& visit : impl_->visit_times) {
    LinearExpression margin;
    for (std::size_t i = 0; i < visit.columns.size(); ++i)
      margin.add(column(visit.columns[i]), visit.margins_s[i]);
    margin.add(column(theta), -1.0);
    impl_->model.add_row(0.0, margin, kUnbounded);
  }
  return theta;
}

Motion GridEncoding::motion(const std::vector<double>& x) const {
  const Impl& of = *impl_;
  std::vector<Segment> segments;
  if (of.problem.past != nullptr) {
    segments = of.problem.past->motion.segments();
    // The past ends exactly at its knot.
    Eigen::VectorXd& last = segments.back().time;
    last[last.size() - 1] = of.knots[of.now];
  }
  for (std::size_t k = of.now; k + 1 < of.knots.size(); ++k) {
    Segment segment;
    segment.time = Eigen::Vector2d(of.knots[k], of.knots[k + 1]);
    for (std::size_t robot = 0; robot < of.spec.robots.size(); ++robot) {
      Eigen::Matrix2Xd r = Eigen::Matrix2Xd::Zero(2, 4);
      if (of.exists(robot)) {
        for (std::size_t i = 0; i < 4; ++i) {
          const Point point = of.control(robot, k, i);
          for (std::size_t axis = 0; axis < 2; ++axis) {
            double value = point[axis].constant;
            for (const auto& [index, coefficient] : point[axis].terms)
              value += coefficient * x[static_cast<std::size_t>(index)];
            r(static_cast<Eigen::Index>(axis), static_cast<Eigen::Index>(i)) = value;
          }
        }
      }
      segment.position.push_back(r);
    }
    segments.push_back(segment);
  }
  return Motion(std::move(segments));
}

}  // namespace atmos::stl
