// What a motion is worth under a specification, in continuous time: no sampling, every statement from signs
// of Bernstein coefficients and isolated roots. Shares nothing with the encoders, so that it can judge them.
#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "atmos_stl_planner/interval_set.h"
#include "atmos_stl_planner/motion.h"
#include "atmos_stl_planner/specification.h"

namespace atmos::stl {

// Evaluates formulas on a motion. Robustness is that of the paper ("Planning Schemes"): a predicate's value,
// min for conjunction and always, max for disjunction and eventually; until as max over its witness of the
// min of both parts. in(A) is the conjunction of the region's sides.
class Checker {
 public:
  // Keeps references to both arguments' content only through copies.
  Checker(const std::vector<Region>& regions, const Motion& motion);
  ~Checker();
  Checker(Checker&&) noexcept;

  // From the end of the motion to `until_s`, every predicate (in normal form) has the value that `value`
  // gives it. What a formula can still become is found with the largest and the least that is possible.
  void assume_beyond(double until_s, std::function<double(const Formula&)> value);

  // The times at which the robustness of a formula in normal form is at least `level`. Formulas that look
  // beyond the end of the motion, and of what is assumed beyond it, do not hold.
  IntervalSet truth(const Formula& normal_formula, double level) const;

  // Robustness at `time_s`, m: a lower bound, at most 1e-8 below it.
  double robustness(const FormulaPtr& formula, double time_s = 0.0) const;

  // The time that decides the robustness at time_s: of the visit, or of the nearest approach.
  double critical_time(const FormulaPtr& formula, double time_s = 0.0) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

struct ClauseCertificate {
  double robustness_m = 0.0;
  double time_s = 0.0;  // when it is decided
  // By how much all robots together may be later or earlier (at rest before the start and after the end) with
  // the clause still true, s; at most the horizon.
  double lateness_s = 0.0;
  double earliness_s = 0.0;
};

struct Certificate {
  std::vector<std::string> faults;  // what makes the plan unfit to be flown; empty if valid
  double robustness_m = 0.0;        // least of the clauses'
  std::vector<ClauseCertificate> clauses;
  double peak_velocity_share = 0.0;      // largest |v| of an axis over its limit
  double peak_acceleration_share = 0.0;  // the same of acceleration
  double separation_m =
      std::numeric_limits<double>::infinity();  // least distance of two centres less what is asked
  double obstacle_m =
      std::numeric_limits<double>::infinity();  // least distance to an obstacle less the radius
  bool valid() const { return faults.empty(); }
};

struct CertifyOptions {
  double min_robustness_m = 0.0;
  double limits_from_s = 0.0;  // before it the motion is what was flown: no limits are asked of it
  bool bound_acceleration = true;
};

// Proves or refutes that a motion of all robots is a plan: continuous, from start to end in the workspace,
// within the limits, away from obstacles and other robots, and every clause at least min_robustness_m.
// Tolerance: 1e-6 of the quantity.
Certificate certify(const Specification& specification, const Motion& motion,
                    const CertifyOptions& options = {});

}  // namespace atmos::stl
