#include "atmos_stl_planner/free_time.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "atmos_stl_planner/grid_encoding.h"

namespace atmos::stl {

namespace {

constexpr int kDegree = 3;
constexpr double kLeastRate_s = 0.2;    // of h', so that time always passes
constexpr double kResolution_m = 0.01;  // of the bisection over robustness
constexpr int kMostSegments = 14;

LinearExpression constant(double value) { return {{}, value}; }
LinearExpression column(int index) { return {{{index, 1.0}}, 0.0}; }
const LinearExpression kOne = constant(1.0);

bool is_predicate(const Formula& f) {
  return f.children.empty() ||
         (f.op == Op::kAnd && std::all_of(f.children.begin(), f.children.end(),
                                          [](const FormulaPtr& child) { return is_predicate(*child); }));
}

bool in_fragment(const Formula& f) {
  switch (f.op) {
    case Op::kAnd:
    case Op::kOr:
      return std::all_of(f.children.begin(), f.children.end(),
                         [](const FormulaPtr& c) { return in_fragment(*c); });
    case Op::kEventually:
    case Op::kAlways:
      return is_predicate(*f.children[0]);
    case Op::kUntil:
    case Op::kRelease:
      return false;
    default:
      return true;
  }
}

class FreeTimeEncoding {
 public:
  FreeTimeEncoding(const Specification& spec, int segments, double robustness_m)
      : spec_(spec), n_(segments), rho_(robustness_m), corners_(corners_of(spec.workspace)) {
    add_curves();
    for (const Clause& clause : spec.clauses) imply(kOne, *normal_form(clause.formula));
    add_obstacles();
    add_separation();
  }

  MilpModel model;

  // Penalises the second derivatives of r and of h, which is what the paper calls acceleration.
  void add_penalty() {
    const auto price = [this](const LinearExpression& value, double weight) {
      const int size = model.add_column(0.0, kUnbounded, weight);
      for (const double sign : {1.0, -1.0}) {
        LinearExpression above = column(size);
        above.add(value, sign);
        model.add_row(0.0, above, kUnbounded);
      }
    };
    for (int k = 0; k < n_; ++k) {
      for (std::size_t i = 0; i + 2 <= kDegree; ++i) {
        price(second(times_[segment(k)], i), 1e-2);
        for (const auto& robot : points_) {
          for (std::size_t axis = 0; axis < 2; ++axis) price(second(robot[segment(k)][axis], i), 1.0);
        }
      }
    }
  }

  Motion motion(const std::vector<double>& x) const {
    std::vector<Segment> segments;
    for (std::size_t k = 0; k < segment(n_); ++k) {
      Segment made;
      made.time.resize(kDegree + 1);
      for (std::size_t i = 0; i <= kDegree; ++i)
        made.time[static_cast<Eigen::Index>(i)] = x[static_cast<std::size_t>(times_[k][i])];
      for (const auto& robot : points_) {
        Eigen::Matrix2Xd r(2, kDegree + 1);
        for (std::size_t axis = 0; axis < 2; ++axis) {
          for (std::size_t i = 0; i <= kDegree; ++i)
            r(static_cast<Eigen::Index>(axis), static_cast<Eigen::Index>(i)) =
                x[static_cast<std::size_t>(robot[k][axis][i])];
        }
        made.position.push_back(r);
      }
      segments.push_back(made);
    }
    return Motion(std::move(segments));
  }

 private:
  using Control = std::array<int, kDegree + 1>;  // columns of a coordinate's control points

  static std::size_t segment(int k) { return static_cast<std::size_t>(k); }

  static LinearExpression second(const Control& c, std::size_t i) {
    LinearExpression value = column(c[i + 2]);
    return value.add(column(c[i + 1]), -2.0).add(column(c[i]));
  }
  static LinearExpression difference(const Control& c, std::size_t i) {
    LinearExpression value = column(c[i + 1]);
    return value.add(column(c[i]), -1.0);
  }

