#include "atmos_sim2real/flight.h"

#include <gtest/gtest.h>

#include "synthetic.h"

namespace atmos {
namespace {

constexpr double kStart = 1.7e9;

// Velocity changes that integrate() finds along the measured motion are those of the flight itself.
void expect_the_flights_own_forces(const std::vector<Effect>& effects) {
  const Vehicle vehicle = nominal_vehicle();
  const SyntheticFlight flown = fly_ideal(vehicle, effects, pulse_commands(kStart, 20.0, 5));
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
    EXPECT_NEAR(forces.dv[kX][i], b.v_WC.x() - a.v_WC.x(), 1e-6) << i;
    EXPECT_NEAR(forces.dv[kY][i], b.v_WC.y() - a.v_WC.y(), 1e-6) << i;
    EXPECT_NEAR(forces.dv[kYaw][i], b.yaw_rate - a.yaw_rate, 1e-5) << i;
    EXPECT_NEAR(forces.dp[kX][i], b.p_WC.x() - a.p_WC.x() - dt * a.v_WC.x(), 1e-7) << i;
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

TEST(Flight, VehicleTimeUndoesLatencyAndSkew) {
  const Plant plant(nominal_vehicle(), {MocapLatency{{}, 0.02}, ClockSkew{{}, 1e-3}}, kStart);
  // What happened 10 s after the start is stamped 10 s * 1.001 later, plus the latency.
  EXPECT_NEAR(vehicle_time(plant, kStart + 10.01 + 0.02), kStart + 10.0, 1e-5);
}

}  // namespace
}  // namespace atmos
