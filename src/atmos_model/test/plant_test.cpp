#include "atmos_model/plant.h"

#include <gtest/gtest.h>

#include "nominal.h"

namespace atmos {
namespace {

VecX<double> open(std::initializer_list<int> numbers) {
  VecX<double> openings = VecX<double>::Zero(8);
  for (const int number : numbers) openings[number - 1] = 1.0;
  return openings;
}

PlanarState<double> moving() {
  PlanarState<double> state;
  state.p_WC = {1.0, -2.0};
  state.yaw = 0.6;
  state.v_WC = {0.3, -0.1};
  state.yaw_rate = 0.4;
  return state;
}

TEST(Plant, SupplyCouplingGivesThePapersLimits) {
  const Plant plant(nominal_vehicle(), {SupplyCoupling{{}, 0.125}}, kStart);
  const VecX<double> hidden = plant.initial_hidden();
  const PlanarWrench<double> push = plant.wrench<double>(kStart, {}, hidden, open({1, 3}));
  EXPECT_NEAR(push.force_W.x(), 2.975, 1e-12);
  EXPECT_NEAR(push.force_W.y(), 0.0, 1e-12);
  EXPECT_NEAR(push.torque, 0.0, 1e-12);
  EXPECT_NEAR(plant.wrench<double>(kStart, {}, hidden, open({2, 3, 6, 7})).torque, 0.510, 1e-12);
  EXPECT_NEAR(plant.thrust<double>(kStart, {}, hidden, open({5}))[4], 1.7, 1e-12);
}

TEST(Plant, WithoutEffectsIsTheNominalModel) {
  const Plant plant(nominal_vehicle(), {}, kStart);
  const PlanarState<double> state = moving();
  const PlantRate<double> rate = plant.rate<double>(kStart, state, plant.initial_hidden(), open({1}));
  EXPECT_NEAR(rate.body.a_WC.x(), 1.7 / 16.8 * std::cos(0.6), 1e-14);
  EXPECT_NEAR(rate.body.a_WC.y(), 1.7 / 16.8 * std::sin(0.6), 1e-14);
  EXPECT_NEAR(rate.body.yaw_acceleration, -1.7 * 0.12 / 0.297, 1e-14);
  EXPECT_EQ(plant.hidden_size(), 1);
  EXPECT_NEAR(plant.rate<double>(kStart, state, plant.initial_hidden(), open({1, 4})).hidden[0], 2 * 0.0035,
              1e-15);
  EXPECT_EQ(plant.mass<double>(kStart, state, plant.initial_hidden()), 16.8);
}

TEST(Plant, FloorTiltPullsDownTheSlope) {
  const Plant plant(nominal_vehicle(), {FloorTilt{{}, 0.002, -0.001}}, kStart);
  const PlanarWrench<double> pull = plant.wrench<double>(kStart, moving(), plant.initial_hidden(), open({}));
  EXPECT_NEAR(pull.force_W.x(), -16.8 * 9.81 * 0.002, 1e-12);
  EXPECT_NEAR(pull.force_W.y(), 16.8 * 9.81 * 0.001, 1e-12);
  EXPECT_NEAR(pull.torque, 0.0, 1e-12);  // the bearings' centroid is the centre of mass
}

TEST(Plant, FloorTiltTurnsARobotWhoseBearingsAreNotCentredOnItsMass) {
  Vehicle vehicle = nominal_vehicle();
  const Eigen::Vector2d shift(0.02, 0.01);  // as a centre of mass at -shift
  for (Eigen::Vector2d& bearing : vehicle.bearings_m) bearing += shift;
  const Plant plant(vehicle, {FloorTilt{{}, 0.002, 0.0}}, kStart);
  PlanarState<double> state;
  const double force = -16.8 * 9.81 * 0.002;
  EXPECT_NEAR(plant.wrench<double>(kStart, state, plant.initial_hidden(), open({})).torque, -0.01 * force,
              1e-12);
  state.yaw = M_PI / 2;
  EXPECT_NEAR(plant.wrench<double>(kStart, state, plant.initial_hidden(), open({})).torque, -0.02 * force,
              1e-12);
  // The same with the centre of mass moved instead.
  const Plant moved(nominal_vehicle(), {ComOffset{{}, -0.02, -0.01}, FloorTilt{{}, 0.002, 0.0}}, kStart);
  EXPECT_NEAR(moved.wrench<double>(kStart, state, moved.initial_hidden(), open({})).torque, -0.02 * force,
              1e-12);
}

TEST(Plant, EffectsComposeInTableOrder) {
  const Effect coupling = SupplyCoupling{{}, 0.1}, tilt = FloorTilt{{}, 0.001, 0.0};
  const Plant plant(nominal_vehicle(), {tilt, coupling}, kStart);
  EXPECT_EQ(kind_of(plant.effects()[0]), "supply_coupling");
  EXPECT_EQ(kind_of(plant.effects()[1]), "floor_tilt");
  const Plant late(nominal_vehicle(), {MocapLatency{{}, 0.02}}, kStart);
  EXPECT_EQ(late.properties().mocap_latency_s, 0.02);
}

TEST(Plant, MeasuredAndFromMeasuredAreInverse) {
  const Plant plant(nominal_vehicle(), {}, kStart);
  const PlanarState<double> state = moving();
  const PlanarState<double> back = plant.from_measured(plant.measured(state));
  EXPECT_TRUE(back.p_WC.isApprox(state.p_WC, 1e-14));
  EXPECT_TRUE(back.v_WC.isApprox(state.v_WC, 1e-14));
  EXPECT_EQ(back.yaw, state.yaw);
  // Geometric centre and centre of mass: (1, 2) known answers at 90 degrees.
  PlanarState<double> at_O;
  at_O.yaw = M_PI / 2;
  at_O.yaw_rate = 2.0;
  const PlanarState<double> at_C = center_of_mass_state<double>(at_O, {1.0, 2.0});
  EXPECT_TRUE(at_C.p_WC.isApprox(Eigen::Vector2d(-2.0, 1.0), 1e-14));
  EXPECT_TRUE(at_C.v_WC.isApprox(Eigen::Vector2d(-2.0, -4.0), 1e-14));
  EXPECT_LT(geometric_center_state<double>(at_C, {1.0, 2.0}).p_WC.norm(), 1e-14);
  EXPECT_LT(geometric_center_state<double>(at_C, {1.0, 2.0}).v_WC.norm(), 1e-14);
}

}  // namespace
}  // namespace atmos
