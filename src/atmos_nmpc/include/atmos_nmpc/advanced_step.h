// Advanced-step feedback (Zavala, Biegler: The advanced-step NMPC controller, Automatica 2009): the problem
// is solved for the state predicted at the next period, its KKT system is factorised there, and when the
// measurement comes the first input follows by a first-order update, at once.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "atmos_nmpc/multiple_shooting.h"
#include "atmos_nmpc/stage_kkt.h"

namespace atmos {

template <class Problem>
class AdvancedStep {
 public:
  using State = typename Problem::State;
  using Input = typename Problem::Input;

  explicit AdvancedStep(const Problem& problem)
      : kkt_(*problem.stage_layout()),
        jacobian_(problem.jacobian_sparsity().size()),
        hessian_(problem.hessian_sparsity().size()) {
    const int variables = problem.variable_count();
    const auto slots = [this](const Sparsity& sparsity, int first_row) {
      std::vector<int> list;
      for (std::size_t i = 0; i < sparsity.rows.size(); ++i)
        list.push_back(kkt_.slot(first_row + sparsity.rows[i], sparsity.columns[i]).value());
      return list;
    };
    jacobian_slots_ = slots(problem.jacobian_sparsity(), variables);
    hessian_slots_ = slots(problem.hessian_sparsity(), 0);
    for (int i = 0; i < variables; ++i) diagonal_slots_.push_back(kkt_.slot(i, i).value());
  }

  // `solution` of `problem` as it stands, initial state and all. False where the KKT system has no unique
  // solution: no feedback then.
  bool prepare(const Problem& problem, const Iterate& solution) {
    problem.jacobian(solution.z.data(), jacobian_.data());
    problem.hessian(solution.z.data(), 1.0, solution.lambda.data(), hessian_.data());
    kkt_.set_zero();
    double* entries = kkt_.entries();
    for (std::size_t i = 0; i < jacobian_slots_.size(); ++i)
      entries[jacobian_slots_[i]] += jacobian_[static_cast<Eigen::Index>(i)];
    for (std::size_t i = 0; i < hessian_slots_.size(); ++i)
      entries[hessian_slots_[i]] += hessian_[static_cast<Eigen::Index>(i)];
    for (int i = 0; i < problem.variable_count(); ++i) {
      // Ipopt relaxes bounds by 1e-8, so that a solution may stand on one.
      constexpr double kLeastDistance = 1e-9;
      const double above = std::max(solution.z[i] - problem.lower_bounds()[i], kLeastDistance);
      const double below = std::max(problem.upper_bounds()[i] - solution.z[i], kLeastDistance);
      entries[diagonal_slots_[static_cast<std::size_t>(i)]] +=
          solution.bound_lower[i] / above + solution.bound_upper[i] / below;
    }
    Eigen::MatrixXd A0, S0;
    problem.initial_state_blocks(solution, A0, S0);
    kkt_.set_initial_state_blocks(A0, S0);
    ready_ = kkt_.factorise();
    if (!ready_) return false;
    gain_ = kkt_.gain();
    x0_ = problem.initial_state();
    u0_ = problem.input(solution.z, 0);
    lower_ = problem.lower_bounds().template head<Problem::kInputs>();
    upper_ = problem.upper_bounds().template head<Problem::kInputs>();
    return true;
  }

  bool ready() const { return ready_; }
  void forget() { ready_ = false; }

  // First input for the measured x0, within its bounds. Allocates nothing. Only when ready().
  Input feedback(State x0) const {
    auto q = x0.template segment<4>(state13::kQuaternion);
    if (q.dot(x0_.template segment<4>(state13::kQuaternion)) < 0.0) q = -q;
    return (u0_ + gain_ * (x0 - x0_)).cwiseMax(lower_).cwiseMin(upper_);
  }

 private:
  StageKkt kkt_;
  Eigen::VectorXd jacobian_, hessian_;
  std::vector<int> jacobian_slots_, hessian_slots_, diagonal_slots_;
  bool ready_ = false;
  Eigen::Matrix<double, Problem::kInputs, Problem::kStates> gain_;
  State x0_;
  Input u0_, lower_, upper_;
};

}  // namespace atmos
