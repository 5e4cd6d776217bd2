#include "atmos_sim/pilot.h"

#include <gtest/gtest.h>

#include "test_scenario.h"

namespace atmos {
namespace {

Scenario noisy_scenario() {
  Scenario scenario = test_scenario();
  scenario.duration_s = 45.0;
  scenario.set_points = {{0.0, 0.0, 0.0, 0.0}, {5.0, 1.0, -0.5, 1.2}};
  scenario.mocap.noise_m = 3e-4;
  scenario.mocap.noise_rad = 9e-4;
  scenario.mocap.dropout_probability = 0.01;
  scenario.mocap.dropouts = {{9.0, 0.3}};
  scenario.mocap.distortion_m = 2e-4;
  scenario.mocap.stamp_jitter_s = 1e-4;
  scenario.lab.thrust_scatter = 0.02;
  scenario.lab.slow_force_n = 0.003;
  return scenario;
}

TEST(Pilot, ReachesTheSetPointInTheOrdinaryLab) {
  const Scenario scenario = noisy_scenario();
  const PilotedFlight flight = fly_piloted(scenario, {}, kTestStart);
  EXPECT_EQ(flight.commands.size(), 450U);
  EXPECT_EQ(flight.rows.size(), 4501U);
  const PlanarState<double>& end = flight.rows.back().shown;
  EXPECT_NEAR(end.p_WC.x(), 1.0, 0.03);
  EXPECT_NEAR(end.p_WC.y(), -0.5, 0.03);
  EXPECT_NEAR(end.yaw, 1.2, 0.05);
}

TEST(Pilot, FliesWithAFaultAndABiasItDoesNotKnow) {
  Scenario scenario = noisy_scenario();
  ThrusterDead dead;
  dead.thruster = 3;
  dead.since_s = kTestStart + 10.0;
  FloorTilt tilt;
  tilt.slope_x = 5e-4;
  scenario.effects = {dead, tilt};
  const PilotedFlight flight = fly_piloted(scenario, {}, kTestStart);
  const PlanarState<double>& end = flight.rows.back().shown;
  // A proportional law leaves the offset a / omega^2 = 9.81 * 5e-4 / 0.64 = 8 mm; the dead valve adds to it.
  EXPECT_NEAR(end.p_WC.x(), 1.0, 0.15);
  EXPECT_NEAR(end.p_WC.y(), -0.5, 0.15);
}

TEST(Pilot, ShownIsTheMotionBehindTheNoise) {
  Scenario scenario = noisy_scenario();
  MocapLatency latency;
  latency.delay_s = 0.03;
  MarkerOffset marker;
  marker.x_m = 0.01;
  scenario.effects = {latency, marker};
  scenario.mocap.distortion_m = 0.0;
  const PilotedFlight flight = fly_piloted(scenario, {}, kTestStart);
  double squares = 0.0;
  int n = 0;
  for (const PilotedRow& row : flight.rows) {
    if (!row.row.frame.pose.p_W.allFinite()) continue;
    squares += (row.row.frame.pose.p_W - row.shown.p_WC).squaredNorm() / 2.0;
    ++n;
  }
  EXPECT_NEAR(std::sqrt(squares / n), 3e-4, 1e-5);
  EXPECT_LT(n, 4450);  // frames were lost
}

TEST(Pilot, IdenticalSeedsFlyAlikeAndPulsesAreNotTooShort) {
  Scenario scenario = noisy_scenario();
  scenario.duration_s = 10.0;
  const PilotedFlight a = fly_piloted(scenario, {}, kTestStart), b = fly_piloted(scenario, {}, kTestStart);
  EXPECT_EQ(a.rows.back().shown.p_WC, b.rows.back().shown.p_WC);
  scenario.seed += 1;
  EXPECT_NE(fly_piloted(scenario, {}, kTestStart).rows.back().shown.p_WC, a.rows.back().shown.p_WC);
  for (const ThrusterCommand& command : a.commands) {
    for (const double duty : command.duty) EXPECT_TRUE(duty == 0.0 || duty >= 0.02) << duty;
  }
}

}  // namespace
}  // namespace atmos
