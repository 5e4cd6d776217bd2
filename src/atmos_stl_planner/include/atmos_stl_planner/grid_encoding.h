// The mixed-integer linear problem of a specification on a fixed time grid: piecewise cubic curves in
// position, knots aligned with the windows of the formulas. Times being known, velocity and acceleration
// limits are linear and hold at every instant, an eventually is a choice among known knots, and moving
// obstacles are constants.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "atmos_stl_planner/checker.h"
#include "atmos_stl_planner/milp.h"
#include "atmos_stl_planner/motion.h"
#include "atmos_stl_planner/specification.h"

namespace atmos::stl {

// What was flown when a plan is made on the way: the motion of all robots from 0 to now, and their velocities
// now.
struct Past {
  Motion motion;
  std::vector<Eigen::Vector2d> v_WB;  // m/s
};

// The part of a specification that a problem asks for; diagnoses leave parts out or ease them.
struct Scope {
  std::vector<bool> clauses;  // per clause
  std::vector<bool> ends;     // per robot with an end
  bool velocity = true;       // limits of velocity
  bool acceleration = true;
  bool separation = true;
  bool obstacles = true;
  double velocity_factor = 1.0;  // eases the limit
  double acceleration_factor = 1.0;
  static Scope all(const Specification& specification);
};

// Knots from 0 to the horizon: `now_s` if > 0, every window end the formulas refer to, paths' points, and
// between them equal steps of at most `step_s`; before now_s steps of at most 0.25 s.
std::vector<double> time_grid(const Specification& specification, double step_s, double now_s = 0.0);

struct GridProblem {
  const Specification* specification;
  Scope scope;
  std::vector<double> knots;
  const Past* past = nullptr;  // its motion ends at one of the knots
  std::map<std::size_t, const Motion*>
      fixed;                  // robots whose motion on these knots stands; the others are planned
  std::vector<bool> planned;  // per robot; robots neither planned nor fixed do not exist
};

class GridEncoding {
 public:
  // Robustness between the two numbers is a column of the problem; every implication holds for all of them.
  GridEncoding(const GridProblem& problem, double least_robustness_m, double most_robustness_m);
  ~GridEncoding();
  GridEncoding(GridEncoding&&) noexcept;

  const MilpModel& model() const;
  int robustness_column() const;

  // Adds a convex cost of accelerations: the integral of their square relative to the limit, piecewise
  // linear.
  void add_smoothness();
  // Adds a column for the time by which every visit may be late or early; returns its index.
  int add_time_robustness();

  // Groups of binary columns of which exactly one is 1 in every solution: visits of outermost formulas, by
  // time.
  const std::vector<std::vector<int>>& visits() const;

  // The motion of a solution, past and fixed robots included.
  Motion motion(const std::vector<double>& x) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// No predicate (in normal form) can have more or less than this in the workspace, at any time, m.
double most_possible(const Specification& specification, const Formula& predicate);
double least_possible(const Specification& specification, const Formula& predicate);

// No plan can have more robustness than this, whatever the motion: from the sizes of workspace and regions
// and from what was flown already, m.
double robustness_bound(const Specification& specification, const Scope& scope, const Past* past = nullptr);

}  // namespace atmos::stl
