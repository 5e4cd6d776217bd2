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
        hessian_(problem.hessian_sparsity().size()),
        adjoint_(kkt_.size()),
        by_disturbance_(Problem::kInputs, 6 * problem.stages()),
        by_input_reference_(Problem::kInputs, Problem::kInputs * problem.stages()),
        disturbance_(6 * problem.stages()),
        input_reference_(Problem::kInputs * problem.stages()) {
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
    ready_ = kkt_.factorise();
    if (!ready_) return false;
    // The system is symmetric: its solution for a unit right-hand side weighs every parameter's effect on u0.
    for (int i = 0; i < Problem::kInputs; ++i) {
      adjoint_.setZero();
      adjoint_[i] = 1.0;
      kkt_.solve(adjoint_.data());
      const auto slopes = problem.parameter_slopes(solution, adjoint_);
      by_state_.row(i) = -slopes.initial_state;
      by_disturbance_.row(i) = -slopes.disturbance;
      by_input_reference_.row(i) = -slopes.input_reference;
    }
    x0_ = problem.initial_state();
    for (int k = 0; k < problem.stages(); ++k) {
      disturbance_.template segment<6>(6 * k) = disturbance_of(problem, k);
      input_reference_.template segment<Problem::kInputs>(Problem::kInputs * k) = problem.input_reference(k);
    }
    u0_ = problem.input(solution.z, 0);
    return true;
  }

  bool ready() const { return ready_; }
  void forget() { ready_ = false; }

  // Only when ready(): the first input of the solution, and what the measured x0 and the parameters that
  // `problem` has by now add to it, bounds apart. Allocates nothing.
  const Input& input() const { return u0_; }
  Input correction(State x0, const Problem& problem) const {
    auto q = x0.template segment<4>(state13::kQuaternion);
    if (q.dot(x0_.template segment<4>(state13::kQuaternion)) < 0.0) q = -q;
    Input change = by_state_ * (x0 - x0_);
    for (int k = 0; k < problem.stages(); ++k) {
      constexpr int m = Problem::kInputs;
      change += by_disturbance_.template middleCols<6>(6 * k) *
                    (disturbance_of(problem, k) - disturbance_.template segment<6>(6 * k)) +
                by_input_reference_.template middleCols<m>(m * k) *
                    (problem.input_reference(k) - input_reference_.template segment<m>(m * k));
    }
    return change;
  }

 private:
  static Eigen::Matrix<double, 6, 1> disturbance_of(const Problem& problem, int k) {
    const Disturbance& disturbance = problem.dynamics(k).disturbance();
    Eigen::Matrix<double, 6, 1> d;
    d << disturbance.acceleration_W, disturbance.angular_acceleration_B;
    return d;
  }

  StageKkt kkt_;
  Eigen::VectorXd jacobian_, hessian_;
  std::vector<int> jacobian_slots_, hessian_slots_, diagonal_slots_;
  bool ready_ = false;
  Eigen::VectorXd adjoint_;
  Eigen::Matrix<double, Problem::kInputs, Problem::kStates> by_state_;
  Eigen::Matrix<double, Problem::kInputs, Eigen::Dynamic> by_disturbance_, by_input_reference_;  // by stages
  State x0_;
  Eigen::VectorXd disturbance_, input_reference_;  // stage by stage
  Input u0_;
};

}  // namespace atmos
