#include "atmos_model/vehicle.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "mutations.h"
#include "nominal.h"

namespace atmos {
namespace {

TEST(Vehicle, TheNominalFileHoldsThePapersNumbers) {
  const Vehicle vehicle = nominal_vehicle();
  EXPECT_EQ(vehicle.name, "atmos");
  EXPECT_EQ(vehicle.mass_kg, 16.8);
  EXPECT_EQ(vehicle.inertia_kg_m2.z(), 0.297);
  EXPECT_EQ(vehicle.pwm.period_s, 0.1);
  EXPECT_EQ(vehicle.pwm.min_on_time_s, 0.0);
  ASSERT_EQ(vehicle.thrusters.size(), 8u);
  for (const Thruster& thruster : vehicle.thrusters) {
    EXPECT_EQ(thruster.force_n, 1.7);
    EXPECT_DOUBLE_EQ(thruster.direction.norm(), 1.0);
    EXPECT_EQ(thruster.position_m.cwiseAbs(), Eigen::Vector3d(0.12, 0.12, 0.0));
  }
  ASSERT_EQ(vehicle.bearings_m.size(), 3u);
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& bearing : vehicle.bearings_m) {
    EXPECT_NEAR(bearing.norm(), 0.15, 1e-15);
    sum += bearing;
  }
  EXPECT_NEAR(sum.norm(), 0.0, 1e-15);
  EXPECT_NEAR(vehicle.bearings_m[0].y(), 0.15, 1e-15);
}

Vehicle vehicle_from(const YAML::Node& root) {
  const ConfigFile file = ConfigFile::from_text(emitted(root), "v.yaml");
  const Vehicle vehicle = read_vehicle(file.root());
  file.check();
  return vehicle;
}

TEST(Vehicle, EveryMutatedCopyIsRefusedWithTheRightKey) {
  const YAML::Node original = YAML::LoadFile(shipped("config/vehicle/atmos.yaml"));
  ASSERT_NO_THROW(vehicle_from(original));
  const std::vector<Mutation> mutations = every_mutation(original, {"vehicle.pneumatics", "vehicle.battery"});
  EXPECT_GT(mutations.size(), 90u);
  for (const Mutation& mutation : mutations)
    expect_refused(mutation, [](const YAML::Node& root) { vehicle_from(root); });
}

TEST(Vehicle, NumbersOutOfRangeAreRefused) {
  const auto refuses = [](const std::string& key, const auto& change) {
    YAML::Node root = YAML::LoadFile(shipped("config/vehicle/atmos.yaml"));
    change(root["vehicle"]);
    expect_refused({key, "out of range", root}, [](const YAML::Node& node) { vehicle_from(node); });
  };
  for (const char* bad : {"0", "-1", ".nan", ".inf"}) {
    refuses("vehicle.mass_kg", [&](YAML::Node v) { v["mass_kg"] = bad; });
    refuses("vehicle.inertia_kg_m2[2]", [&](YAML::Node v) { v["inertia_kg_m2"][2] = bad; });
    refuses("vehicle.pwm.period_s", [&](YAML::Node v) { v["pwm"]["period_s"] = bad; });
    refuses("vehicle.thrusters[7].force_n", [&](YAML::Node v) { v["thrusters"][7]["force_n"] = bad; });
  }
  refuses("vehicle.pwm.min_on_time_s", [](YAML::Node v) { v["pwm"]["min_on_time_s"] = 0.11; });
  refuses("vehicle.pwm.min_on_time_s", [](YAML::Node v) { v["pwm"]["min_on_time_s"] = -0.01; });
  refuses("vehicle.thrusters[2].direction", [](YAML::Node v) { v["thrusters"][2]["direction"][0] = 0; });
  refuses("vehicle.thrusters", [](YAML::Node v) { v["thrusters"] = YAML::Load("[]"); });
  refuses("vehicle.bearings_m", [](YAML::Node v) { v["bearings_m"] = YAML::Load("[[0, 1], [1, 0]]"); });
  refuses("vehicle.radius_m", [](YAML::Node v) { v["radius_m"] = 0; });
  refuses("vehicle.height_m", [](YAML::Node v) { v["height_m"] = -1; });
}

TEST(Vehicle, DirectionsAreNormalisedAndOptionalKeysAreRead) {
  YAML::Node root = YAML::LoadFile(shipped("config/vehicle/atmos.yaml"));
  root["vehicle"]["thrusters"][0]["direction"] = YAML::Load("[3, 4, 0]");
  root["vehicle"]["bearings_m"] = YAML::Load("[[0.2, 0], [0, 0.2], [-0.2, -0.2]]");
  root["vehicle"]["radius_m"] = 0.3;
  const Vehicle vehicle = vehicle_from(root);
  EXPECT_TRUE(vehicle.thrusters[0].direction.isApprox(Eigen::Vector3d(0.6, 0.8, 0.0)));
  EXPECT_EQ(vehicle.bearings_m[2], Eigen::Vector2d(-0.2, -0.2));
  EXPECT_EQ(vehicle.radius_m, 0.3);
}

}  // namespace
}  // namespace atmos
