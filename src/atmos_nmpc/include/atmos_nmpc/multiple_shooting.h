// The optimal-control core (paper, MPC_formulation): direct multiple shooting with the variables in stage
// order z = [u0 x1 u1 x2 ... u(N-1) xN], the measured x0 eliminated. A formulation is a dynamics type over
// the 13-state, or over its first ten without the angular velocity, plus the tracking cost; this class gives
// the solver values and exact derivatives in the problem's own blocks.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "atmos_nmpc/nonlinear_program.h"
#include "atmos_nmpc/rigid_body_step.h"
#include "atmos_nmpc/tracking_cost.h"

namespace atmos {

template <class Dynamics>
class MultipleShooting : public NonlinearProgram {
 public:
  static constexpr int kStates = Dynamics::kStates;
  static constexpr int kInputs = Dynamics::kInputs;
  static constexpr int kBlock = kStates + kInputs;
  using State = typename Dynamics::State;
  using Input = typename Dynamics::Input;

  // stages: N >= 1. input_weight: diagonal of R, 1/N^2. The objective is objective_scale times the cost.
  MultipleShooting(Dynamics dynamics, TrackingCost cost, int stages, const Input& input_weight,
                   const Input& input_lower, const Input& input_upper, double objective_scale)
      : dynamics_(static_cast<std::size_t>(stages), dynamics),
        cost_(std::move(cost)),
        N_(stages),
        input_weight_(input_weight),
        input_reference_(static_cast<std::size_t>(stages), Input::Zero()),
        scale_(objective_scale) {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    lower_ = Eigen::VectorXd::Constant(variable_count(), -kInfinity);
    upper_ = Eigen::VectorXd::Constant(variable_count(), kInfinity);
    for (int k = 0; k < N_; ++k) {
      lower_.segment<kInputs>(input_at(k)) = input_lower;
      upper_.segment<kInputs>(input_at(k)) = input_upper;
    }
    initial_state_ = cost_.reference().template head<kStates>();
    declare_jacobian();
    declare_hessian();
  }

  // Of stage k: stages differ in what disturbs them.
  const Dynamics& dynamics(int k = 0) const { return dynamics_[static_cast<std::size_t>(k)]; }
  void set_disturbance(const Disturbance& disturbance) {
    for (Dynamics& dynamics : dynamics_) dynamics.set_disturbance(disturbance);
  }
  void set_disturbance(int k, const Disturbance& disturbance) {
    dynamics_[static_cast<std::size_t>(k)].set_disturbance(disturbance);
  }
  TrackingCost& cost() { return cost_; }
  const TrackingCost& cost() const { return cost_; }
  int stages() const { return N_; }

  // Hard bounds of x1 ... xN, infinite where there is none. With them a problem may be infeasible.
  void set_state_bounds(const State& lower, const State& upper) {
    for (int k = 1; k <= N_; ++k) {
      lower_.segment<kStates>(state_at(k)) = lower;
      upper_.segment<kStates>(state_at(k)) = upper;
    }
  }

  // Soft half-spaces normal . u <= limit on the inputs of every stage, one per row, with the penalty of the
  // soft bounds.
  void set_input_polytope(const Eigen::Matrix<double, Eigen::Dynamic, kInputs>& normals,
                          const Eigen::VectorXd& limits, const SoftBounds& penalty) {
    facet_normals_ = normals;
    facet_limits_ = limits;
    facet_penalty_ = penalty;
  }

  // R weighs u - `input`, clipped to the bounds: the inputs that hold the reference.
  void set_input_reference(const Input& input) {
    for (int k = 0; k < N_; ++k) set_input_reference(k, input);
  }
  void set_input_reference(int k, const Input& input) {
    input_reference_[static_cast<std::size_t>(k)] = input.cwiseMax(input_lower()).cwiseMin(input_upper());
  }
  Input input_lower() const { return lower_.template head<kInputs>(); }
  Input input_upper() const { return upper_.template head<kInputs>(); }

  const Input& input_reference(int k = 0) const { return input_reference_[static_cast<std::size_t>(k)]; }
  const Input& input_weight() const { return input_weight_; }

  void set_initial_state(const State& x0) { initial_state_ = x0; }
  const State& initial_state() const { return initial_state_; }

