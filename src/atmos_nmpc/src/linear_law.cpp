#include "atmos_nmpc/linear_law.h"

#include <Eigen/LU>
#include <cmath>

#include "atmos_nmpc/riccati.h"

namespace atmos {

namespace {

using namespace state13;

double yaw_of(const Quaternion4<double>& q) {
  return std::atan2(2.0 * (q[0] * q[3] + q[1] * q[2]), 1.0 - 2.0 * (q[2] * q[2] + q[3] * q[3]));
}

RigidBodyStep<3> wrench_step(const Vehicle& vehicle, double step_s) {
  Eigen::Matrix3d D = Eigen::Matrix3d::Zero(), L = Eigen::Matrix3d::Zero();
  D(0, 0) = D(1, 1) = 1.0;
  L(2, 2) = 1.0;
  return RigidBodyStep<3>(D, L, vehicle.mass_kg, vehicle.inertia_kg_m2, step_s);
}

}  // namespace

LinearGain linear_gain(const Vehicle& vehicle, const ControllerConfig& config) {
  const LinearConfig& linear = config.linear;
  LinearGain gain = LinearGain::Zero();
  if (config.formulation == FormulationKind::kPd) {
    gain.leftCols<3>().diagonal() << linear.position, linear.position, linear.attitude;
    gain.rightCols<3>().diagonal() << linear.velocity, linear.velocity, linear.rate;
    return gain;
  }
  // Three double integrators whose wrench is held over a step.
  const double h = config.step_s;
  const Eigen::Vector3d response(1.0 / vehicle.mass_kg, 1.0 / vehicle.mass_kg,
                                 1.0 / vehicle.inertia_kg_m2.z());
  Eigen::MatrixXd A = Eigen::MatrixXd::Identity(6, 6), B = Eigen::MatrixXd::Zero(6, 3);
  A.topRightCorner<3, 3>().diagonal().setConstant(h);
  B.topRows<3>().diagonal() = 0.5 * h * h * response;
  B.bottomRows<3>().diagonal() = h * response;
  Eigen::Matrix<double, 6, 1> Q;
  Q << linear.position, linear.position, linear.attitude, linear.velocity, linear.velocity, linear.rate;
  const Eigen::MatrixXd R = Eigen::Vector3d(linear.force, linear.force, linear.torque).asDiagonal();
  const Eigen::MatrixXd P = solve_dare(A, B, Q.asDiagonal().toDenseMatrix(), R);
  gain = (R + B.transpose() * P * B).ldlt().solve(B.transpose() * P * A);
  return gain;
}

LinearLaw::LinearLaw(const Vehicle& vehicle, const ControllerConfig& config)
    : vehicle_(vehicle),
      limit_(config.force_n, config.force_n, config.torque_n_m),
      gain_(linear_gain(vehicle, config)),
      allocator_(vehicle),
      body_(wrench_step(vehicle, config.step_s)) {}

BodyWrench LinearLaw::moving(const Quaternion4<double>& q_WB, const Motion& motion,
                             const Disturbance& disturbance) const {
  RigidBodyStep<3> body = body_;
  body.set_disturbance(disturbance);
  return body.moving_input(q_WB, motion);
}

SolveResult LinearLaw::solve(const ControlTask& task) {
  const ReferencePoint& reference = task.reference_at(0);
  const State13<double> difference = task.x0 - reference.x;
  const Quaternion4<double> q = task.x0.segment<4>(kQuaternion);
  const Quaternion4<double> q_BW(q[0], -q[1], -q[2], -q[3]);
  Eigen::Matrix<double, 6, 1> error;
  error << rotate<double>(q_BW, difference.segment<3>(kPosition)).head<2>(),
      std::remainder(yaw_of(q) - yaw_of(reference.x.segment<4>(kQuaternion)), 2.0 * M_PI),
      rotate<double>(q_BW, difference.segment<3>(kVelocity)).head<2>(), difference[kAngularVelocity + 2];
  const BodyWrench wanted = moving(q, reference.motion, task.disturbance_at(0)) - gain_ * error;
  wrench_ = wanted.cwiseMax(-limit_).cwiseMin(limit_);
  active_ = {static_cast<int>((wanted.array().abs() >= limit_.array()).count()), 0};
  x0_ = task.x0;
  SolveResult result;
  result.status = wrench_.allFinite() ? SolverStatus::kSolved : SolverStatus::kInvalidNumber;
  return result;
}

void LinearLaw::actuate(const BodyWrench& wrench, ActuatorInput& result) const {
  allocator_.allocate_into(wrench, allocation_);
  result.wrench = wrench;
  result.yaw_rate = 0.0;
  result.duty = allocation_.duty;
}

void LinearLaw::input(int, ActuatorInput& result) const { actuate(wrench_, result); }

State13<double> LinearLaw::state(int k) const { return k == 0 ? x0_ : body_.next(x0_, wrench_); }

void LinearLaw::holding_input(const Quaternion4<double>& q_WB, const Disturbance& disturbance,
                              ActuatorInput& result) {
  actuate(moving(q_WB, {}, disturbance).cwiseMax(-limit_).cwiseMin(limit_), result);
}

}  // namespace atmos
