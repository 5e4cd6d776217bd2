// One Runge-Kutta step of the 13-state rigid body under NU inputs held over the step (paper, ctl:da with D
// and L; ctl:wrench is the same with unit matrices), with its exact first and second derivatives.
//
// Position and velocity do not feed back, and the force law is a polynomial: with s = (q, w), the four stage
// slopes are k(s, u) = (1/2 Xi(q) w, I^-1 (L u - w x I w)) and a(s, u) = R(q) D u / m. So derivatives are
// carried with respect to the 7 + NU quantities (q, w, u) only, and the Hessian of lambda' x+ is the sum over
// the four stages of Y' M Y, where Y is the stage point's Jacobian and M the (sparse) Hessian of k and a
// weighted with the adjoint of that stage.
#pragma once

#include <Eigen/Core>
#include <Eigen/QR>

#include "atmos_model/rigid_body.h"

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
    Stages stages;
    forward(x, u, stages);
    Sensitivities Y;
    J.setZero();
    Eigen::Matrix<double, 7, kFree> slope;
    Eigen::Matrix<double, 3, kFree> acceleration;
    for (int i = 0; i < 4; ++i) {
      stage_point_sensitivity(i, slope, Y[i]);
      stage_slope_sensitivity(stages, i, Y[i], slope);
      acceleration.noalias() = force_jacobian_q(stages.q[i], stages.f) * Y[i].template topRows<4>();
      acceleration.template rightCols<NU>() += rotated_D(stages.q[i]);
      J.template middleRows<3>(state13::kPosition) += position_weight(i) * acceleration;
      J.template middleRows<3>(state13::kVelocity) += slope_weight(i) * acceleration;
      J.template middleRows<7>(state13::kQuaternion) += slope_weight(i) * slope;
    }
    J.template block<7, 7>(state13::kQuaternion, 0).diagonal().array() += 1.0;
  }

  // d x+ / d (d_v, d_w), of the disturbance.
  DisturbanceJacobian disturbance_jacobian(const State& x, const Input& u) const {
    Stages stages;
    forward(x, u, stages);
    DisturbanceJacobian J = DisturbanceJacobian::Zero();
    J.template block<3, 3>(state13::kPosition, 0).diagonal().setConstant(0.5 * h_ * h_);
    J.template block<3, 3>(state13::kVelocity, 0).diagonal().setConstant(h_);
    Eigen::Matrix<double, 7, 3> Y = Eigen::Matrix<double, 7, 3>::Zero(), slope;
    for (int i = 0; i < 4; ++i) {
      if (i > 0) Y = point_weight(i) * slope;
      slope.template topRows<4>() = rate_jacobian_q(stages.w[i]) * Y.template topRows<4>() +
                                    rate_jacobian_w(stages.q[i]) * Y.template bottomRows<3>();
      slope.template bottomRows<3>() =
          euler_jacobian(stages.w[i]) * Y.template bottomRows<3>() + Eigen::Matrix3d::Identity();
      const Eigen::Matrix3d acceleration = force_jacobian_q(stages.q[i], stages.f) * Y.template topRows<4>();
      J.template block<3, 3>(state13::kPosition, 3) += position_weight(i) * acceleration;
      J.template block<3, 3>(state13::kVelocity, 3) += slope_weight(i) * acceleration;
      J.template block<7, 3>(state13::kQuaternion, 3) += slope_weight(i) * slope;
    }
    return J;
  }

  // Hessian of lambda' x+ with respect to (q, w, u); both triangles are filled.
  void hessian(const State& x, const Input& u, const State& lambda, Hessian& H) const {
    Stages stages;
    forward(x, u, stages);
    Sensitivities Y;
    Eigen::Matrix<double, 7, kFree> slope;
    for (int i = 0; i < 4; ++i) {
      stage_point_sensitivity(i, slope, Y[i]);
      if (i < 3) stage_slope_sensitivity(stages, i, Y[i], slope);
    }

    H.setZero();
    const Vec3<double> lambda_p = lambda.segment<3>(state13::kPosition);
    const Vec3<double> lambda_v = lambda.segment<3>(state13::kVelocity);
    const Eigen::Matrix<double, 7, 1> lambda_s = lambda.segment<7>(state13::kQuaternion);
    Eigen::Matrix<double, 7, 1> sigma =
        Eigen::Matrix<double, 7, 1>::Zero();  // adjoint of the next stage's point
    Eigen::Matrix<double, 4, kFree> weighted;
    for (int i = 3; i >= 0; --i) {
      // Weight of this stage's slopes k and a in lambda' x+, through the end point and through later stages.
      Eigen::Matrix<double, 7, 1> kappa = slope_weight(i) * lambda_s;
      if (i < 3) kappa += point_weight(i + 1) * sigma;
      const Vec3<double> alpha = slope_weight(i) * lambda_v + position_weight(i) * lambda_p;
      const Quaternion4<double> kappa_q = kappa.head<4>();
      const Vec3<double> kappa_w = kappa.tail<3>();

      const auto Q = Y[i].template topRows<4>();
      const auto W = Y[i].template bottomRows<3>();
      const Eigen::Matrix4d M_qq = rotation_form(alpha, stages.f);
      weighted.noalias() = 0.5 * M_qq * Q;
      weighted.noalias() += rate_cross_form(kappa_q) * W;
      for (int j = 0; j < NU; ++j) {
        const Vec3<double> d = D_over_m_.col(j);
        weighted.col(7 + j) += rotation_form(alpha, d) * stages.q[i];
      }
      // lazyProduct: at these sizes Eigen's general product spends most of its time on packing.
      const Eigen::Matrix<double, kFree, kFree> half = Q.transpose().lazyProduct(weighted);
      H += half + half.transpose();
      const Eigen::Matrix3d M_ww = euler_form(kappa_w);
      const Eigen::Matrix<double, 3, kFree> M_W = M_ww * W;
      H += W.transpose().lazyProduct(M_W);

      sigma = slope_adjoint(stages, i, kappa);
      sigma.template head<4>() += M_qq * stages.q[i];
    }
  }

 private:
  struct Stages {
    Quaternion4<double> q[4];
    Vec3<double> w[4];
    Eigen::Matrix<double, 7, 1> k[4];
    Vec3<double> a[4];
    Vec3<double> f;    // D u / m, body
    Vec3<double> tau;  // I^-1 L u + d_w
  };
  using Sensitivities = Eigen::Matrix<double, 7, kFree>[4];

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

  // d s_i / d (q, w, u); `previous` is d k_(i-1) / d (q, w, u).
  void stage_point_sensitivity(int i, const Eigen::Matrix<double, 7, kFree>& previous,
                               Eigen::Matrix<double, 7, kFree>& Y) const {
    if (i > 0) {
      Y = point_weight(i) * previous;
    } else {
      Y.setZero();
    }
    Y.template leftCols<7>().diagonal().array() += 1.0;
  }

  // d k_i / d (q, w, u).
  void stage_slope_sensitivity(const Stages& stages, int i, const Eigen::Matrix<double, 7, kFree>& Y,
                               Eigen::Matrix<double, 7, kFree>& slope) const {
    slope.template topRows<4>().noalias() = rate_jacobian_q(stages.w[i]) * Y.template topRows<4>();
    slope.template topRows<4>().noalias() += rate_jacobian_w(stages.q[i]) * Y.template bottomRows<3>();
    slope.template bottomRows<3>().noalias() = euler_jacobian(stages.w[i]) * Y.template bottomRows<3>();
    slope.template bottomRows<3>().template rightCols<NU>() += L_over_I_;
  }

  // (d k_i / d s)' kappa.
  Eigen::Matrix<double, 7, 1> slope_adjoint(const Stages& stages, int i,
                                            const Eigen::Matrix<double, 7, 1>& kappa) const {
    Eigen::Matrix<double, 7, 1> sigma;
    sigma.template head<4>() = rate_jacobian_q(stages.w[i]).transpose() * kappa.template head<4>();
    sigma.template tail<3>() = rate_jacobian_w(stages.q[i]).transpose() * kappa.template head<4>() +
                               euler_jacobian(stages.w[i]).transpose() * kappa.template tail<3>();
    return sigma;
  }

  // q' = 1/2 q * (0, w) by q and by w.
  static Eigen::Matrix4d rate_jacobian_q(const Vec3<double>& w) {
    Eigen::Matrix4d J;
    J << 0, -w[0], -w[1], -w[2], w[0], 0, w[2], -w[1], w[1], -w[2], 0, w[0], w[2], w[1], -w[0], 0;
    return 0.5 * J;
  }
  static Eigen::Matrix<double, 4, 3> rate_jacobian_w(const Quaternion4<double>& q) {
    Eigen::Matrix<double, 4, 3> J;
    J << -q[1], -q[2], -q[3], q[0], -q[3], q[2], q[3], q[0], -q[1], -q[2], q[1], q[0];
    return 0.5 * J;
  }
  // d2 (kappa' q') / dq dw.
  static Eigen::Matrix<double, 4, 3> rate_cross_form(const Quaternion4<double>& k) {
    Eigen::Matrix<double, 4, 3> M;
    M << k[1], k[2], k[3], -k[0], k[3], -k[2], -k[3], -k[0], k[1], k[2], -k[1], -k[0];
    return 0.5 * M;
  }
  Eigen::Matrix3d euler_jacobian(const Vec3<double>& w) const {
    Eigen::Matrix3d J;
    J << 0, euler_[0] * w[2], euler_[0] * w[1], euler_[1] * w[2], 0, euler_[1] * w[0], euler_[2] * w[1],
        euler_[2] * w[0], 0;
    return -J;
  }
  Eigen::Matrix3d euler_form(const Vec3<double>& k) const {
    const Vec3<double> c = -k.cwiseProduct(euler_);
    Eigen::Matrix3d M;
    M << 0, c[2], c[1], c[2], 0, c[0], c[1], c[0], 0;
    return M;
  }
  // The matrix B with alpha' R(q) f = alpha' f + 1/2 q' B q.
  static Eigen::Matrix4d rotation_form(const Vec3<double>& alpha, const Vec3<double>& f) {
    const Eigen::Matrix3d S = 2.0 * alpha * f.transpose();
    Eigen::Matrix4d B;
    B << 0, S(2, 1) - S(1, 2), S(0, 2) - S(2, 0), S(1, 0) - S(0, 1),                        //
        S(2, 1) - S(1, 2), -2 * (S(1, 1) + S(2, 2)), S(0, 1) + S(1, 0), S(0, 2) + S(2, 0),  //
        S(0, 2) - S(2, 0), S(0, 1) + S(1, 0), -2 * (S(0, 0) + S(2, 2)), S(1, 2) + S(2, 1),  //
        S(1, 0) - S(0, 1), S(0, 2) + S(2, 0), S(1, 2) + S(2, 1), -2 * (S(0, 0) + S(1, 1));
    return B;
  }
  // d R(q) f / dq.
  static Eigen::Matrix<double, 3, 4> force_jacobian_q(const Quaternion4<double>& q, const Vec3<double>& f) {
    Eigen::Matrix<double, 3, 4> J;
    for (int r = 0; r < 3; ++r) J.row(r) = (rotation_form(Vec3<double>::Unit(r), f) * q).transpose();
    return J;
  }
  Eigen::Matrix<double, 3, NU> rotated_D(const Quaternion4<double>& q) const {
    Eigen::Matrix<double, 3, NU> R_D;
    for (int j = 0; j < NU; ++j) R_D.col(j) = rotate<double>(q, D_over_m_.col(j));
    return R_D;
  }

  Eigen::Matrix<double, 3, NU> D_over_m_;
  Eigen::Matrix<double, 3, NU> L_over_I_;
  Eigen::Matrix<double, NU, 6> inverse_effect_;  // of D / m over I^-1 L, least squares and least norm
  Eigen::Vector3d euler_;  // (w x I w) / I, component i: euler_[i] times the product of the other two rates
  double h_;
  Disturbance disturbance_;
};

}  // namespace atmos