  Input input(const Eigen::VectorXd& z, int k) const { return z.segment<kInputs>(input_at(k)); }
  // Clipped to the bounds.
  void set_input(Eigen::VectorXd& z, int k, const Input& input) const {
    z.segment<kInputs>(input_at(k)) = input.cwiseMax(input_lower()).cwiseMin(input_upper());
  }
  // k in [0, N]; k = 0 is the initial state.
  State state(const Eigen::VectorXd& z, int k) const {
    return k == 0 ? initial_state_ : State(z.segment<kStates>(state_at(k)));
  }

  // Start without a previous solution: rest at x0 with all inputs at the middle of their bounds, bound
  // multipliers those of the barrier parameter mu.
  Iterate cold_start(double mu) const {
    Iterate start;
    start.z.resize(variable_count());
    for (int k = 0; k < N_; ++k) {
      start.z.segment<kInputs>(input_at(k)) =
          0.5 * (lower_.segment<kInputs>(input_at(k)) + upper_.segment<kInputs>(input_at(k)));
      start.z.segment<kStates>(state_at(k + 1)) = initial_state_;
    }
    // No more than what belongs to this distance: the state may lie on a bound, or beyond it.
    constexpr double kDistance = 1e-2;
    start.bound_lower = mu * (start.z - lower_).cwiseMax(kDistance).cwiseInverse();
    start.bound_upper = mu * (upper_ - start.z).cwiseMax(kDistance).cwiseInverse();
    start.lambda = Eigen::VectorXd::Zero(constraint_count());
    return start;
  }

  // The same plan one stage later: every stage takes the place of the one before, the last one is held and
  // its state advanced by the model.
  Iterate shifted(const Iterate& plan) const {
    Iterate next = plan;
    const int keep = variable_count() - kBlock;
    next.z.head(keep) = plan.z.tail(keep);
    next.bound_lower.head(keep) = plan.bound_lower.tail(keep);
    next.bound_upper.head(keep) = plan.bound_upper.tail(keep);
    const int keep_rows = constraint_count() - kStates;
    next.lambda.head(keep_rows) = plan.lambda.tail(keep_rows);
    next.z.segment<kStates>(state_at(N_)) = dynamics(N_ - 1).next(state(plan.z, N_), input(plan.z, N_ - 1));
    return next;
  }

  // Bounds that shape the plan z. The barrier keeps an input off the bound that holds it, by more the less
  // the bound matters; this share of the range is below what valves resolve. Allocates nothing.
  ActiveBounds active_bounds(const Eigen::VectorXd& z) const {
    constexpr double kShare = 0.003;
    ActiveBounds active;
    const Input near = kShare * (input_upper() - input_lower());
    for (int k = 0; k < N_; ++k) {
      const Input u = input(z, k);
      active.inputs += static_cast<int>(((u - input_lower()).array() < near.array()).count() +
                                        ((input_upper() - u).array() < near.array()).count());
      active.states += cost_.active_bounds(padded(state(z, k + 1)), k + 1);
    }
    return active;
  }

  int variable_count() const override { return N_ * kBlock; }
  int constraint_count() const override { return N_ * kStates; }
  std::optional<StageLayout> stage_layout() const override { return StageLayout{N_, kStates, kInputs}; }
  const Eigen::VectorXd& lower_bounds() const override { return lower_; }
  const Eigen::VectorXd& upper_bounds() const override { return upper_; }
  const Sparsity& jacobian_sparsity() const override { return jacobian_sparsity_; }
  const Sparsity& hessian_sparsity() const override { return hessian_sparsity_; }

  double objective(const double* z) const override {
    double sum = 0.0;
    for (int k = 0; k < N_; ++k) {
      const Input u = input_of(z, k) - input_reference(k);
      for (Eigen::Index i = 0; i < facet_limits_.size(); ++i) sum += facet(i, input_of(z, k)).value;
      sum += input_weight_.dot(u.cwiseProduct(u)) + cost_.value(padded(state_of(z, k)), k, false);
    }
    return scale_ * (sum + cost_.value(padded(state_of(z, N_)), N_, true));
  }

  void gradient(const double* z, double* values) const override {
    for (int k = 0; k < N_; ++k) {
      Eigen::Map<Input>(values + input_at(k)) =
          2.0 * scale_ * input_weight_.cwiseProduct(input_of(z, k) - input_reference(k));
      for (Eigen::Index i = 0; i < facet_limits_.size(); ++i)
        Eigen::Map<Input>(values + input_at(k)) +=
            scale_ * facet(i, input_of(z, k)).slope * facet_normals_.row(i).transpose();
      State13<double> g = State13<double>::Zero();
      cost_.add_gradient(padded(state_of(z, k + 1)), k + 1, k + 1 == N_, scale_, g);
      Eigen::Map<State>(values + state_at(k + 1)) = g.template head<kStates>();
    }
  }

