#include "atmos_stl_planner/planner.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "atmos_stl_planner/free_time.h"

namespace atmos::stl {

namespace {

constexpr double kResolution_m = 0.002;  // of the bisection over robustness
constexpr double kJointShare = 0.5;      // of the time limit, before the fallback gets its turn
constexpr double kTimeShare = 0.25;      // of the time left, for time robustness
constexpr int kPolishProblems = 60;      // linear problems; a count, so that polishing is the same every time

}  // namespace

// A solution of an encoding: the integers are what counts, linear problems give the rest.
struct Planner::Found {
  GridProblem problem;
  double robustness_m = 0.0;
  std::vector<double> x;
};

struct Planner::Search {
  Search(const Planner& planner, const Past* flown, const std::function<void(const Plan&)>& callback)
      : spec(planner.spec_),
        solver(planner.solver_),
        clock(planner.clock_),
        past(flown),
        on_better(callback) {}

  const Specification& spec;
  MilpSolver& solver;
  const Clock& clock;
  const Past* past;
  const std::function<void(const Plan&)>& on_better;
  double begin = clock();
  double now_s = past != nullptr ? past->motion.end_s() : 0.0;
  Plan best;
  bool limited = false, failed = false;  // why nothing may have been proven

  double left(double share = 1.0) const { return share * spec.planner.time_limit_s - (clock() - begin); }

  GridProblem problem(double step_s) const {
    GridProblem made;
    made.specification = &spec;
    made.scope = Scope::all(spec);
    made.knots = time_grid(spec, step_s, now_s);
    made.past = past;
    made.planned.assign(spec.robots.size(), true);
    return made;
  }

  std::vector<double> steps() const {
    std::vector<double> result;
    for (double step = spec.planner.segment_s; step >= spec.planner.min_segment_s * (1.0 - 1e-9); step *= 0.5)
      result.push_back(step);
    return result;
  }

  std::optional<Found> solve(const GridProblem& asked, double robustness_m, double limit_s) {
    GridEncoding encoding(asked, robustness_m, robustness_m);
    encoding.add_smoothness();
    const MilpResult result = solver.solve(encoding.model(), limit_s);
    limited = limited || result.status == MilpStatus::kLimit;
    failed = failed || result.status == MilpStatus::kFailed;
    if (!result.has_solution()) return std::nullopt;
    return Found{asked, robustness_m, result.x};
  }

  // With the same choices, as much robustness as they allow.
  void raise(Found& found, double most_m) {
    if (past != nullptr) return;  // the past was judged at the robustness it was solved for
    const GridEncoding encoding(found.problem, found.robustness_m, most_m);
    MilpModel model = with_integers_fixed(encoding.model(), found.x);
    model.columns[static_cast<std::size_t>(encoding.robustness_column())].cost = -1.0;
    const MilpResult result = solver.solve(model, left());
    if (!result.has_solution()) return;
    found.x = result.x;
    found.robustness_m = result.x[static_cast<std::size_t>(encoding.robustness_column())];
  }

  // With the same choices, the smoothest motion; returns its cost, infinite if there is none.
  double smooth(Found& found) {
    GridEncoding encoding(found.problem, found.robustness_m, found.robustness_m);
    encoding.add_smoothness();
    const MilpResult result = solver.solve(with_integers_fixed(encoding.model(), found.x), left());
    if (!result.has_solution()) return kUnbounded;
    found.x = result.x;
    double cost = 0.0;
    for (std::size_t j = 0; j < result.x.size(); ++j) cost += encoding.model().columns[j].cost * result.x[j];
    return cost;
  }

  // Visits a little earlier or later, as long as that makes the motion smoother.
  void polish(Found& found, double cost) {
    const GridEncoding encoding(found.problem, found.robustness_m, found.robustness_m);
    int problems = 0;
    for (bool better = true; better;) {
      better = false;
      for (const std::vector<int>& visit : encoding.visits()) {
        for (const int step : {1, -1}) {
          const auto at = static_cast<int>(
              std::find_if(visit.begin(), visit.end(),
                           [&](int column) { return found.x[static_cast<std::size_t>(column)] > 0.5; }) -
              visit.begin());
          const int next = at + step;
          if (next < 0 || next >= static_cast<int>(visit.size()) || at >= static_cast<int>(visit.size()))
            continue;
          if (++problems > kPolishProblems || left() <= 0.0) return;
          Found moved = found;
          moved.x[static_cast<std::size_t>(visit[static_cast<std::size_t>(at)])] = 0.0;
          moved.x[static_cast<std::size_t>(visit[static_cast<std::size_t>(next)])] = 1.0;
          const double moved_cost = smooth(moved);
          if (moved_cost >= cost * (1.0 - 1e-6)) continue;
          found = moved;
          cost = moved_cost;
          better = true;
        }
      }
    }
  }