  void add_curves() {
    for (int k = 0; k < n_; ++k) {
      Control time{};
      for (std::size_t i = 0; i <= kDegree; ++i)
        time[i] = k > 0 && i == 0 ? times_.back()[kDegree] : model.add_column(0.0, spec_.horizon_s);
      for (std::size_t i = 0; i < kDegree; ++i)
        model.add_row(kLeastRate_s / kDegree, difference(time, i), kUnbounded);
      if (k > 0) join(times_.back(), time);
      times_.push_back(time);
    }
    fix(times_.front()[0], 0.0);
    fix(times_.back()[kDegree], spec_.horizon_s);
    for (const Robot& robot : spec_.robots) {
      std::vector<std::array<Control, 2>> curve;
      for (int k = 0; k < n_; ++k) {
        std::array<Control, 2> control{};
        for (std::size_t axis = 0; axis < 2; ++axis) {
          for (std::size_t i = 0; i <= kDegree; ++i)
            control[axis][i] =
                k > 0 && i == 0 ? curve.back()[axis][kDegree] : model.add_column(-kUnbounded, kUnbounded);
          // r' within the limit times h', coefficient by coefficient: both have the same degree.
          for (std::size_t i = 0; i < kDegree; ++i) {
            for (const double sign : {1.0, -1.0}) {
              LinearExpression room;
              room.add(difference(times_[segment(k)], i), robot.max_velocity_m_s);
              room.add(difference(control[axis], i), sign);
              model.add_row(0.0, room, kUnbounded);
            }
          }
          if (k > 0) join(curve.back()[axis], control[axis]);
        }
        for (std::size_t i = 0; i <= kDegree; ++i) keep_inside(control, i);
        curve.push_back(control);
      }
      for (std::size_t axis = 0; axis < 2; ++axis) {
        const auto a = static_cast<Eigen::Index>(axis);
        fix(curve.front()[axis][0], robot.start.p_WB[a]);
        model.add_row(0.0, difference(curve.front()[axis], 0), 0.0);
        if (robot.end) fix(curve.back()[axis][kDegree], robot.end->p_WB[a]);
        model.add_row(0.0, difference(curve.back()[axis], kDegree - 1), 0.0);
      }
      points_.push_back(curve);
    }
  }

  void fix(int index, double value) {
    model.columns[static_cast<std::size_t>(index)].lower =
        model.columns[static_cast<std::size_t>(index)].upper = value;
  }

  // Continuous first derivatives.
  void join(const Control& before, const Control& after) {
    LinearExpression jump = difference(before, kDegree - 1);
    jump.add(difference(after, 0), -1.0);
    model.add_row(0.0, jump, 0.0);
  }

  void keep_inside(const std::array<Control, 2>& control, std::size_t i) {
    for (Eigen::Index side = 0; side < spec_.workspace.offsets.size(); ++side) {
      LinearExpression beyond;
      beyond.add(column(control[0][i]), spec_.workspace.normals(side, 0));
      beyond.add(column(control[1][i]), spec_.workspace.normals(side, 1));
      model.add_row(-kUnbounded, beyond, spec_.workspace.offsets[side]);
    }
  }

  std::vector<LinearExpression> choose(std::size_t n, const LinearExpression& literal) {
    if (n == 1) return {literal};
    std::vector<LinearExpression> options;
    LinearExpression balance;
    balance.add(literal, -1.0);
    for (std::size_t i = 0; i < n; ++i) {
      options.push_back(column(model.add_binary()));
      balance.add(options.back());
    }
    model.add_row(0.0, balance, 0.0);
    return options;
  }

  // literal -> expression >= 0, where it never falls below -reach.
  void imply_nonnegative(const LinearExpression& literal, LinearExpression expression, double reach) {
    if (!literal.is_constant()) {
      expression.add(literal, -reach);
      expression.constant += reach;
    }
    model.add_row(0.0, expression, kUnbounded);
  }