  // Row block k: F(x_k, u_k) - x_(k+1).
  void constraints(const double* z, double* values) const override {
    for (int k = 0; k < N_; ++k) {
      Eigen::Map<State>(values + k * kStates) =
          dynamics(k).next(state_of(z, k), input_of(z, k)) - state_of(z, k + 1);
    }
  }

  void jacobian(const double* z, double* values) const override {
    typename Dynamics::Jacobian J;
    for (int k = 0; k < N_; ++k) {
      dynamics(k).jacobian(state_of(z, k), input_of(z, k), J);
      visit_jacobian_block(k, J, [&values](int, int, double value) { *values++ = value; });
    }
  }

  void hessian(const double* z, double objective_factor, const double* lambda,
               double* values) const override {
    typename Dynamics::Hessian S;
    for (int k = 0; k <= N_; ++k) {
      TrackingCost::Hessian H = TrackingCost::Hessian::Zero();
      if (k > 0) cost_.add_hessian(padded(state_of(z, k)), k, k == N_, objective_factor * scale_, H);
      if (k < N_) {
        dynamics(k).hessian(state_of(z, k), input_of(z, k), Eigen::Map<const State>(lambda + k * kStates), S);
        S.template bottomRightCorner<kInputs, kInputs>().diagonal() +=
            2.0 * objective_factor * scale_ * input_weight_;
        for (Eigen::Index i = 0; i < facet_limits_.size(); ++i)
          S.template bottomRightCorner<kInputs, kInputs>() +=
              objective_factor * scale_ * facet(i, input_of(z, k)).curvature *
              facet_normals_.row(i).transpose() * facet_normals_.row(i);
      } else {
        S.setZero();
      }
      visit_hessian_block(k, H, S, [&values](int, int, double value) { *values++ = value; });
    }
  }

  // What the parameters of the problem do to its KKT conditions at a point, weighed with y = [y_z; y_c] of
  // the variables' and the constraints' sizes: y' d(KKT)/d parameter. The disturbance's second derivatives,
  // of second order in the step, are left out.
  struct ParameterSlopes {
    Eigen::Matrix<double, 1, kStates> initial_state;
    Eigen::RowVectorXd disturbance;      // stage by stage, (d_v, d_w) of each
    Eigen::RowVectorXd input_reference;  // stage by stage
  };
  ParameterSlopes parameter_slopes(const Iterate& at, const Eigen::VectorXd& y) const {
    ParameterSlopes slopes;
    typename Dynamics::Jacobian J;
    typename Dynamics::Hessian S;
    dynamics().jacobian(initial_state_, input(at.z, 0), J);
    dynamics().hessian(initial_state_, input(at.z, 0), at.lambda.template head<kStates>(), S);
    const auto y_c0 = y.template segment<kStates>(variable_count());
    slopes.initial_state.setZero();
    slopes.initial_state.template head<kAttitude>() = y_c0.template head<kAttitude>().transpose();
    slopes.initial_state.template segment<3>(state13::kVelocity) +=
        dynamics().step_s() * y_c0.template segment<3>(state13::kPosition).transpose();
    slopes.initial_state.template tail<kCoupled>() =
        y_c0.transpose() * J.template leftCols<kCoupled>() +
        y.template head<kInputs>().transpose() * S.template bottomLeftCorner<kInputs, kCoupled>();
    slopes.disturbance.resize(Eigen::NoChange, 6 * N_);
    slopes.input_reference.resize(Eigen::NoChange, kInputs * N_);
    for (int k = 0; k < N_; ++k) {
      slopes.disturbance.template segment<6>(6 * k) =
          y.template segment<kStates>(variable_count() + k * kStates).transpose() *
          dynamics(k).disturbance_jacobian(state(at.z, k), input(at.z, k));
      slopes.input_reference.template segment<kInputs>(kInputs * k) =
          -2.0 * scale_ * input_weight_.cwiseProduct(y.template segment<kInputs>(input_at(k))).transpose();
    }
    return slopes;
  }

 private:
  static constexpr int kAttitude = state13::kQuaternion;  // what feeds back stands together from here:
  static constexpr int kCoupled = Dynamics::kCoupled;     // (q, w), or q where the rate is an input
  static constexpr int kFree = Dynamics::kFree;

  // The cost's view of a state: without an angular velocity that is no state.
  static State13<double> padded(const State& x) {
    State13<double> all = State13<double>::Zero();
    all.template head<kStates>() = x;
    return all;
  }

