// Allocation matrices D (force) and L (torque) out of the geometry (paper, ctl:da); nothing here is typed in.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "atmos_model/vehicle.h"

namespace atmos {

// Directions and levers about the geometric centre, body axes: force_B = D * thrust [N] and torque_B = L *
// thrust [N m] for thrusts in N; D has no unit, L is in m.
struct AllocationMatrices {
  Eigen::Matrix<double, 3, Eigen::Dynamic> D;
  Eigen::Matrix<double, 3, Eigen::Dynamic> L;
};
// One column per thruster, in vehicle-file order. Throws std::invalid_argument naming a thruster whose
// direction is not a unit vector.
AllocationMatrices thruster_matrices(const Vehicle& vehicle);

// Two thrusters on one line that push in opposite directions: the paper's u_j > 0 fires `positive`, u_j < 0
// `negative`. A propeller is both.
struct ThrusterPair {
  int positive;  // index into Vehicle::thrusters
  int negative;
};
// Pairs in the order of their first thruster. Throws std::invalid_argument naming a thruster that has no
// partner.
std::vector<ThrusterPair> thruster_pairs(const Vehicle& vehicle);
// One column per pair, that of its positive thruster.
AllocationMatrices pair_matrices(const Vehicle& vehicle, const std::vector<ThrusterPair>& pairs);

}  // namespace atmos
