#include "atmos_nmpc/disturbance_observer.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "atmos_model/allocator.h"

namespace atmos {

namespace {

using namespace observer_error;
using state13::kQuaternion;

constexpr double kMaxStep = 0.02;  // s

Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d S;
  S << 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0;
  return S;
}

Eigen::Quaterniond attitude_of(const State13<double>& x) {
  return Eigen::Quaterniond(x[kQuaternion], x[kQuaternion + 1], x[kQuaternion + 2], x[kQuaternion + 3]);
}

void set_attitude(State13<double>& x, const Eigen::Quaterniond& q) {
  x.segment<4>(kQuaternion) << q.w(), q.x(), q.y(), q.z();
}

Eigen::Vector3d rotation_vector(const Eigen::Quaterniond& q) {
  const Eigen::AngleAxisd rotation(q.w() < 0.0 ? Eigen::Quaterniond(-q.coeffs()) : q);
  return rotation.angle() * rotation.axis();
}

}  // namespace

ObserverState plus(const ObserverState& state, const ObserverVector& error) {
  ObserverState result = state;
  result.x.segment<3>(state13::kPosition) += error.segment<3>(kPosition);
  result.x.segment<3>(state13::kVelocity) += error.segment<3>(kVelocity);
  result.x.segment<3>(state13::kAngularVelocity) += error.segment<3>(kRate);
  const Eigen::Vector3d turn = error.segment<3>(kAttitude);
  const double angle = turn.norm();
  const Eigen::Quaterniond dq(angle > 0.0 ? Eigen::AngleAxisd(angle, turn / angle)
                                          : Eigen::AngleAxisd::Identity());
  set_attitude(result.x, (attitude_of(state.x) * dq).normalized());
  result.d.acceleration_W += error.segment<3>(kLinear);
  result.d.angular_acceleration_B += error.segment<3>(kAngular);
  return result;
}

ObserverVector minus(const ObserverState& to, const ObserverState& from) {
  ObserverVector error;
  error << to.x.segment<3>(state13::kPosition) - from.x.segment<3>(state13::kPosition),
      to.x.segment<3>(state13::kVelocity) - from.x.segment<3>(state13::kVelocity),
      rotation_vector(attitude_of(from.x).conjugate() * attitude_of(to.x)),
      to.x.segment<3>(state13::kAngularVelocity) - from.x.segment<3>(state13::kAngularVelocity),
      to.d.acceleration_W - from.d.acceleration_W,
      to.d.angular_acceleration_B - from.d.angular_acceleration_B;
  return error;
}

ObserverModel::ObserverModel(const Vehicle& vehicle, const ObserverConfig& config)
    : vehicle_(vehicle), config_(config), thrusters_(thruster_matrices(vehicle)) {
  for (Eigen::Index i = 0; i < thrusters_.D.cols(); ++i) {
    const double force = vehicle.thrusters[static_cast<std::size_t>(i)].force_n;
    thrusters_.D.col(i) *= force;
    thrusters_.L.col(i) *= force;
  }
}

ObserverState ObserverModel::next(const ObserverState& state, const Openings& openings, double dt) const {
  const Vec3<double> force_B = thrusters_.D * openings, torque_B = thrusters_.L * openings;
  ObserverState result = state;
  result.x = rk4_step(state.x, dt, [&](const State13<double>& x) {
    State13<double> rate =
        rigid_body_rate<double>(x, force_B, torque_B, vehicle_.mass_kg, vehicle_.inertia_kg_m2);
    rate.segment<3>(state13::kVelocity) += state.d.acceleration_W;
    rate.segment<3>(state13::kAngularVelocity) += state.d.angular_acceleration_B;
    return rate;
  });
  result.x.segment<4>(kQuaternion).normalize();
  return result;
}

