// Baselines to compare the NMPC with, behind the same interface: a linear feedback of the error to a body
// wrench, clipped to its bounds. As LQR its gain minimises an infinite horizon without bounds; as PD it is
// given.
#pragma once

#include <Eigen/Core>

#include "atmos_nmpc/control_law.h"

namespace atmos {

// Wrench (N, N, N m) per error (x, y [m] and yaw [rad], then vx, vy, yaw rate) in body axes.
using LinearGain = Eigen::Matrix<double, 3, 6>;

// Of the configured baseline for a vehicle. Throws std::invalid_argument where the Riccati equation of the
// weights has no solution.
LinearGain linear_gain(const Vehicle& vehicle, const ControllerConfig& config);

class LinearLaw : public ControlLaw {
 public:
  LinearLaw(const Vehicle& vehicle, const ControllerConfig& config);

  CommandLevel level() const override { return CommandLevel::kWrench; }
  SolveResult solve(const ControlTask& task) override;
  void forget() override {}
  int stages() const override { return 1; }
  void input(int k, ActuatorInput& result) const override;
  State13<double> state(int k) const override;
  ActiveBounds active_bounds() const override { return active_; }
  void holding_input(const Quaternion4<double>& q_WB, const Disturbance& disturbance,
                     ActuatorInput& result) override;

 private:
  BodyWrench moving(const Quaternion4<double>& q_WB, const Motion& motion,
                    const Disturbance& disturbance) const;
  void actuate(const BodyWrench& wrench, ActuatorInput& result) const;

  Vehicle vehicle_;
  BodyWrench limit_;
  LinearGain gain_;
  Allocator allocator_;
  mutable Allocation allocation_;  // scratch
  RigidBodyStep<3> body_;
  State13<double> x0_ = State13<double>::Zero();
  BodyWrench wrench_ = BodyWrench::Zero();
  ActiveBounds active_;
};

}  // namespace atmos
