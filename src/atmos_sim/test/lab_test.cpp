#include "atmos_sim/lab.h"

#include <gtest/gtest.h>

#include "atmos_sim/simulation.h"
#include "test_scenario.h"

namespace atmos {
namespace {

PlantProperties nominal_plant() {
  const Scenario scenario = test_scenario();
  return Plant(scenario.vehicle, {}, kTestStart).properties();
}

TEST(Lab, DriftHasTheStatedSizeAndCorrelationTime) {
  const PlantProperties plant = nominal_plant();
  LabSettings settings;
  settings.slow_force_n = 0.004;
  settings.slow_torque_n_m = 2e-4;
  settings.slow_time_s = 2.0;
  Lab lab(settings, 3, kTestStart, 8);
  ASSERT_FALSE(lab.quiet());
  const VecX<double> closed = VecX<double>::Zero(8);
  double squares = 0.0, products = 0.0, torque_squares = 0.0;
  PlanarWrench<double> before;
  const int n = 40000;  // 20000 s in steps of the correlation time / 4
  for (int i = 0; i < n; ++i) {
    const PlanarWrench<double> now = lab.wrench(kTestStart + 0.5 * i, plant, 0.3, closed);
    squares += now.force_W.squaredNorm() / 2.0;
    torque_squares += now.torque * now.torque;
    products += now.force_W.dot(before.force_W) / 2.0;
    before = now;
  }
  EXPECT_NEAR(std::sqrt(squares / n), settings.slow_force_n, 0.05 * settings.slow_force_n);
  EXPECT_NEAR(std::sqrt(torque_squares / n), settings.slow_torque_n_m, 0.05 * settings.slow_torque_n_m);
  EXPECT_NEAR(products / squares, std::exp(-0.25), 0.03);
}

TEST(Lab, EveryPulseHasAStrengthOfItsOwn) {
  const PlantProperties plant = nominal_plant();
  LabSettings settings;
  settings.thrust_scatter = 0.02;
  Lab lab(settings, 3, kTestStart, 8);
  VecX<double> open = VecX<double>::Zero(8), closed = open, thrust = open;
  open[0] = 1.0;
  thrust[0] = plant.thrusters[0].force_n;
  double squares = 0.0;
  const int n = 5000;
  for (int i = 0; i < n; ++i) {
    lab.valves_moved(open);
    const PlanarWrench<double> first = lab.wrench(kTestStart, plant, 0.0, thrust);
    lab.valves_moved(open);  // another valve's edge: the same pulse goes on
    const PlanarWrench<double> same = lab.wrench(kTestStart, plant, 0.0, thrust);
    ASSERT_DOUBLE_EQ(first.force_W.x(), same.force_W.x());
    EXPECT_NEAR(first.torque, cross2(plant.thrusters[0].position_m, first.force_W), 1e-12);
    squares += first.force_W.squaredNorm();
    lab.valves_moved(closed);
  }
  EXPECT_NEAR(std::sqrt(squares / n), 0.02 * thrust[0], 0.001 * thrust[0]);
}

TEST(Lab, AQuietOneChangesNothingAndALoudOneMovesTheRobot) {
  Scenario scenario = test_scenario();
  scenario.duration_s = 5.0;
  const auto fly = [&] { return run_batch(scenario, random_commands(scenario, kTestStart, 1), kTestStart); };
  const BatchResult nominal = fly();
  scenario.lab.slow_time_s = 1.0;
  EXPECT_EQ(fly().rows.back().truth.p_WC, nominal.rows.back().truth.p_WC);
  scenario.lab.thrust_scatter = 0.02;
  const Vec2<double> scattered = fly().rows.back().truth.p_WC - nominal.rows.back().truth.p_WC;
  EXPECT_GT(scattered.norm(), 1e-4);
  EXPECT_LT(scattered.norm(), 0.2);
  EXPECT_EQ(fly().rows.back().truth.p_WC - nominal.rows.back().truth.p_WC, scattered);
}

}  // namespace
}  // namespace atmos