  Penalty facet(Eigen::Index i, const Input& u) const {
    return penalty(facet_penalty_, facet_normals_.row(i).dot(u) - facet_limits_[i]);
  }

  static int input_at(int k) { return k * kBlock; }
  static int state_at(int k) { return (k - 1) * kBlock + kInputs; }
  State state_of(const double* z, int k) const {
    return k == 0 ? initial_state_ : State(Eigen::Map<const State>(z + state_at(k)));
  }
  static Eigen::Map<const Input> input_of(const double* z, int k) {
    return Eigen::Map<const Input>(z + input_at(k));
  }

  // Calls visit(row, column, value) for every structural non-zero of row block k, always in the same order.
  template <class Visit>
  void visit_jacobian_block(int k, const typename Dynamics::Jacobian& J, const Visit& visit) const {
    const int row0 = k * kStates;
    for (int r = 0; r < kStates; ++r) {
      if (k > 0) {
        if (r < kAttitude) visit(row0 + r, state_at(k) + r, 1.0);
        if (r < state13::kVelocity)
          visit(row0 + r, state_at(k) + state13::kVelocity + r, dynamics().step_s());
        // Euler's equation does not know the attitude.
        for (int c = r < state13::kAngularVelocity ? 0 : 4; c < kCoupled; ++c)
          visit(row0 + r, state_at(k) + kAttitude + c, J(r, c));
      }
      for (int c = 0; c < kInputs; ++c) visit(row0 + r, input_at(k) + c, J(r, kCoupled + c));
      visit(row0 + r, state_at(k + 1) + r, -1.0);
    }
  }

  // The same for the lower triangle of the Hessian's block of (x_k, u_k): H of the cost, S of cost and
  // dynamics over (q, w, u). Stage 0 has only u0; the last stage has only xN, where the terminal weight
  // couples every direction.
  template <class Visit>
  void visit_hessian_block(int k, const TrackingCost::Hessian& H, const typename Dynamics::Hessian& S,
                           const Visit& visit) const {
    if (k == N_) {
      for (int r = 0; r < kStates; ++r) {
        for (int c = 0; c <= r; ++c) visit(state_at(k) + r, state_at(k) + c, H(r, c));
      }
      return;
    }
    if (k > 0) {
      for (int r = 0; r < kAttitude; ++r) visit(state_at(k) + r, state_at(k) + r, H(r, r));
      visit(state_at(k) + 1, state_at(k), H(1, 0));  // walls and obstacles
      for (int r = 0; r < kCoupled; ++r) {
        for (int c = 0; c <= r; ++c)
          visit(state_at(k) + kAttitude + r, state_at(k) + kAttitude + c,
                H(kAttitude + r, kAttitude + c) + S(r, c));
      }
      for (int r = kCoupled; r < kFree; ++r) {
        for (int c = 0; c < kCoupled; ++c)
          visit(input_at(k) + r - kCoupled, state_at(k) + kAttitude + c, S(r, c));
      }
    }
    for (int r = kCoupled; r < kFree; ++r) {
      for (int c = kCoupled; c <= r; ++c)
        visit(input_at(k) + r - kCoupled, input_at(k) + c - kCoupled, S(r, c));
    }
  }

  void declare_jacobian() {
    const typename Dynamics::Jacobian J = Dynamics::Jacobian::Zero();
    for (int k = 0; k < N_; ++k)
      visit_jacobian_block(k, J,
                           [this](int row, int column, double) { jacobian_sparsity_.add(row, column); });
  }
  void declare_hessian() {
    const TrackingCost::Hessian H = TrackingCost::Hessian::Zero();
    const typename Dynamics::Hessian S = Dynamics::Hessian::Zero();
    for (int k = 0; k <= N_; ++k)
      visit_hessian_block(k, H, S,
                          [this](int row, int column, double) { hessian_sparsity_.add(row, column); });
  }

  std::vector<Dynamics> dynamics_;  // one per stage
  TrackingCost cost_;
  int N_;
  Input input_weight_;
  std::vector<Input> input_reference_;  // one per stage
  Eigen::Matrix<double, Eigen::Dynamic, kInputs> facet_normals_;
  Eigen::VectorXd facet_limits_;
  SoftBounds facet_penalty_{};
  double scale_;
  State initial_state_;
  Eigen::VectorXd lower_, upper_;
  Sparsity jacobian_sparsity_, hessian_sparsity_;
};

}  // namespace atmos
