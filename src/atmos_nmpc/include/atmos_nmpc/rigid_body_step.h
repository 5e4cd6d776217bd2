// One Runge-Kutta step of the 13-state rigid body under NU inputs held over the step (paper, ctl:da with D
// and L; ctl:wrench is the same with unit matrices), with its exact first and second derivatives.
//
// Position and velocity do not feed back, and the force law is a polynomial: with s = (q, w), the four stage
// slopes are k(s, u) = (1/2 Xi(q) w, I^-1 (L u - w x I w)) and a(s, u) = R(q) D u / m. So derivatives are
// carried with respect to the 7 + NU quantities (q, w, u) only (rigid_body_derivatives.h), and the Hessian of
// lambda' x+ is the sum over the four stages of Y' M Y, where Y is the stage point's Jacobian and M the
// (sparse) Hessian of k and a weighted with the adjoint of that stage.
#pragma once

#include <Eigen/Core>
#include <Eigen/QR>

#include "atmos_model/rigid_body.h"
#include "atmos_nmpc/rigid_body_derivatives.h"

namespace atmos {

// Accelerations that no input causes: d_v (world, m/s^2) and d_w (body, rad/s^2).
struct Disturbance {
  Vec3<double> acceleration_W = Vec3<double>::Zero();
  Vec3<double> angular_acceleration_B = Vec3<double>::Zero();
};

// How a reference moves: accelerations that inputs must cause, and the rate it turns with.
struct Motion {
  Vec3<double> acceleration_W = Vec3<double>::Zero();          // m/s^2
  Vec3<double> rate_B = Vec3<double>::Zero();                  // rad/s
  Vec3<double> angular_acceleration_B = Vec3<double>::Zero();  // rad/s^2
};

template <int NU>
class RigidBodyStep {
 public:
  static constexpr int kStates = state13::kSize;
  static constexpr int kInputs = NU;
  static constexpr int kCoupled = 7;           // (q, w): a step is linear in position and velocity
  static constexpr int kFree = kCoupled + NU;  // (q, w, u)
  using State = State13<double>;
  using Input = Eigen::Matrix<double, NU, 1>;
  using Jacobian = Eigen::Matrix<double, kStates, kFree>;
  using Hessian = Eigen::Matrix<double, kFree, kFree>;
  using DisturbanceJacobian = Eigen::Matrix<double, kStates, 6>;

