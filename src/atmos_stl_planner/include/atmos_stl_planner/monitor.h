// What a flight is still worth while it goes on: per clause the interval of robustness that is still
// possible, without waiting for the end of any window.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "atmos_stl_planner/specification.h"

namespace atmos::stl {

enum class Verdict { kOpen, kSatisfied, kViolated };

struct ClauseState {
  double low_m, high_m;
  Verdict verdict;  // never changes again once it is not open
};

// Formulas are evaluated at the samples and, interpolated linearly, at the ends of windows. The future is
// bounded by the workspace: no predicate is more or less than it can be inside. Clauses that are an
// eventually or an always of predicates cost the same at every sample; others are evaluated anew on a grid of
// 0.1 s.
class Monitor {
 public:
  explicit Monitor(const Specification& specification);
  ~Monitor();

  // Centres of all robots at a time since the start of the plan. Times ascend; a sample that is not finite or
  // not later than the one before is counted and ignored. The first one stands for all times before it.
  void update(double time_s, const std::vector<Eigen::Vector2d>& p_WB);

  const std::vector<ClauseState>& clauses() const;
  double low_m() const;  // least of the clauses'
  double high_m() const;
  Verdict verdict() const;
  unsigned long long rejected() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Robustness of a formula in normal form without temporal operators at one instant.
double instantaneous(const Specification& specification, const Formula& formula, double time_s,
                     const std::vector<Eigen::Vector2d>& p_WB);

// The least robustness of what the always clauses ask for at this time; infinite where none does. The curve
// over time of the paper's figures.
double demand_now(const Specification& specification, double time_s,
                  const std::vector<Eigen::Vector2d>& p_WB);

}  // namespace atmos::stl
