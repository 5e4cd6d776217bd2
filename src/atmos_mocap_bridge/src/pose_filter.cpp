#include "atmos_mocap_bridge/pose_filter.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace atmos {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using namespace pose_error;

constexpr double kMaxStep_s = 0.01;
constexpr double kJoinTolerance_s = 1e-3;   // periods whose gap is shorter follow each other
constexpr double kUnitTolerance = 0.01;     // of a measured quaternion's length
constexpr double kCoastTolerance_s = 1e-6;  // resolution of stamps
constexpr double kMostDelay_s = 1.0;        // of a frame behind the newest command

Matrix3d skew(const Vector3d& v) {
  Matrix3d m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

// Rotation vector of a unit quaternion, the short way round; safe at the identity.
Vector3d log_map(const Eigen::Quaterniond& q) {
  const double sign = q.w() < 0.0 ? -1.0 : 1.0;
  const double length = q.vec().norm();
  if (length < 1e-12) return 2.0 * sign * q.vec();
  return 2.0 * sign * std::atan2(length, sign * q.w()) / length * q.vec();
}

Eigen::Quaterniond exp_map(const Vector3d& v) {
  const double angle = v.norm();
  const double scale = angle < 1e-9 ? 0.5 : std::sin(0.5 * angle) / angle;
  return Eigen::Quaterniond(std::cos(0.5 * angle), scale * v.x(), scale * v.y(), scale * v.z()).normalized();
}

bool usable(const PoseFrame& frame) {
  return frame.p_WB.allFinite() && frame.q_WB.coeffs().allFinite() &&
         std::abs(frame.q_WB.norm() - 1.0) < kUnitTolerance &&
         (!frame.covariance || frame.covariance->allFinite());
}

Matrix6 noise_of(const PoseFrame& frame, const MocapConfig& config) {
  if (frame.covariance) return *frame.covariance;
  Vector6 sigma;
  sigma << Vector3d::Constant(config.position_noise_m), Vector3d::Constant(config.attitude_noise_rad);
  return sigma.cwiseAbs2().asDiagonal();
}

}  // namespace

OdometryEstimate to_odometry(const PoseEstimate& estimate) {
  const Matrix3d R_WB = estimate.q_WB.toRotationMatrix();
  OdometryEstimate odometry;
  odometry.p_WB = estimate.p_WB;
  odometry.q_WB = estimate.q_WB;
  odometry.v_WB_B = R_WB.transpose() * estimate.v_WB;
  odometry.w_WB_B = estimate.w_WB_B;

  Matrix6 to_world = Matrix6::Identity();
  to_world.block<3, 3>(3, 3) = R_WB;
  odometry.pose_covariance = to_world * estimate.covariance.topLeftCorner<6, 6>() * to_world.transpose();

  // v_B = R^T v_W moves with the attitude error too: d(v_B) = R^T d(v_W) + v_B x d(theta).
  Eigen::Matrix<double, 6, 12> to_twist = Eigen::Matrix<double, 6, 12>::Zero();
  to_twist.block<3, 3>(0, kAttitude) = skew(odometry.v_WB_B);
  to_twist.block<3, 3>(0, kVelocity) = R_WB.transpose();
  to_twist.block<3, 3>(3, kAngularVelocity).setIdentity();
  odometry.twist_covariance = to_twist * estimate.covariance * to_twist.transpose();
  return odometry;
}

PoseFilter::PoseFilter(const MocapConfig& config, const Vehicle& vehicle)
    : config_(config),
      vehicle_(vehicle),
      matrices_(thruster_matrices(vehicle)),
      valves_(static_cast<int>(vehicle.thrusters.size()), {}, vehicle.actuation),
      openings_(Eigen::VectorXd::Zero(static_cast<Eigen::Index>(vehicle.thrusters.size()))),
      nis_monitor_(6, config.nis_gate) {}

void PoseFilter::take_command(const ThrusterCommand& command, double now_s) {
  const ValveSchedule::Taken taken = valves_.add(command, now_s);
  if (taken == ValveSchedule::Taken::kMalformed || taken == ValveSchedule::Taken::kExpired) return;
  if (command.stamp_s > known_until_ + kJoinTolerance_s) known_from_ = std::max(command.stamp_s, now_s);
  known_until_ = command.stamp_s + command.period_s;
  // While no frames come, nothing else keeps the memory bounded.
  valves_.forget_before(command.stamp_s - config_.forget_s - kMostDelay_s);
}

FrameResult PoseFilter::take_frame(const PoseFrame& measured) {
  const PoseFrame frame = calibrated(measured);
  const FrameResult result = filter(frame);
  const bool in_order = estimate_.stamp_s == frame.stamp_s;
  if (in_order) {
    output_ = estimate_;
    predict(output_, measured.stamp_s);
  }
  return result;
}

