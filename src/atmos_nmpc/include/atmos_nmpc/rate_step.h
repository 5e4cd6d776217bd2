// One step of the paper's body force and angular rate (ctl:rate) in the plane: the inputs are the force along
// body x and y and the rate about body z, both held over the step; the state has no angular velocity.
//
// It is the rigid body without torque whose angular velocity is an input: the step and its derivatives are
// those of RigidBodyStep<2>, with the columns of the rate moved to the inputs.
#pragma once

#include "atmos_nmpc/rigid_body_step.h"

namespace atmos {

class RateStep {
 public:
  static constexpr int kStates = state13::kAngularVelocity;  // p, v, q
  static constexpr int kInputs = 3;                          // f_x, f_y [N], w_z [rad/s]
  static constexpr int kCoupled = 4;                         // q
  static constexpr int kFree = kCoupled + kInputs;
  using State = Eigen::Matrix<double, kStates, 1>;
  using Input = Eigen::Matrix<double, kInputs, 1>;
  using Jacobian = Eigen::Matrix<double, kStates, kFree>;
  using Hessian = Eigen::Matrix<double, kFree, kFree>;
  using DisturbanceJacobian = Eigen::Matrix<double, kStates, 6>;

  // mass [kg], step [s].
  RateStep(double mass, double step_s)
      : body_(Eigen::Matrix<double, 3, 2>::Identity(), Eigen::Matrix<double, 3, 2>::Zero(), mass,
              Eigen::Vector3d::Ones(), step_s) {}

  double step_s() const { return body_.step_s(); }

  // Only d_v acts: the rate is what the input says (paper: "does not allow disturbances in the attitude
  // dynamics").
  void set_disturbance(const Disturbance& disturbance) {
    body_.set_disturbance({disturbance.acceleration_W, Vec3<double>::Zero()});
  }

  const Disturbance& disturbance() const { return body_.disturbance(); }

  // The inputs under which a body with attitude q accelerates with a_W [m/s^2] and turns with w_B [rad/s].
  Input moving_input(const Quaternion4<double>& q, const Motion& motion) const {
    Input input;
    input << body_.moving_input(q, motion), motion.rate_B[2];
    return input;
  }

  State next(const State& x, const Input& u) const {
    return body_.next(with_rate(x, u), u.head<2>()).template head<kStates>();
  }

  void jacobian(const State& x, const Input& u, Jacobian& J) const {
    RigidBodyStep<2>::Jacobian of_body;
    body_.jacobian(with_rate(x, u), u.head<2>(), of_body);
    for (int c = 0; c < kFree; ++c) J.col(c) = of_body.col(kColumns[c]).template head<kStates>();
  }

  // d x+ / d (d_v, d_w), of the disturbance.
  DisturbanceJacobian disturbance_jacobian(const State& x, const Input& u) const {
    DisturbanceJacobian J =
        body_.disturbance_jacobian(with_rate(x, u), u.head<2>()).template topRows<kStates>();
    J.rightCols<3>().setZero();
    return J;
  }

  void hessian(const State& x, const Input& u, const State& lambda, Hessian& H) const {
    State13<double> of_states = State13<double>::Zero();
    of_states.head<kStates>() = lambda;
    RigidBodyStep<2>::Hessian of_body;
    body_.hessian(with_rate(x, u), u.head<2>(), of_states, of_body);
    for (int r = 0; r < kFree; ++r) {
      for (int c = 0; c < kFree; ++c) H(r, c) = of_body(kColumns[r], kColumns[c]);
    }
  }

 private:
  // Where (q, f, w_z) stand among the body's (q, w, f).
  static constexpr int kColumns[kFree] = {0, 1, 2, 3, 7, 8, 6};

  static State13<double> with_rate(const State& x, const Input& u) {
    State13<double> all = State13<double>::Zero();
    all.head<kStates>() = x;
    all[state13::kAngularVelocity + 2] = u[2];
    return all;
  }

  RigidBodyStep<2> body_;
};

}  // namespace atmos
