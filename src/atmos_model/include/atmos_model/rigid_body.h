// Rigid body in space, templated on the scalar (paper, ctl:da and ctl:wrench). Hamilton quaternions, body to
// world; Euler's equation is I w' = tau - w x I w (the paper prints another sign).
#pragma once

#include <Eigen/Core>

namespace atmos {

// Indices into the 13-state: position p_WC [m], velocity v_WC [m/s, world axes], attitude q_WB (w, x, y, z),
// angular velocity w_WB_B [rad/s, body axes].
namespace state13 {
enum Index { kPosition = 0, kVelocity = 3, kQuaternion = 6, kAngularVelocity = 10, kSize = 13 };
}

template <class S>
using State13 = Eigen::Matrix<S, state13::kSize, 1>;
template <class S>
using Vec3 = Eigen::Matrix<S, 3, 1>;
template <class S>
using Quaternion4 = Eigen::Matrix<S, 4, 1>;  // w, x, y, z

// R(q) v for a quaternion that need not be of unit length exactly (as an optimiser's iterate is not).
template <class S>
Vec3<S> rotate(const Quaternion4<S>& q, const Vec3<S>& v_B) {
  const S w = q[0], x = q[1], y = q[2], z = q[3];
  Vec3<S> v_W;
  v_W[0] = (S(1) - S(2) * (y * y + z * z)) * v_B[0] + S(2) * (x * y - w * z) * v_B[1] +
           S(2) * (x * z + w * y) * v_B[2];
  v_W[1] = S(2) * (x * y + w * z) * v_B[0] + (S(1) - S(2) * (x * x + z * z)) * v_B[1] +
           S(2) * (y * z - w * x) * v_B[2];
  v_W[2] = S(2) * (x * z - w * y) * v_B[0] + S(2) * (y * z + w * x) * v_B[1] +
           (S(1) - S(2) * (x * x + y * y)) * v_B[2];
  return v_W;
}

// q' = 1/2 q * (0, w).
template <class S>
Quaternion4<S> quaternion_rate(const Quaternion4<S>& q, const Vec3<S>& w_B) {
  Quaternion4<S> rate;
  rate[0] = S(0.5) * (-q[1] * w_B[0] - q[2] * w_B[1] - q[3] * w_B[2]);
  rate[1] = S(0.5) * (q[0] * w_B[0] + q[2] * w_B[2] - q[3] * w_B[1]);
  rate[2] = S(0.5) * (q[0] * w_B[1] - q[1] * w_B[2] + q[3] * w_B[0]);
  rate[3] = S(0.5) * (q[0] * w_B[2] + q[1] * w_B[1] - q[2] * w_B[0]);
  return rate;
}

// Time derivative under a force [N] and a torque [N m] in body axes at the centre of mass; inertia: principal
// moments.
template <class S>
State13<S> rigid_body_rate(const State13<S>& x, const Vec3<S>& force_B, const Vec3<S>& torque_B,
                           const S& mass, const Eigen::Vector3d& inertia) {
  using namespace state13;
  const Quaternion4<S> q = x.template segment<4>(kQuaternion);
  const Vec3<S> w = x.template segment<3>(kAngularVelocity);
  State13<S> rate;
  rate.template segment<3>(kPosition) = x.template segment<3>(kVelocity);
  rate.template segment<3>(kVelocity) = rotate<S>(q, force_B) / mass;
  rate.template segment<4>(kQuaternion) = quaternion_rate<S>(q, w);
  const Vec3<S> Iw(w[0] * inertia[0], w[1] * inertia[1], w[2] * inertia[2]);
  rate[kAngularVelocity + 0] = (torque_B[0] - (w[1] * Iw[2] - w[2] * Iw[1])) / inertia[0];
  rate[kAngularVelocity + 1] = (torque_B[1] - (w[2] * Iw[0] - w[0] * Iw[2])) / inertia[1];
  rate[kAngularVelocity + 2] = (torque_B[2] - (w[0] * Iw[1] - w[1] * Iw[0])) / inertia[2];
  return rate;
}

// One classical Runge-Kutta step of x' = f(x); f returns a State of the same type.
template <class State, class S, class F>
State rk4_step(const State& x, const S& dt, const F& f) {
  const State k1 = f(x);
  const State k2 = f(State(x + S(dt / 2.0) * k1));
  const State k3 = f(State(x + S(dt / 2.0) * k2));
  const State k4 = f(State(x + dt * k3));
  return x + S(dt / 6.0) * (k1 + S(2) * k2 + S(2) * k3 + k4);
}

}  // namespace atmos