ObserverMatrix ObserverModel::jacobian(const ObserverState& state, const Openings& openings,
                                       double dt) const {
  // Rates of the error state, taken in the middle of the step.
  const ObserverState middle = next(state, openings, 0.5 * dt);
  const Eigen::Matrix3d R_WB = attitude_of(middle.x).toRotationMatrix();
  const Eigen::Vector3d w = middle.x.segment<3>(state13::kAngularVelocity), inertia = vehicle_.inertia_kg_m2;
  const Eigen::Vector3d acceleration_B = thrusters_.D * openings / vehicle_.mass_kg;
  const Eigen::Matrix3d unit = Eigen::Matrix3d::Identity();
  ObserverMatrix A = ObserverMatrix::Zero();
  A.block<3, 3>(kPosition, kVelocity) = unit;
  A.block<3, 3>(kVelocity, kAttitude) = -R_WB * skew(acceleration_B);
  A.block<3, 3>(kVelocity, kLinear) = unit;
  A.block<3, 3>(kAttitude, kAttitude) = -skew(w);
  A.block<3, 3>(kAttitude, kRate) = unit;
  A.block<3, 3>(kRate, kRate) =
      inertia.cwiseInverse().asDiagonal() *
      (skew(inertia.cwiseProduct(w)) - skew(w) * Eigen::Matrix3d(inertia.asDiagonal()));
  A.block<3, 3>(kRate, kAngular) = unit;
  const ObserverMatrix one = ObserverMatrix::Identity(), Adt = A * dt;
  return one + Adt * (one + Adt / 2.0 * (one + Adt / 3.0));
}

ObserverMatrix ObserverModel::noise(const ObserverState& state, const Openings& openings, double dt) const {
  const double period = vehicle_.pwm.period_s;
  const auto square = [](double sigma) { return sigma * sigma; };
  ObserverMatrix Q = ObserverMatrix::Zero();
  // An acceleration of deviation sigma that lasts one period, then takes another value: white noise of
  // density sigma^2 * period.
  Q.diagonal().segment<3>(kVelocity).setConstant(square(config_.acceleration_m_s2) * period * dt);
  Q.diagonal().segment<3>(kRate).setConstant(square(config_.angular_acceleration_rad_s2) * period * dt);
  const Eigen::Matrix3d R_WB = attitude_of(state.x).toRotationMatrix();
  for (Eigen::Index i = 0; i < openings.size(); ++i) {
    if (openings[i] == 0.0) continue;
    ObserverVector push = ObserverVector::Zero();
    push.segment<3>(kVelocity) = R_WB * thrusters_.D.col(i) / vehicle_.mass_kg;
    push.segment<3>(kRate) = thrusters_.L.col(i).cwiseQuotient(vehicle_.inertia_kg_m2);
    Q += square(config_.thrust_error * openings[i]) * period * dt * push * push.transpose();
  }
  Q.diagonal().segment<3>(kLinear).setConstant(square(config_.disturbance_drift_m_s2) * dt);
  Q.diagonal().segment<3>(kAngular).setConstant(square(config_.disturbance_drift_rad_s2) * dt);
  return Q;
}

DisturbanceObserver::DisturbanceObserver(const Vehicle& vehicle, const ObserverConfig& config)
    : config_(config), model_(vehicle, config) {
  const BodyWrench authority = Allocator(vehicle).max_wrench();
  limit_.acceleration_W.setConstant(authority.head<2>().norm() / vehicle.mass_kg);
  limit_.angular_acceleration_B.setConstant(authority[2] / vehicle.inertia_kg_m2[2]);
}

template <class Visit>
void DisturbanceObserver::for_each_stretch(double from_s, double until_s, const ValveSchedule& valves,
                                           const Visit& visit) const {
  Openings openings(valves.valve_count());
  for (double t = from_s; t < until_s;) {
    const double end = std::min(until_s, valves.next_edge(t));
    valves.openings(t, openings.data());
    const int steps = std::max(1, static_cast<int>(std::ceil((end - t) / kMaxStep - 1e-9)));
    for (int k = 0; k < steps; ++k) visit(openings, (end - t) / steps);
    t = end;
  }
}

