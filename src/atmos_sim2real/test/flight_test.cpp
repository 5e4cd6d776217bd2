#include "atmos_sim2real/flight.h"

#include <gtest/gtest.h>

#include "synthetic.h"

namespace atmos {
namespace {

constexpr double kStart = 1.7e9;

// Every n-th pose of a flight.
SyntheticFlight with_every(std::size_t n, const SyntheticFlight& flown) {
  SyntheticFlight fewer = flown;
  fewer.recording.poses.clear();
  fewer.truth.clear();
  for (std::size_t i = 0; i < flown.truth.size(); i += n) {
    fewer.recording.poses.push_back(flown.recording.poses[i]);
    fewer.truth.push_back(flown.truth[i]);
  }
  return fewer;
}

// Velocity changes that integrate() finds along the measured motion are those of the flight itself.
void expect_the_flights_own_forces(const std::vector<Effect>& effects, double tolerance = 1e-6) {
  const Vehicle vehicle = nominal_vehicle();
  const SyntheticFlight flown = with_every(2, fly_ideal(vehicle, effects, pulse_commands(kStart, 20.0, 5)));
  const Plant plant(vehicle, effects, kStart);
  Flight flight(flown.recording);
  NoiseModel noise;
  noise.mocap = {1e-6, 1e-6, 1e-6};
  flight.smooth(plant, noise, 1.0);
  const ForceIntegrals forces = flight.integrate(plant);
  double moved = 0.0;
  for (std::size_t i = 20; i + 20 < flight.frames(); ++i) {
    const PlanarState<double>&a = flown.truth[i].body, &b = flown.truth[i + 1].body;
    const double dt = flight.times()[i + 1] - flight.times()[i];
    EXPECT_NEAR(forces.dv[kX][i], b.v_WC.x() - a.v_WC.x(), tolerance) << i;
    EXPECT_NEAR(forces.dv[kY][i], b.v_WC.y() - a.v_WC.y(), tolerance) << i;
    EXPECT_NEAR(forces.dv[kYaw][i], b.yaw_rate - a.yaw_rate, 10.0 * tolerance) << i;
    EXPECT_NEAR(forces.dp[kX][i], b.p_WC.x() - a.p_WC.x() - dt * a.v_WC.x(), 0.1 * tolerance) << i;
    moved = std::max(moved, std::abs(forces.dv[kX][i]));
    if (::testing::Test::HasFailure()) return;
  }
  EXPECT_GT(moved, 1e-4);
}

TEST(Flight, IntegratesTheNominalForces) { expect_the_flights_own_forces({}); }

TEST(Flight, IntegratesForcesWithHiddenStates) {
  SupplyDroop droop;
  droop.loss_per_s = 0.3;
  droop.recovery_s = 1.0;
  expect_the_flights_own_forces({droop, ComOffset{{}, 0.01, -0.005}});
}

TEST(Flight, IntegratesAThrustThatRisesWithinAFrame) {
  expect_the_flights_own_forces({ThrustRise{{}, 0.018}}, 1e-4);
}

TEST(Flight, AVibrationDoesTheSameBesideAnEffectWithHiddenStates) {
  const Vehicle vehicle = nominal_vehicle();
  FloorVibration vibration;
  vibration.amplitude_n = 1.0;
  vibration.frequency_hz = 16.6;
  Slosh nothing;
  nothing.mass_kg = 0.0;
  const Flight flight(fly_ideal(vehicle, {vibration}, pulse_commands(kStart, 10.0, 5)).recording);
  const ForceIntegrals alone = flight.integrate(Plant(vehicle, {vibration}, kStart));
  const ForceIntegrals beside = flight.integrate(Plant(vehicle, {vibration, nothing}, kStart));
  double largest = 0.0;
  for (std::size_t i = 0; i + 1 < flight.frames(); ++i) {
    EXPECT_NEAR(alone.dv[kX][i], beside.dv[kX][i], 2e-5) << i;
    largest = std::max(largest, std::abs(alone.dv[kX][i]));
  }
  EXPECT_GT(largest, 5e-4);
}

// Poses at a rate, moving evenly.
Recording sliding(double rate_hz, std::size_t count) {
  Recording recording;
  recording.commands = {{kStart, 0.1, std::vector<double>(8, 0.0)}};
  for (std::size_t i = 0; i < count; ++i) {
    const double t = static_cast<double>(i) / rate_hz;
    recording.poses.push_back({kStart + t, 0.1 * t, -0.2 * t, 0.3 * t});
  }
  return recording;
}

TEST(Flight, FramesAreMeansOfPosesThatComeFasterThanMotionCanChange) {
  for (const double rate_hz : {100.0, 120.0, 200.0}) {
    const Flight flight(sliding(rate_hz, 600));
    ASSERT_EQ(flight.frames(), rate_hz < 200.0 ? 300u : 150u);
    for (const PoseSample& pose : flight.poses()) {
      const double t = pose.time_s - kStart;
      EXPECT_NEAR(pose.x_m, 0.1 * t, 1e-6);
      EXPECT_NEAR(pose.y_m, -0.2 * t, 1e-6);
      EXPECT_NEAR(pose.yaw_rad, 0.3 * t, 1e-6);
    }
  }
  EXPECT_EQ(Flight(sliding(60.0, 600)).frames(), 600u);
}

TEST(Flight, MeansOfPosesAreNoMatterOfHowThrustBendsTheWay) {
  const Vehicle vehicle = nominal_vehicle();
  std::vector<ThrusterCommand> commands = pulse_commands(kStart, 20.0, 5);
  for (ThrusterCommand& command : commands) {
    for (double& duty : command.duty) duty = duty > 0.0 ? 1.0 : 0.0;
  }
  const SyntheticFlight flown = fly_ideal(vehicle, {}, commands);
  const Plant plant(vehicle, {}, kStart);
  const Flight flight(flown.recording);
  const ForceIntegrals forces = flight.integrate(plant);
  double worst = 0.0, bend = 0.0;
  for (std::size_t i = 1; i + 1 < flight.frames(); ++i) {
    // Between frames the force is the same, or an edge is near.
    const auto rate = [&](std::size_t k) {
      return forces.dv[kX][k] / (flight.times()[k + 1] - flight.times()[k]);
    };
    if (std::abs(rate(i) - rate(i - 1)) > 1e-6) continue;
    const PlantState &a = flown.truth[2 * i], &b = flown.truth[2 * i + 1];
    const double dt = b.time_s - a.time_s;
    const double way = a.body.p_WC.x() + 0.5 * dt * a.body.v_WC.x() + 0.125 * dt * dt * rate(i);
    worst = std::max(worst, std::abs(forces.measured[kX][i] - way));
    bend = std::max(bend, std::abs(flight.poses()[i].x_m - way));
  }
  EXPECT_GT(bend, 2e-6);
  EXPECT_LT(worst, 0.2 * bend);
}

TEST(Flight, NoFrameReachesOverAGap) {
  Recording recording = sliding(100.0, 601);
  recording.poses.erase(recording.poses.begin() + 301, recording.poses.begin() + 330);
  const Flight flight(recording);
  double longest = 0.0;
  for (std::size_t i = 1; i < flight.frames(); ++i)
    longest = std::max(longest, flight.times()[i] - flight.times()[i - 1]);
  EXPECT_GT(longest, 0.29);
  EXPECT_NEAR(flight.times()[150] - kStart, 3.0, 1e-6) << "the pose before the gap stands alone";
}

TEST(Flight, AValveThatStaysOpenIsOnePulseOrOneOfEveryCommand) {
  const Vehicle vehicle = nominal_vehicle();
  std::vector<ThrusterCommand> commands;
  for (int k = 0; k < 40; ++k) commands.push_back({kStart + 0.1 * k, 0.1, std::vector<double>(8, 0.0)});
  for (int k = 10; k < 20; ++k) commands[static_cast<std::size_t>(k)].duty[0] = 1.0;  // a second
  Flight flight(fly_ideal(vehicle, {}, commands).recording);
  const auto variance = [&](bool joins_pulses) {
    NoiseModel noise;
    noise.joins_pulses = joins_pulses;
    flight.smooth(Plant(vehicle, {}, kStart), noise, 1.0);
    double sum = 0.0;
    for (const double part : flight.scatter_variance()[kYaw]) sum += part;
    return sum;
  };
  const double of_each = variance(false);
  EXPECT_GT(of_each, 0.0);
  EXPECT_NEAR(variance(true), 10.0 * of_each, 1e-4 * of_each);
}

TEST(Flight, VehicleTimeUndoesLatencyAndSkew) {
  const Plant plant(nominal_vehicle(), {MocapLatency{{}, 0.02}, ClockSkew{{}, 1e-3}}, kStart);
  // What happened 10 s after the start is stamped 10 s * 1.001 later, plus the latency.
  EXPECT_NEAR(vehicle_time(plant, kStart + 10.01 + 0.02), kStart + 10.0, 1e-5);
}

}  // namespace
}  // namespace atmos
