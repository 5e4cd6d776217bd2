// The robot in the plane: the quantities that effects, simulator, predictor and diagnosis work on.
// World W is ENU, body B is FLU; C is the centre of mass, O the geometric centre (base_link).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

namespace atmos {

template <class S>
using Vec2 = Eigen::Matrix<S, 2, 1>;

// R(yaw): body to world.
template <class S>
Eigen::Matrix<S, 2, 2> rotation_WB(const S& yaw) {
  using std::cos;
  using std::sin;
  Eigen::Matrix<S, 2, 2> R;
  R << cos(yaw), -sin(yaw), sin(yaw), cos(yaw);
  return R;
}

// z component of a x b.
template <class A, class B>
auto cross2(const Eigen::MatrixBase<A>& a, const Eigen::MatrixBase<B>& b) {
  return a.x() * b.y() - a.y() * b.x();
}

// Velocity of a point fixed in the body at r_W (world axes) from a point with velocity v_W.
template <class S>
Vec2<S> point_velocity(const Vec2<S>& v_W, const S& yaw_rate, const Vec2<S>& r_W) {
  return v_W + yaw_rate * Vec2<S>(-r_W.y(), r_W.x());
}

// Angle wrapped to [-pi, pi].
inline double wrap_angle(double angle) { return std::remainder(angle, 2.0 * M_PI); }

template <class S>
struct PlanarPose {
  Vec2<S> p_W = Vec2<S>::Zero();  // m
  S yaw = S(0);                   // rad
};

// Motion of the centre of mass.
template <class S>
struct PlanarState {
  Vec2<S> p_WC = Vec2<S>::Zero();  // m
  S yaw = S(0);                    // rad, not wrapped
  Vec2<S> v_WC = Vec2<S>::Zero();  // m/s, world axes
  S yaw_rate = S(0);               // rad/s
};

// Force at and torque about the centre of mass.
template <class S>
struct PlanarWrench {
  Vec2<S> force_W = Vec2<S>::Zero();  // N, world axes
  S torque = S(0);                    // N m

  // A force that acts at r_W (world axes) from the centre of mass.
  void add_force_at(const Vec2<S>& f_W, const Vec2<S>& r_W) {
    force_W += f_W;
    torque += cross2(r_W, f_W);
  }
};

template <class S>
struct PlanarAcceleration {
  Vec2<S> a_WC = Vec2<S>::Zero();  // m/s^2, world axes
  S yaw_acceleration = S(0);       // rad/s^2
};

// Motion of another point of the body: that at r_B (body axes) from the point whose motion `state` is.
template <class S>
PlanarState<S> moved_by(const PlanarState<S>& state, const Eigen::Vector2d& r_B) {
  const Vec2<S> r_W = rotation_WB(state.yaw) * r_B.cast<S>();
  PlanarState<S> moved = state;
  moved.p_WC += r_W;
  moved.v_WC = point_velocity(state.v_WC, state.yaw_rate, r_W);
  return moved;
}

// Centre of mass from the geometric centre and back; com_B is C from O in the body.
template <class S>
PlanarState<S> center_of_mass_state(const PlanarState<S>& at_O, const Eigen::Vector2d& com_B) {
  return moved_by<S>(at_O, com_B);
}

template <class S>
PlanarState<S> geometric_center_state(const PlanarState<S>& at_C, const Eigen::Vector2d& com_B) {
  return moved_by<S>(at_C, -com_B);
}

}  // namespace atmos