void DisturbanceObserver::start(double stamp_s, const State13<double>& measured) {
  const auto square = [](double sigma) { return sigma * sigma; };
  started_ = true;
  refused_ = 0;
  ahead_.reset();
  belief_ = {stamp_s, {measured, {}}, ObserverMatrix::Zero()};
  auto variance = belief_.covariance.diagonal();
  variance.segment<3>(kPosition).setConstant(square(config_.position_noise_m));
  variance.segment<3>(kVelocity).setConstant(square(config_.initial_velocity_m_s));
  variance.segment<3>(kAttitude).setConstant(square(config_.attitude_noise_rad));
  variance.segment<3>(kRate).setConstant(square(config_.initial_rate_rad_s));
  variance.segment<3>(kLinear).setConstant(square(config_.initial_disturbance_m_s2));
  variance.segment<3>(kAngular).setConstant(square(config_.initial_disturbance_rad_s2));
}

void DisturbanceObserver::carry(Belief& belief, double until_s, const ValveSchedule& valves) const {
  for_each_stretch(belief.stamp_s, until_s, valves, [&](const Openings& openings, double dt) {
    const ObserverMatrix F = model_.jacobian(belief.state, openings, dt);
    belief.covariance = F * belief.covariance * F.transpose() + model_.noise(belief.state, openings, dt);
    belief.state = model_.next(belief.state, openings, dt);
  });
  belief.stamp_s = until_s;
}

void DisturbanceObserver::predict_ahead(double until_s, const ValveSchedule& valves) {
  if (!started_ || until_s <= belief_.stamp_s) return;
  ahead_ = belief_;
  carry(*ahead_, until_s, valves);
}

bool DisturbanceObserver::update(double stamp_s, const State13<double>& measured,
                                 const ValveSchedule& valves) {
  if (!started_) {
    start(stamp_s, measured);
    return true;
  }
  if (ahead_ && ahead_->stamp_s <= stamp_s) belief_ = *ahead_;
  ahead_.reset();
  carry(belief_, stamp_s, valves);

  ObserverState& estimate = belief_.state;
  ObserverMatrix& covariance = belief_.covariance;
  Eigen::Matrix<double, 6, kSize> H = Eigen::Matrix<double, 6, kSize>::Zero();
  H.block<3, 3>(0, kPosition).setIdentity();
  H.block<3, 3>(3, kAttitude).setIdentity();
  Eigen::Matrix<double, 6, 1> variance;
  variance << Eigen::Vector3d::Constant(config_.position_noise_m * config_.position_noise_m),
      Eigen::Vector3d::Constant(config_.attitude_noise_rad * config_.attitude_noise_rad);
  const Eigen::Matrix<double, 6, 6> R = variance.asDiagonal();
  const Eigen::Matrix<double, 6, 1> innovation = H * minus({measured, estimate.d}, estimate);
  const Eigen::Matrix<double, 6, 6> S = H * covariance * H.transpose() + R;
  const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> factor(S);
  nis_ = innovation.dot(factor.solve(innovation));
  if (!(nis_ <= config_.nis_gate)) {
    if (++refused_ >= config_.reset_after) start(stamp_s, measured);
    return false;
  }
  refused_ = 0;
  const Eigen::Matrix<double, kSize, 6> K = factor.solve(H * covariance).transpose();
  estimate = plus(estimate, K * innovation);
  // H picks rows of the covariance: with K in hand the update is one thin product.
  const Eigen::Matrix<double, 6, kSize> H_P = H * covariance;
  covariance.noalias() -= K * H_P;
  covariance = 0.5 * (covariance + covariance.transpose()).eval();

  // Beyond what the thrusters could cancel the controller could do nothing with it, and what is no force but
  // a wall or a hand must not be paid for later.
  const auto clamp = [](Vec3<double>& value, const Vec3<double>& limit) {
    value = value.cwiseMax(-limit).cwiseMin(limit);
  };
  clamp(estimate.d.acceleration_W, limit_.acceleration_W);
  clamp(estimate.d.angular_acceleration_B, limit_.angular_acceleration_B);
  return true;
}

ObserverState DisturbanceObserver::predicted(double until_s, const ValveSchedule& valves) const {
  ObserverState state = belief_.state;
  for_each_stretch(belief_.stamp_s, until_s, valves,
                   [&](const Openings& openings, double dt) { state = model_.next(state, openings, dt); });
  return state;
}

}  // namespace atmos
