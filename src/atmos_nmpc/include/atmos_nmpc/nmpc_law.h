// A formulation as a control law: warm starts, the reference and the solver around one shooting problem.
#pragma once

#include <cmath>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "atmos_nmpc/advanced_step.h"
#include "atmos_nmpc/control_law.h"
#include "atmos_nmpc/multiple_shooting.h"
#include "atmos_nmpc/terminal_weight.h"

namespace atmos {

template <class Problem>
class NmpcLaw : public ControlLaw {
 public:
  using State = typename Problem::State;
  using Input = typename Problem::Input;
  using Actuate = std::function<void(const Input&, ActuatorInput&)>;

  // `actuate`: what is asked of the actuators for an input of the problem.
  NmpcLaw(CommandLevel level, Problem problem, const ControllerConfig& config, const SolverOptions& options,
          Actuate actuate, Stopwatch stopwatch)
      : level_(level),
        weights_(config.weights),
        places_(config.places),
        with_terminal_(config.attitude_error == AttitudeError::kVector),
        problem_(std::move(problem)),
        actuate_(std::move(actuate)),
        solver_(problem_, options, std::move(stopwatch)),
        advanced_step_(problem_) {
    // The first solve sets up Ipopt's structures, which takes longer than a solve: not in the first period.
    iterate_ = problem_.cold_start(kColdStartMu);
    solver_.solve(iterate_);
  }

  CommandLevel level() const override { return level_; }

  SolveResult solve(const ControlTask& task) override {
    advanced_step_.forget();
    State x0 = task.x0.template head<Problem::kStates>();
    if (jumps(task)) warm_ = false;
    if (warm_) {
      // q and -q are the same attitude: stay on the side of the previous solution, which is the starting
      // point.
      auto q = x0.template segment<4>(state13::kQuaternion);
      if (q.dot(problem_.initial_state().template segment<4>(state13::kQuaternion)) < 0.0) q = -q;
      for (std::int64_t k = iterate_period_; k < task.period && k < iterate_period_ + stages(); ++k)
        iterate_ = problem_.shifted(iterate_);
    }
    set_reference(task, x0);
    problem_.set_initial_state(x0);
    if (!warm_) iterate_ = problem_.cold_start(kColdStartMu);

    const SolveResult result = solver_.solve(iterate_);
    iterate_period_ = task.period;
    // A failed solve leaves no good starting point: the next one starts cold.
    warm_ = is_success(result.status);
    if (warm_) {
      plan_ = iterate_.z;
      plan_start_ = task.x0;
    }
    return result;
  }

  SolveResult prepare(const ControlTask& task) override {
    const SolveResult result = solve(task);
    if (warm_ && advanced_step_.prepare(problem_, iterate_)) prepared_ = task;
    return result;
  }

  bool feedback(const ControlTask& task) override {
    if (!advanced_step_.ready() || task.period != prepared_.period || task.reference != prepared_.reference)
      return false;
    set_input_reference(task);
    const Input change = advanced_step_.correction(task.x0.template head<Problem::kStates>(), problem_);
    const Input limit = kLargestCorrection * (problem_.input_upper() - problem_.input_lower());
    if (!(change.array().abs() <= limit.array()).all()) return false;
    problem_.set_input(plan_, 0, advanced_step_.input() + change);
    plan_start_ = task.x0;
    advanced_step_.forget();
    return true;
  }

  void forget() override {
    warm_ = false;
    advanced_step_.forget();
  }

  int stages() const override { return problem_.stages(); }
  void input(int k, ActuatorInput& result) const override { actuate_(problem_.input(plan_, k), result); }
  State13<double> state(int k) const override {
    if (k == 0) return plan_start_;
    State13<double> x = State13<double>::Zero();
    x.template head<Problem::kStates>() = problem_.state(plan_, k);
    return x;
  }
  ActiveBounds active_bounds() const override { return problem_.active_bounds(plan_); }
  void holding_input(const Quaternion4<double>& q_WB, const Disturbance& disturbance,
                     ActuatorInput& result) override {
    problem_.set_disturbance(disturbance);
    problem_.set_input_reference(problem_.dynamics().moving_input(q_WB, {}));
    actuate_(problem_.input_reference(), result);
  }

