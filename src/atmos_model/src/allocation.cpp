#include "atmos_model/allocation.h"

#include <Eigen/Geometry>
#include <cmath>
#include <stdexcept>
#include <string>

namespace atmos {

AllocationMatrices thruster_matrices(const Vehicle& vehicle) {
  const auto n = static_cast<Eigen::Index>(vehicle.thrusters.size());
  AllocationMatrices matrices{Eigen::Matrix<double, 3, Eigen::Dynamic>(3, n),
                              Eigen::Matrix<double, 3, Eigen::Dynamic>(3, n)};
  for (Eigen::Index i = 0; i < n; ++i) {
    const Thruster& thruster = vehicle.thrusters[static_cast<std::size_t>(i)];
    if (!(std::abs(thruster.direction.norm() - 1.0) < 1e-9))
      throw std::invalid_argument("the direction of thruster " + std::to_string(i + 1) +
                                  " is not a unit vector");
    matrices.D.col(i) = thruster.direction;
    matrices.L.col(i) = thruster.position_m.cross(thruster.direction);
  }
  return matrices;
}

std::vector<ThrusterPair> thruster_pairs(const Vehicle& vehicle) {
  constexpr double kTolerance = 1e-6;
  const AllocationMatrices matrices = thruster_matrices(vehicle);
  const int n = static_cast<int>(vehicle.thrusters.size());
  if (vehicle.actuation == Actuation::kContinuous) {
    std::vector<ThrusterPair> propellers;
    for (int i = 0; i < n; ++i) propellers.push_back({i, i});
    return propellers;
  }
  std::vector<bool> taken(vehicle.thrusters.size(), false);
  std::vector<ThrusterPair> pairs;
  for (int i = 0; i < n; ++i) {
    if (taken[static_cast<std::size_t>(i)]) continue;
    int partner = -1;
    for (int j = i + 1; j < n && partner < 0; ++j) {
      const bool opposed = (matrices.D.col(i) + matrices.D.col(j)).norm() < kTolerance &&
                           (matrices.L.col(i) + matrices.L.col(j)).norm() < kTolerance;
      if (opposed && !taken[static_cast<std::size_t>(j)]) partner = j;
    }
    if (partner < 0) {
      throw std::invalid_argument("thruster " + std::to_string(i + 1) +
                                  " has no partner that pushes the other way on the same line");
    }
    taken[static_cast<std::size_t>(partner)] = true;
    pairs.push_back({i, partner});
  }
  return pairs;
}

AllocationMatrices pair_matrices(const Vehicle& vehicle, const std::vector<ThrusterPair>& pairs) {
  const AllocationMatrices all = thruster_matrices(vehicle);
  const auto n = static_cast<Eigen::Index>(pairs.size());
  AllocationMatrices matrices{Eigen::Matrix<double, 3, Eigen::Dynamic>(3, n),
                              Eigen::Matrix<double, 3, Eigen::Dynamic>(3, n)};
  for (Eigen::Index j = 0; j < n; ++j) {
    matrices.D.col(j) = all.D.col(pairs[static_cast<std::size_t>(j)].positive);
    matrices.L.col(j) = all.L.col(pairs[static_cast<std::size_t>(j)].positive);
  }
  return matrices;
}

}  // namespace atmos