  // Keeps the plan if it is certified and better than the best.
  bool publish(const Motion& motion, const std::string& method, double segment_s, double robustness_m) {
    CertifyOptions options;
    options.min_robustness_m = std::min(robustness_m, spec.planner.min_robustness_m);
    options.limits_from_s = now_s;
    options.bound_acceleration = spec.planner.encoding == Encoding::kTimeGrid;
    const Certificate certificate = certify(spec, motion, options);
    if (!certificate.valid() || certificate.robustness_m < robustness_m - 1e-6) {
      failed = true;
      return false;
    }
    if (best.status == PlanStatus::kPlanned &&
        certificate.robustness_m < best.certificate.robustness_m - 1e-6)
      return false;
    const double elapsed = clock() - begin;
    if (best.status != PlanStatus::kPlanned) best.first_plan_s = elapsed;
    best.status = PlanStatus::kPlanned;
    best.motion = motion;
    best.certificate = certificate;
    best.segment_s = segment_s;
    best.method = method;
    best.total_s = elapsed;
    if (on_better) on_better(best);
    return true;
  }

  bool publish(const Found& found, const std::string& method, double step_s) {
    const GridEncoding encoding(found.problem, found.robustness_m, found.robustness_m);
    return publish(encoding.motion(found.x), method, step_s, found.robustness_m);
  }

  // The last steps with any found plan: certified at once, smoothed, polished.
  void finish(Found found, const std::string& method, double step_s) {
    publish(found, method, step_s);
    if (spec.planner.time_robustness) maximise_time(found);
    const double cost = smooth(found);
    if (cost == kUnbounded) return;
    publish(found, method, step_s);
    // Polishing moves visits; and on the way a plan is wanted soon.
    if (spec.planner.time_robustness || past != nullptr) return;
    polish(found, cost);
    publish(found, method, step_s);
  }

  void maximise_time(Found& found) {
    GridEncoding encoding(found.problem, found.robustness_m, found.robustness_m);
    const auto theta = static_cast<std::size_t>(encoding.add_time_robustness());
    MilpModel model = encoding.model();
    model.columns[theta].cost = -1.0;
    const MilpResult result = solver.solve(model, kTimeShare * left());
    if (!result.has_solution()) return;
    best.time_robustness_s = result.x[theta];
    found.x = result.x;
  }

  // The most robustness on a grid between what `found` has and `bound`.
  double bisect(Found& found, double bound_m, double share) {
    raise(found, bound_m);
    while (bound_m - found.robustness_m > kResolution_m && left(share) > 0.0) {
      const double middle = 0.5 * (found.robustness_m + bound_m);
      const bool was_limited = limited;
      std::optional<Found> better = solve(found.problem, middle, left(share));
      if (better) {
        found = *better;
        raise(found, bound_m);
      } else {
        if (limited && !was_limited) return bound_m;
        bound_m = middle;
      }
    }
    return bound_m;
  }

  void joint(double share) {
    const double bound = best.bound_m, least = spec.planner.min_robustness_m;
    if (bound < least) return;
    // Reaching what geometry allows is a proof of optimality, and the quickest question to ask.
    for (const double step : steps()) {
      if (left(share) <= 0.0) return;
      if (const auto found = solve(problem(step), bound, left(share))) {
        best.grid_bound_m = bound;
        return finish(*found, "joint", step);
      }
    }
    for (const double step : steps()) {
      if (left(share) <= 0.0) return;
      std::optional<Found> found = solve(problem(step), least, left(share));
      if (!found) continue;
      publish(*found, "joint", step);
      best.grid_bound_m = bisect(*found, bound, share);
      return finish(*found, "joint", step);
    }
  }

  // One robot after the other, each with those before it as moving obstacles. A clause belongs to the last of
  // its robots. Fails although a plan exists when an early robot stands in the way of a later one.
  void prioritised() {
    std::vector<std::size_t> order(spec.robots.size());
    std::iota(order.begin(), order.end(), 0u);
    const double least = spec.planner.min_robustness_m;
    for (const double step : steps()) {
      do {
        for (const double robustness : {best.bound_m, 0.5 * (best.bound_m + least), least}) {
          if (left() <= 0.0) return;
          if (in_order(order, step, robustness)) return;
        }
      } while (std::next_permutation(order.begin(), order.end()));
    }
  }