PoseFrame PoseFilter::calibrated(const PoseFrame& frame) const {
  const MocapCalibration& calibration = config_.calibration;
  PoseFrame result = frame;
  result.stamp_s -= calibration.delay_s;
  if (!usable(frame)) return result;
  result.q_WB = frame.q_WB * Eigen::AngleAxisd(-calibration.yaw_misalignment_rad, Vector3d::UnitZ());
  const Vector3d offset_B(calibration.marker_offset_m.x(), calibration.marker_offset_m.y(), 0.0);
  result.p_WB -= result.q_WB.normalized() * offset_B;
  return result;
}

FrameResult PoseFilter::filter(const PoseFrame& frame) {
  ++counters_.frames;
  const double age = state_ == TrackingState::kWaiting ? 0.0 : frame.stamp_s - accepted_stamp_;
  if (!std::isfinite(frame.stamp_s) || frame.stamp_s <= last_stamp_) {
    ++counters_.rejected_order;
    order_refusals_ = frame.stamp_s > refused_stamp_ ? order_refusals_ + 1 : 1;
    refused_stamp_ = frame.stamp_s;
    if (order_refusals_ < config_.reinitialise_after || !usable(frame)) return {state_, false, age};
    // Commands of the time before the jump say nothing about the time after it.
    valves_ = ValveSchedule(valves_.valve_count(), {}, vehicle_.actuation);
    known_from_ = std::numeric_limits<double>::infinity();
    known_until_ = -std::numeric_limits<double>::infinity();
    start(frame);
    return {state_, true, 0.0};
  }
  order_refusals_ = 0;
  refused_stamp_ = -std::numeric_limits<double>::infinity();
  last_stamp_ = frame.stamp_s;

  const bool seen = usable(frame);
  if (!seen) ++counters_.rejected_not_finite;
  const bool remembered = state_ != TrackingState::kWaiting && age <= config_.forget_s + kCoastTolerance_s;
  if (!remembered) {
    if (seen) {
      start(frame);
      return {state_, true, 0.0};
    }
    if (state_ != TrackingState::kWaiting) state_ = TrackingState::kLost;
    return {state_, false, age};
  }

  predict(estimate_, frame.stamp_s);
  valves_.forget_before(frame.stamp_s);
  if (!seen) return coast(age);
  if (update(frame)) {
    ++counters_.accepted;
    accepted_stamp_ = frame.stamp_s;
    gate_refusals_ = 0;
    state_ = TrackingState::kTracking;
    return {state_, true, 0.0};
  }
  ++counters_.rejected_gate;
  if (++gate_refusals_ >= config_.reinitialise_after) {
    start(frame);
    return {state_, true, 0.0};
  }
  return coast(age);
}

FrameResult PoseFilter::coast(double age_s) {
  const bool published = age_s <= config_.coast_s + kCoastTolerance_s;
  state_ = published ? TrackingState::kCoasting : TrackingState::kLost;
  return {state_, published, age_s};
}

void PoseFilter::start(const PoseFrame& frame) {
  if (state_ != TrackingState::kWaiting) ++counters_.reinitialisations;
  ++counters_.accepted;
  estimate_ = PoseEstimate();
  estimate_.stamp_s = frame.stamp_s;
  estimate_.p_WB = frame.p_WB;
  estimate_.q_WB = frame.q_WB.normalized();
  estimate_.covariance.topLeftCorner<6, 6>() = noise_of(frame, config_);
  Vector6 sigma;
  sigma << Vector3d::Constant(config_.initial_velocity_m_s),
      Vector3d::Constant(config_.initial_angular_velocity_rad_s);
  estimate_.covariance.diagonal().tail<6>() = sigma.cwiseAbs2();
  state_ = TrackingState::kTracking;
  last_stamp_ = accepted_stamp_ = frame.stamp_s;
  order_refusals_ = gate_refusals_ = 0;
}

void PoseFilter::predict(PoseEstimate& estimate, double until_s) {
  double t = estimate.stamp_s;
  while (t < until_s) {
    const bool known = t >= known_from_ && t < known_until_;
    double end = std::min({until_s, t + kMaxStep_s, valves_.next_edge(t)});
    if (known_from_ > t) end = std::min(end, known_from_);
    if (known_until_ > t) end = std::min(end, known_until_);
    if (known) {
      valves_.openings(t, openings_.data());
    } else {
      openings_.setZero();
    }
    integrate(estimate, end - t, known);
    t = end;
  }
  estimate.stamp_s = until_s;
}