  // A formula at time 0.
  void imply(const LinearExpression& literal, const Formula& f) {
    switch (f.op) {
      case Op::kAnd:
        for (const FormulaPtr& child : f.children) imply(literal, *child);
        return;
      case Op::kOr: {
        const auto options = choose(f.children.size(), literal);
        for (std::size_t i = 0; i < options.size(); ++i) imply(options[i], *f.children[i]);
        return;
      }
      case Op::kEventually: {
        const auto options = choose(segment(n_) + 1, literal);
        for (int k = 0; k <= n_; ++k) {
          const LinearExpression& here = options[segment(k)];
          LinearExpression after = knot(k), before = constant(f.to_s);
          after.constant -= f.from_s;
          before.add(knot(k), -1.0);
          imply_nonnegative(here, after, f.from_s);
          imply_nonnegative(here, before, spec_.horizon_s - f.to_s);
          imply_predicate(here, *f.children[0], k, false);
        }
        return;
      }
      case Op::kAlways:
        for (int k = 0; k < n_; ++k) {
          // The segment ends before the window, begins after it, or is bound by it.
          std::vector<LinearExpression> options = {literal};
          if (f.from_s > 0.0 || f.to_s < spec_.horizon_s) options = choose(3, literal);
          imply_predicate(options[0], *f.children[0], k, true);
          if (options.size() == 1) continue;
          LinearExpression over = constant(f.from_s), later = knot(k);
          over.add(knot(k + 1), -1.0);
          later.constant -= f.to_s;
          imply_nonnegative(options[1], over, spec_.horizon_s - f.from_s);
          imply_nonnegative(options[2], later, f.to_s);
        }
        return;
      default:
        return imply_predicate(literal, f, 0, false);
    }
  }

  LinearExpression knot(int k) const {
    return column(k < n_ ? times_[segment(k)][0] : times_.back()[kDegree]);
  }

  // On a whole segment, or at the knot where it begins.
  void imply_predicate(const LinearExpression& literal, const Formula& f, int k, bool whole) {
    if (f.op == Op::kAnd) {
      for (const FormulaPtr& child : f.children) imply_predicate(literal, *child, k, whole);
    } else if (f.op == Op::kTrue) {
      if (f.negated) model.add_row(-kUnbounded, literal, 0.0);
    } else if (f.op == Op::kLinear) {
      imply_linear(literal, f, k, whole);
    } else {
      const Region& region = spec_.regions[static_cast<std::size_t>(f.region)];
      const auto robot = static_cast<std::size_t>(f.robot);
      const auto sides = static_cast<std::size_t>(region.polytope.offsets.size());
      const auto options = f.negated ? choose(sides, literal) : std::vector<LinearExpression>(sides, literal);
      for (std::size_t side = 0; side < sides; ++side)
        imply_side(options[side], robot, region, static_cast<Eigen::Index>(side), f.negated ? -1.0 : 1.0, k,
                   whole, rho_);
    }
  }

  std::vector<std::array<int, 2>> hull(std::size_t robot, int k, bool whole) const {
    std::vector<std::array<int, 2>> points;
    const bool last = k == n_;
    const auto& control = points_[robot][segment(last ? k - 1 : k)];
    for (std::size_t i = 0; i <= kDegree; ++i) {
      if (whole || i == (last ? kDegree : 0u)) points.push_back({control[0][i], control[1][i]});
    }
    return points;
  }

  void imply_side(const LinearExpression& literal, std::size_t robot, const Region& region, Eigen::Index side,
                  double sign, int k, bool whole, double margin) {
    const Eigen::Vector2d normal = sign * region.polytope.normals.row(side).transpose();
    const double offset = sign * region.polytope.offsets[side] - margin;
    double lowest = kUnbounded;
    for (const Eigen::Vector2d& corner : corners_) lowest = std::min(lowest, offset - normal.dot(corner));
    for (const auto& point : hull(robot, k, whole)) {
      LinearExpression inside = constant(offset);
      inside.add(column(point[0]), -normal.x()).add(column(point[1]), -normal.y());
      imply_nonnegative(literal, inside, std::max(0.0, -lowest));
    }
  }

  void imply_linear(const LinearExpression& literal, const Formula& f, int k, bool whole) {
    const double sign = f.negated ? -1.0 : 1.0;
    double lowest = sign * f.constant - rho_;
    std::vector<LinearExpression> values(whole ? kDegree + 1 : 1, constant(sign * f.constant - rho_));
    for (const LinearTerm& term : f.terms) {
      double least = kUnbounded;
      for (const Eigen::Vector2d& corner : corners_)
        least = std::min(least, sign * term.coefficient * corner[term.axis]);
      lowest += least;
      const auto points = hull(static_cast<std::size_t>(term.robot), k, whole);
      for (std::size_t i = 0; i < points.size(); ++i)
        values[i].add(column(points[i][static_cast<std::size_t>(term.axis)]), sign * term.coefficient);
    }
    for (const LinearExpression& value : values) imply_nonnegative(literal, value, std::max(0.0, -lowest));
  }