  bool in_order(const std::vector<std::size_t>& order, double step, double robustness_m) {
    GridProblem one = problem(step);
    one.planned.assign(spec.robots.size(), false);
    std::vector<bool> present(spec.robots.size(), false);
    std::vector<bool> done(spec.clauses.size(), false);
    std::vector<Motion> motions(spec.robots.size());
    std::string names;
    Found found;
    for (const std::size_t robot : order) {
      present[robot] = true;
      one.planned.assign(spec.robots.size(), false);
      one.planned[robot] = true;
      for (std::size_t i = 0; i < spec.clauses.size(); ++i) {
        one.scope.clauses[i] = !done[i] && speaks_only_of(*spec.clauses[i].formula, present);
        done[i] = done[i] || one.scope.clauses[i];
      }
      const auto own = solve(one, robustness_m, left());
      if (!own) return false;
      found = *own;
      smooth(found);
      motions[robot] = GridEncoding(found.problem, robustness_m, robustness_m).motion(found.x);
      one.fixed[robot] = &motions[robot];
      names += (names.empty() ? "" : ", ") + spec.robots[robot].name;
    }
    const GridEncoding last(found.problem, robustness_m, robustness_m);
    return publish(last.motion(found.x), "prioritised (" + names + "): incomplete, a better plan may exist",
                   step, robustness_m);
  }

  static bool speaks_only_of(const Formula& formula, const std::vector<bool>& robots) {
    if (formula.op == Op::kIn && !robots[static_cast<std::size_t>(formula.robot)]) return false;
    for (const LinearTerm& term : formula.terms) {
      if (!robots[static_cast<std::size_t>(term.robot)]) return false;
    }
    return std::all_of(formula.children.begin(), formula.children.end(),
                       [&robots](const FormulaPtr& child) { return speaks_only_of(*child, robots); });
  }

  Plan run() {
    best.bound_m = robustness_bound(spec, Scope::all(spec), past);
    best.grid_bound_m = best.bound_m;
    const bool several = spec.robots.size() > 1;
    if (spec.planner.encoding == Encoding::kFreeTime && past == nullptr) {
      free_time();
    } else {
      if (!(several && spec.planner.prioritised)) joint(several ? kJointShare : 1.0);
      const bool proven = !limited && !failed && !spec.planner.prioritised;
      if (best.status != PlanStatus::kPlanned && several && !proven) prioritised();
    }
    if (best.status != PlanStatus::kPlanned)
      best.status = limited || left() <= 0.0 ? PlanStatus::kTimeLimit
                    : failed                 ? PlanStatus::kFailed
                                             : PlanStatus::kInfeasible;
    best.total_s = clock() - begin;
    return best;
  }

  void free_time() {
    const FreeTimeResult result = plan_in_free_time(spec, solver, left());
    limited = limited || result.status == MilpStatus::kLimit;
    failed = failed || result.status == MilpStatus::kFailed;
    if (!result.unsupported.empty())
      best.method = "the free-time encoding does not cover " + result.unsupported;
    if (result.motion.empty()) return;
    publish(result.motion, "free time: acceleration is penalised, not bounded", 0.0, result.robustness_m);
  }
};

Planner::Planner(const Specification& specification, MilpSolver& solver, Clock clock)
    : spec_(specification), solver_(solver), clock_(std::move(clock)) {}

Plan Planner::plan(const Past* past, const std::function<void(const Plan&)>& on_better) {
  return Search(*this, past, on_better).run();
}

MilpStatus Planner::feasible(const Scope& scope, double robustness_m, double limit_s, bool coarsest_alone) {
  const double begin = clock_();
  bool limited = false;
  for (double step = spec_.planner.segment_s; step >= spec_.planner.min_segment_s * (1.0 - 1e-9);
       step *= 0.5) {
    GridProblem problem;
    problem.specification = &spec_;
    problem.scope = scope;
    problem.knots = time_grid(spec_, step);
    problem.planned.assign(spec_.robots.size(), true);
    GridEncoding encoding(problem, robustness_m, robustness_m);
    encoding.add_smoothness();
    const MilpResult result = solver_.solve(encoding.model(), limit_s - (clock_() - begin));
    if (result.has_solution()) return MilpStatus::kOptimal;
    limited = limited || result.status != MilpStatus::kInfeasible;
    if (coarsest_alone) break;
  }
  return limited ? MilpStatus::kLimit : MilpStatus::kInfeasible;
}

}  // namespace atmos::stl