void PoseFilter::integrate(PoseEstimate& estimate, double dt, bool known) const {
  // Force and torque of the open valves, and the noise that their thrust error brings per unit of time.
  const Matrix3d R_WB = estimate.q_WB.toRotationMatrix();
  const AccelerationNoise& noise = known ? config_.known_input : config_.unknown_input;
  const double tau = config_.correlation_s;
  Vector6 density_diagonal;
  density_diagonal << Vector3d::Constant(tau * noise.linear_m_s2 * noise.linear_m_s2),
      Vector3d::Constant(tau * noise.angular_rad_s2 * noise.angular_rad_s2);
  Matrix6 density = density_diagonal.asDiagonal();
  Vector3d force_B = Vector3d::Zero(), torque_B = Vector3d::Zero();
  for (Eigen::Index i = 0; i < openings_.size(); ++i) {
    if (openings_[i] == 0.0) continue;
    const double thrust = openings_[i] * vehicle_.thrusters[static_cast<std::size_t>(i)].force_n;
    force_B += thrust * matrices_.D.col(i);
    torque_B += thrust * matrices_.L.col(i);
    Vector6 gain;
    gain << R_WB * matrices_.D.col(i) / vehicle_.mass_kg,
        matrices_.L.col(i).cwiseQuotient(vehicle_.inertia_kg_m2);
    gain *= config_.thrust_error * thrust;
    density += tau * gain * gain.transpose();
  }

  // Error dynamics, linearised at the start of the stretch; the matrix exponential to third order.
  const Vector3d& w = estimate.w_WB_B;
  const Matrix3d inertia = vehicle_.inertia_kg_m2.asDiagonal();
  const Matrix3d inverse_inertia = vehicle_.inertia_kg_m2.cwiseInverse().asDiagonal();
  Matrix12 A = Matrix12::Zero();
  A.block<3, 3>(kPosition, kVelocity).setIdentity();
  A.block<3, 3>(kAttitude, kAttitude) = -skew(w);
  A.block<3, 3>(kAttitude, kAngularVelocity).setIdentity();
  A.block<3, 3>(kVelocity, kAttitude) = -R_WB * skew(force_B / vehicle_.mass_kg);
  A.block<3, 3>(kAngularVelocity, kAngularVelocity) =
      inverse_inertia * (skew(inertia * w) - skew(w) * inertia);
  const Matrix12 A_dt = A * dt;
  const Matrix12 A_dt2 = A_dt * A_dt;
  const Matrix12 Phi = Matrix12::Identity() + A_dt + 0.5 * A_dt2 + A_dt2 * A_dt / 6.0;

  // White acceleration through the double integrators; over one short stretch the coupling by A adds higher
  // orders only.
  Matrix12 Q;
  Q << density * (dt * dt * dt / 3.0), density * (dt * dt / 2.0), density * (dt * dt / 2.0), density * dt;

  State13<double> x;
  x << estimate.p_WB, estimate.v_WB, estimate.q_WB.w(), estimate.q_WB.vec(), estimate.w_WB_B;
  x = rk4_step(x, dt, [&](const State13<double>& at) {
    return rigid_body_rate<double>(at, force_B, torque_B, vehicle_.mass_kg, vehicle_.inertia_kg_m2);
  });
  estimate.p_WB = x.segment<3>(state13::kPosition);
  estimate.v_WB = x.segment<3>(state13::kVelocity);
  estimate.q_WB = Eigen::Quaterniond(x[state13::kQuaternion], x[state13::kQuaternion + 1],
                                     x[state13::kQuaternion + 2], x[state13::kQuaternion + 3])
                      .normalized();
  estimate.w_WB_B = x.segment<3>(state13::kAngularVelocity);
  estimate.covariance = (Phi * estimate.covariance * Phi.transpose() + Q).eval();
}

bool PoseFilter::update(const PoseFrame& frame) {
  // Measurement matrix [I6 0]: the pose error itself.
  Vector6 innovation;
  innovation << frame.p_WB - estimate_.p_WB, log_map(estimate_.q_WB.conjugate() * frame.q_WB.normalized());
  const Matrix6 noise = noise_of(frame, config_);
  const Matrix6 S = estimate_.covariance.topLeftCorner<6, 6>() + noise;
  const Eigen::LLT<Matrix6> factor(S);
  nis_ = innovation.dot(factor.solve(innovation));
  nis_monitor_.add(nis_);
  if (!(nis_ <= config_.nis_gate)) return false;

  const Eigen::Matrix<double, 12, 6> K = factor.solve(estimate_.covariance.topRows<6>()).transpose();
  const Eigen::Matrix<double, 12, 1> correction = K * innovation;
  Matrix12 I_KH = Matrix12::Identity();
  I_KH.leftCols<6>() -= K;
  Matrix12 P = I_KH * estimate_.covariance * I_KH.transpose() + K * noise * K.transpose();

  estimate_.p_WB += correction.segment<3>(kPosition);
  estimate_.q_WB = (estimate_.q_WB * exp_map(correction.segment<3>(kAttitude))).normalized();
  estimate_.v_WB += correction.segment<3>(kVelocity);
  estimate_.w_WB_B += correction.segment<3>(kAngularVelocity);

  // The attitude error is now counted from the corrected attitude.
  Matrix12 reset = Matrix12::Identity();
  reset.block<3, 3>(kAttitude, kAttitude) -= 0.5 * skew(correction.segment<3>(kAttitude));
  P = (reset * P * reset.transpose()).eval();
  estimate_.covariance = 0.5 * (P + P.transpose());
  return true;
}

}  // namespace atmos