  void add_obstacles() {
    for (std::size_t robot = 0; robot < spec_.robots.size(); ++robot) {
      for (const Region& obstacle : spec_.obstacles) {
        for (int k = 0; k < n_; ++k) {
          const auto sides = choose(static_cast<std::size_t>(obstacle.polytope.offsets.size()), kOne);
          for (std::size_t side = 0; side < sides.size(); ++side)
            imply_side(sides[side], robot, obstacle, static_cast<Eigen::Index>(side), -1.0, k, true,
                       spec_.robots[robot].radius_m);
        }
      }
    }
  }

  void add_separation() {
    Eigen::Vector2d extent = Eigen::Vector2d::Zero();
    for (const Eigen::Vector2d& a : corners_) {
      for (const Eigen::Vector2d& b : corners_) extent = extent.cwiseMax((a - b).cwiseAbs());
    }
    for (std::size_t i = 0; i < points_.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        for (std::size_t k = 0; k < segment(n_); ++k) {
          const auto options = choose(4, kOne);
          for (std::size_t d = 0; d < 4; ++d) {
            const double sign = d % 2 == 0 ? 1.0 : -1.0;
            for (std::size_t c = 0; c <= kDegree; ++c) {
              LinearExpression apart = constant(-spec_.min_distance(i, j));
              apart.add(column(points_[i][k][d / 2][c]), sign).add(column(points_[j][k][d / 2][c]), -sign);
              imply_nonnegative(options[d], apart,
                                spec_.min_distance(i, j) + extent[static_cast<Eigen::Index>(d / 2)]);
            }
          }
        }
      }
    }
  }

  const Specification& spec_;
  int n_;
  double rho_;
  std::vector<Eigen::Vector2d> corners_;
  std::vector<Control> times_;                               // per segment
  std::vector<std::vector<std::array<Control, 2>>> points_;  // per robot and segment, x and y
};

}  // namespace

FreeTimeResult plan_in_free_time(const Specification& spec, MilpSolver& solver, double limit_s) {
  FreeTimeResult result;
  bool moving = false;
  for (const auto* places : {&spec.regions, &spec.obstacles}) {
    for (const Region& region : *places) moving = moving || !region.path.empty();
  }
  for (const Clause& clause : spec.clauses) {
    if (!in_fragment(*normal_form(clause.formula))) result.unsupported = clause.text;
  }
  if (moving) result.unsupported = "a moving region";
  if (!result.unsupported.empty()) return result;

  double low = spec.planner.min_robustness_m, high = robustness_bound(spec, Scope::all(spec));
  std::optional<std::pair<double, std::vector<double>>> best;
  int segments = 0;
  const auto attempt = [&](int n, double rho, double limit) {
    const MilpResult found = solver.solve(FreeTimeEncoding(spec, n, rho).model, limit);
    result.status = found.status;
    if (!found.has_solution()) return false;
    best.emplace(rho, found.x);
    segments = n;
    return true;
  };
  for (int n = 6; n <= kMostSegments && !best; n += 2) attempt(n, high, 0.2 * limit_s);
  for (int n = 6; n <= kMostSegments && !best; n += 2) attempt(n, low, 0.2 * limit_s);
  if (!best) return result;
  for (low = best->first; high - low > kResolution_m;) {
    const double middle = 0.5 * (low + high);
    (attempt(segments, middle, 0.1 * limit_s) ? low : high) = middle;
  }
  FreeTimeEncoding smooth(spec, segments, best->first);
  smooth.add_penalty();
  const MilpResult smoothed = solver.solve(with_integers_fixed(smooth.model, best->second), 0.2 * limit_s);
  result.motion = smooth.motion(smoothed.has_solution() ? smoothed.x : best->second);
  result.robustness_m = best->first;
  result.status = MilpStatus::kOptimal;
  return result;
}

}  // namespace atmos::stl
