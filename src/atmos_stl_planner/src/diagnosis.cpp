#include "atmos_stl_planner/diagnosis.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

namespace atmos::stl {

namespace {

constexpr double kTimeStep_s = 0.1;   // to which a relaxed window end is found
constexpr double kFactorStep = 0.02;  // to which a relaxed limit is found
constexpr double kMostFactor = 8.0;

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

}  // namespace

struct Diagnosis::Part {
  std::string name;
  std::function<void(Scope&)> leave_out;
};

Diagnosis::Diagnosis(const Specification& specification, MilpSolver& solver, Clock clock)
    : spec_(specification), solver_(solver), clock_(std::move(clock)) {}

std::vector<Diagnosis::Part> Diagnosis::parts() const {
  // Limits and the like are tried first: a conflict that names clauses alone says more.
  std::vector<Part> all;
  all.push_back({"acceleration limit", [](Scope& scope) { scope.acceleration = false; }});
  all.push_back({"velocity limit", [](Scope& scope) { scope.velocity = false; }});
  if (spec_.robots.size() > 1)
    all.push_back({"keeping apart", [](Scope& scope) { scope.separation = false; }});
  if (!spec_.obstacles.empty()) all.push_back({"obstacles", [](Scope& scope) { scope.obstacles = false; }});
  for (std::size_t i = 0; i < spec_.robots.size(); ++i) {
    if (spec_.robots[i].end)
      all.push_back({"end of " + spec_.robots[i].name, [i](Scope& scope) { scope.ends[i] = false; }});
  }
  for (std::size_t i = 0; i < spec_.clauses.size(); ++i)
    all.push_back({spec_.clauses[i].text, [i](Scope& scope) { scope.clauses[i] = false; }});
  return all;
}

// Not refuted is possible: no part is called innocent without a proof.
bool Diagnosis::possible(const Scope& scope, double limit_s, bool coarsest_alone) {
  return Planner(spec_, solver_, clock_)
             .feasible(scope, spec_.planner.min_robustness_m, limit_s, coarsest_alone) !=
         MilpStatus::kInfeasible;
}

Conflict Diagnosis::conflict(double limit_s) {
  const double end = clock_() + limit_s;
  if (possible(Scope::all(spec_), limit_s, false)) return {};
  // The coarsest grid answers soonest. Should a finer one have a plan for what is left in the end, the search
  // is repeated with all grids.
  Scope scope = Scope::all(spec_);
  Conflict result = filtered(scope, end, true);
  if (possible(scope, end - clock_(), false)) {
    scope = Scope::all(spec_);
    result = filtered(scope, end, false);
  }
  return result;
}

// Deletion filter: what can be left out without making a plan possible has no part in the conflict.
Conflict Diagnosis::filtered(Scope& scope, double end, bool coarsest_alone) {
  Conflict result;
  result.minimal = true;
  for (const Part& part : parts()) {
    Scope without = scope;
    part.leave_out(without);
    const double left = end - clock_();
    if (left <= 0.0) result.minimal = false;
    if (left > 0.0 && !possible(without, left, coarsest_alone)) {
      scope = without;
    } else {
      result.parts.push_back(part.name);
    }
  }
  return result;
}

std::vector<Relaxation> Diagnosis::relaxations(const Conflict& conflict, double limit_s) {
  const double end = clock_() + limit_s;
  std::vector<Relaxation> found;
  const auto in_conflict = [&conflict](const std::string& name) {
    return std::find(conflict.parts.begin(), conflict.parts.end(), name) != conflict.parts.end();
  };
  // The least change in (0, most] that makes a plan possible, to a step; nothing if the largest does not.
  const auto least = [&](double most, double step,
                         const std::function<bool(double)>& works) -> std::optional<double> {
    if (!(most > 0.0) || clock_() >= end || !works(most)) return std::nullopt;
    double low = 0.0, high = most;
    while (high - low > step && clock_() < end) {
      const double middle = 0.5 * (low + high);
      (works(middle) ? high : low) = middle;
    }
    return high;
  };
  // A larger change must prove a plan, not merely fail to be refuted.
  const auto works = [&](const Specification& changed, const Scope& scope) {
    return Planner(changed, solver_, clock_)
               .feasible(scope, changed.planner.min_robustness_m, end - clock_()) == MilpStatus::kOptimal;
  };

  for (std::size_t i = 0; i < spec_.clauses.size(); ++i) {
    const Clause& clause = spec_.clauses[i];
    const Op op = clause.formula->op;
    if (!in_conflict(clause.text) || (op != Op::kEventually && op != Op::kAlways)) continue;
    const double ahead = horizon(*clause.formula) - clause.formula->to_s;
    const auto eased = [&](double by) {
      auto formula = std::make_shared<Formula>(*clause.formula);
      // An eventually gets more time; an always is asked for a shorter time, from its end.
      formula->to_s += op == Op::kEventually ? by : -by;
      Specification changed = spec_;
      changed.clauses[i].formula = formula;
      changed.clauses[i].text = to_text(*formula, spec_.vocabulary());
      return changed;
    };
    const double most = op == Op::kEventually ? spec_.horizon_s - ahead - clause.formula->to_s
                                              : clause.formula->to_s - clause.formula->from_s;
    const auto by =
        least(most, kTimeStep_s, [&](double change) { return works(eased(change), Scope::all(spec_)); });
    if (!by) continue;
    // Rounded so that it still works.
    const double rounded = std::min(most, std::ceil(*by / kTimeStep_s - 1e-9) * kTimeStep_s);
    found.push_back({eased(rounded).clauses[i].text + " instead of " + clause.text,
                     rounded / std::max(1.0, clause.formula->to_s)});
  }
  struct Limit {
    const char* part;
    const char* unit;
    double Scope::*factor;
    double Robot::*value;
  };
  for (const Limit& limit :
       {Limit{"velocity limit", "m/s", &Scope::velocity_factor, &Robot::max_velocity_m_s},
        Limit{"acceleration limit", "m/s^2", &Scope::acceleration_factor, &Robot::max_acceleration_m_s2}}) {
    if (!in_conflict(limit.part)) continue;
    const auto by = least(kMostFactor - 1.0, kFactorStep, [&](double change) {
      Scope scope = Scope::all(spec_);
      scope.*limit.factor = 1.0 + change;
      return works(spec_, scope);
    });
    if (!by) continue;
    const double before = spec_.robots[0].*limit.value;
    found.push_back({std::string(limit.part) + " of " + number(before * (1.0 + *by)) + " " + limit.unit +
                         " instead of " + number(before) + " " + limit.unit +
                         (spec_.robots.size() > 1 ? " (the others in proportion)" : ""),
                     *by});
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const Relaxation& a, const Relaxation& b) { return a.cost < b.cost; });
  return found;
}

std::string explanation(const Conflict& conflict, const std::vector<Relaxation>& relaxations) {
  std::string text = conflict.minimal
                         ? "these cannot hold together, and each of them is needed for that:\n"
                         : "these cannot hold together; not all of them may be needed for that:\n";
  for (const std::string& part : conflict.parts) text += "  " + part + "\n";
  if (!relaxations.empty())
    text += "any one of these would make a plan possible, the smallest change first:\n";
  for (const Relaxation& relaxation : relaxations) text += "  " + relaxation.statement + "\n";
  return text;
}

}  // namespace atmos::stl