  // D, L: body force [N] and torque [N m] per unit of input; mass [kg], principal inertia [kg m^2], step [s].
  RigidBodyStep(const Eigen::Matrix<double, 3, NU>& D, const Eigen::Matrix<double, 3, NU>& L, double mass,
                const Eigen::Vector3d& inertia, double step_s)
      : D_over_m_(D / mass), h_(step_s) {
    L_over_I_ = inertia.cwiseInverse().asDiagonal() * L;
    euler_ << (inertia[2] - inertia[1]) / inertia[0], (inertia[0] - inertia[2]) / inertia[1],
        (inertia[1] - inertia[0]) / inertia[2];
    Eigen::Matrix<double, 6, NU> effect;
    effect << D_over_m_, L_over_I_;
    inverse_effect_ = effect.completeOrthogonalDecomposition().pseudoInverse();
    derivatives_.step_s = step_s;
    Eigen::Vector3d::Map(derivatives_.euler) = euler_;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < NU; ++c) {
        derivatives_.D[r][kCoupled + c] = D_over_m_(r, c);
        derivatives_.L[r][kCoupled + c] = L_over_I_(r, c);
      }
    }
  }

  double step_s() const { return h_; }

  // Accelerations that act besides the inputs, constant over the step (paper, ctl:disturbance_wrench).
  void set_disturbance(const Disturbance& disturbance) { disturbance_ = disturbance; }
  const Disturbance& disturbance() const { return disturbance_; }

  // The inputs under which a body with attitude q moves so against the disturbance, as nearly as they can and
  // of least norm.
  Input moving_input(const Quaternion4<double>& q, const Motion& motion) const {
    const Vec3<double>& w = motion.rate_B;
    Eigen::Matrix<double, 6, 1> needed;
    needed << rotate<double>({q[0], -q[1], -q[2], -q[3]},
                             motion.acceleration_W - disturbance_.acceleration_W),
        motion.angular_acceleration_B - disturbance_.angular_acceleration_B +
            euler_.cwiseProduct(Vec3<double>(w[1] * w[2], w[2] * w[0], w[0] * w[1]));
    return inverse_effect_ * needed;
  }
  // The same for a body at rest.
  Input holding_input(const Quaternion4<double>& q) const { return moving_input(q, {}); }

  // The state after one step.
  State next(const State& x, const Input& u) const {
    Stages stages;
    forward(x, u, stages);
    return assemble(x, stages);
  }

  // d x+ / d (q, w, u). The other columns are known: d x+ / d p = unit, d p+ / d v = step, d v+ / d v = unit.
  void jacobian(const State& x, const Input& u, Jacobian& J) const {
    Rows<kStates> rows;
    rigid_body::jacobian(derivatives_, start(x, u), rows.values);
    J = rows.template columns<0, kFree>();
  }

  // d x+ / d (d_v, d_w), of the disturbance.
  DisturbanceJacobian disturbance_jacobian(const State& x, const Input& u) const {
    rigid_body::Coefficients instead;  // d_w in place of the inputs
    instead.step_s = h_;
    Eigen::Vector3d::Map(instead.euler) = euler_;
    for (int r = 0; r < 3; ++r) instead.L[r][kCoupled + r] = 1.0;
    Rows<kStates> rows;
    rigid_body::jacobian(instead, start(x, u), rows.values);
    DisturbanceJacobian J = DisturbanceJacobian::Zero();
    J.template block<3, 3>(state13::kPosition, 0).diagonal().setConstant(0.5 * h_ * h_);
    J.template block<3, 3>(state13::kVelocity, 0).diagonal().setConstant(h_);
    J.template rightCols<3>() = rows.template columns<kCoupled, 3>();
    return J;
  }

  // Hessian of lambda' x+ with respect to (q, w, u); both triangles are filled.
  void hessian(const State& x, const Input& u, const State& lambda, Hessian& H) const {
    Rows<rigid_body::kColumns> rows;
    rigid_body::hessian(derivatives_, start(x, u), lambda.data(), rows.values);
    H = rows.template columns<0, kFree>().template topRows<kFree>();
  }

 private:
  static_assert(NU <= rigid_body::kMostInputs);

  template <int kCount>
  struct Rows {
    double values[kCount][rigid_body::kColumns];
    template <int kFirst, int kWide>
    auto columns() const {
      return Eigen::Map<const Eigen::Matrix<double, kCount, rigid_body::kColumns, Eigen::RowMajor>>(values[0])
          .template middleCols<kWide>(kFirst);
    }
  };

  rigid_body::Start start(const State& x, const Input& u) const {
    rigid_body::Start at;
    Eigen::Vector4d::Map(at.q) = x.template segment<4>(state13::kQuaternion);
    Eigen::Vector3d::Map(at.w) = x.template segment<3>(state13::kAngularVelocity);
    Eigen::Vector3d::Map(at.force).noalias() = D_over_m_ * u;
    Eigen::Vector3d::Map(at.torque) = disturbance_.angular_acceleration_B + L_over_I_ * u;
    return at;
  }

  struct Stages {
    Quaternion4<double> q[4];
    Vec3<double> w[4];
    Eigen::Matrix<double, 7, 1> k[4];
    Vec3<double> a[4];
    Vec3<double> f;    // D u / m, body
    Vec3<double> tau;  // I^-1 L u + d_w
  };

  // x+ = x + sum of slope_weight(i) k_i; stage i starts at s + point_weight(i) k_(i-1); position gains
  // position_weight(i) a_i.
  double slope_weight(int i) const { return h_ / 6.0 * (i == 0 || i == 3 ? 1.0 : 2.0); }
  double point_weight(int i) const { return i == 3 ? h_ : 0.5 * h_; }
  double position_weight(int i) const { return i == 3 ? 0.0 : h_ * h_ / 6.0; }

  void forward(const State& x, const Input& u, Stages& stages) const {
    stages.f.noalias() = D_over_m_ * u;
    stages.tau = disturbance_.angular_acceleration_B + L_over_I_ * u;
    for (int i = 0; i < 4; ++i) {
      Eigen::Matrix<double, 7, 1> s = x.segment<7>(state13::kQuaternion);
      if (i > 0) s += point_weight(i) * stages.k[i - 1];
      stages.q[i] = s.head<4>();
      stages.w[i] = s.tail<3>();
      const Vec3<double>& w = stages.w[i];
      stages.k[i].template head<4>() = quaternion_rate<double>(stages.q[i], w);
      stages.k[i].template tail<3>() =
          stages.tau - euler_.cwiseProduct(Vec3<double>(w[1] * w[2], w[2] * w[0], w[0] * w[1]));
      stages.a[i] = rotate<double>(stages.q[i], stages.f);
    }
  }

  State assemble(const State& x, const Stages& stages) const {
    State result = x;
    result.segment<3>(state13::kPosition) +=
        h_ * x.segment<3>(state13::kVelocity) + 0.5 * h_ * h_ * disturbance_.acceleration_W;
    result.segment<3>(state13::kVelocity) += h_ * disturbance_.acceleration_W;
    for (int i = 0; i < 4; ++i) {
      result.segment<3>(state13::kPosition) += position_weight(i) * stages.a[i];
      result.segment<3>(state13::kVelocity) += slope_weight(i) * stages.a[i];
      result.segment<7>(state13::kQuaternion) += slope_weight(i) * stages.k[i];
    }
    return result;
  }

  Eigen::Matrix<double, 3, NU> D_over_m_;
  Eigen::Matrix<double, 3, NU> L_over_I_;
  Eigen::Matrix<double, NU, 6> inverse_effect_;  // of D / m over I^-1 L, least squares and least norm
  Eigen::Vector3d euler_;  // (w x I w) / I, component i: euler_[i] times the product of the other two rates
  double h_;
  Disturbance disturbance_;
  rigid_body::Coefficients derivatives_;
};

}  // namespace atmos