 private:
  // Barrier parameter behind a cold start's multipliers: far above mu_init, so that the first steps, which
  // are long, do not run into the bounds (half the iterations of one with mu_init).
  static constexpr double kColdStartMu = 1.0;
  // A reference this far from the one that was expected is another plan's business: the old plan is a worse
  // start than none.
  static constexpr double kJump_m = 0.1, kJump_rad = 0.1;
  // Share of an input's range: a correction beyond it is none of first order any more.
  static constexpr double kLargestCorrection = 0.2;

  // Whether the reference is not the continuation of the last one.
  bool jumps(const ControlTask& task) {
    const State13<double> x = task.reference_at(0).x;
    const auto q = x.template segment<4>(state13::kQuaternion);
    const bool jump = (x.template head<3>() - expected_reference_.template head<3>()).norm() > kJump_m ||
                      std::abs(q.dot(expected_reference_.template segment<4>(state13::kQuaternion))) <
                          std::cos(0.5 * kJump_rad);
    expected_reference_ = task.reference_at(1).x;
    return jump;
  }

  // The disturbances, and the inputs that hold the reference against them.
  void set_input_reference(const ControlTask& task) {
    const auto input = [&](int k) {
      const ReferencePoint& reference = task.reference_at(k);
      return problem_.dynamics(k).moving_input(reference.x.template segment<4>(state13::kQuaternion),
                                               reference.motion);
    };
    for (int k = 0; k < stages(); ++k) problem_.set_disturbance(k, task.disturbance_at(k));
    if (task.reference.size() == 1 && task.disturbance.size() == 1) {
      problem_.set_input_reference(input(0));
    } else {
      for (int k = 0; k < stages(); ++k) problem_.set_input_reference(k, input(k));
    }
  }

  void set_reference(const ControlTask& task, const State& x0) {
    const Quaternion4<double> q = task.reference_at(stages()).x.template segment<4>(state13::kQuaternion);
    const double yaw = std::atan2(2.0 * (q[0] * q[3] + q[1] * q[2]), 1.0 - 2.0 * (q[2] * q[2] + q[3] * q[3]));
    // The disturbance moves the equilibrium, not the linear motion about it.
    problem_.set_disturbance({});
    if (with_terminal_ && terminal_yaw_ != yaw) {
      terminal_ = planar_terminal_weight(problem_.dynamics(), weights_, problem_.input_weight(), yaw);
      terminal_yaw_ = yaw;
    }
    set_input_reference(task);
    if (!task.robots.empty()) {
      Places places = places_;
      places.obstacles.insert(places.obstacles.end(), task.robots.begin(), task.robots.end());
      problem_.cost().set_places(places);
    }
    references_.clear();
    for (const ReferencePoint& point : task.reference) references_.push_back(point.x);
    problem_.cost().set_reference(references_, x0.template segment<4>(state13::kQuaternion), terminal_);
  }

  CommandLevel level_;
  TrackingWeights weights_;
  Places places_;  // the configured ones
  bool with_terminal_;
  Problem problem_;
  Actuate actuate_;
  OptimalControlSolver solver_;  // refers to problem_
  AdvancedStep<Problem> advanced_step_;
  ControlTask prepared_{};  // what advanced_step_ is ready for

  TrackingCost::PlanarWeight terminal_ =
      TrackingCost::PlanarWeight::Zero();  // of a reference at terminal_yaw_
  std::optional<double> terminal_yaw_;
  std::vector<State13<double>> references_;                       // scratch
  State13<double> expected_reference_ = State13<double>::Zero();  // of the next period's first stage
  Iterate iterate_;                                               // the newest solution
  std::int64_t iterate_period_ = 0;
  bool warm_ = false;     // iterate_ is a solution to start from
  Eigen::VectorXd plan_;  // z of the last success
  State13<double> plan_start_ = State13<double>::Zero();
};

}  // namespace atmos
