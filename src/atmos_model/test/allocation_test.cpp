#include "atmos_model/allocation.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "nominal.h"

namespace atmos {
namespace {

constexpr double d = 0.12;

// World and body are ENU and FLU, thrusters are in vehicle-file order: these signs pin all of it.
TEST(Allocation, KnowsTheMatricesOfTheNominalVehicle) {
  const AllocationMatrices matrices = thruster_matrices(nominal_vehicle());
  Eigen::MatrixXd D(3, 8), L(3, 8);
  D << 1, -1, 1, -1, 0, 0, 0, 0,  //
      0, 0, 0, 0, -1, 1, -1, 1,   //
      0, 0, 0, 0, 0, 0, 0, 0;
  L.setZero();
  L.row(2) << -d, d, d, -d, -d, d, d, -d;
  EXPECT_TRUE(matrices.D.isApprox(D, 1e-15));
  EXPECT_TRUE(matrices.L.isApprox(L, 1e-15));
}

TEST(Allocation, PairsAreThePapers) {
  const Vehicle vehicle = nominal_vehicle();
  const std::vector<ThrusterPair> pairs = thruster_pairs(vehicle);
  ASSERT_EQ(pairs.size(), 4u);
  for (int j = 0; j < 4; ++j) {
    EXPECT_EQ(pairs[j].positive, 2 * j);
    EXPECT_EQ(pairs[j].negative, 2 * j + 1);
  }
  const AllocationMatrices matrices = pair_matrices(vehicle, pairs);
  Eigen::MatrixXd D(3, 4);
  D << 1, 1, 0, 0, 0, 0, -1, -1, 0, 0, 0, 0;
  EXPECT_TRUE(matrices.D.isApprox(D, 1e-15));
  EXPECT_TRUE(matrices.L.row(2).isApprox(Eigen::RowVector4d(-d, d, -d, d), 1e-15));
}

TEST(Allocation, AThrusterWithoutPartnerIsNamed) {
  Vehicle vehicle = nominal_vehicle();
  vehicle.thrusters[2].position_m.y() += 0.01;
  try {
    thruster_pairs(vehicle);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("thruster 3 "), std::string::npos) << error.what();
  }
}

TEST(Allocation, AZeroAxisIsRefusedAndNamed) {
  Vehicle vehicle = nominal_vehicle();
  for (const Eigen::Vector3d& axis : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(2, 0, 0)}) {
    vehicle.thrusters[5].direction = axis;
    try {
      thruster_matrices(vehicle);
      FAIL();
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find("thruster 6 "), std::string::npos) << error.what();
    }
  }
}

}  // namespace
}  // namespace atmos
