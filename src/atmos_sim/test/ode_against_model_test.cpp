// The ODE simulator against the model's own integrator: 1 mm and 0.1 degrees after 20 s of random commands.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "atmos_model/predictor.h"
#include "test_scenario.h"

namespace atmos {
namespace {

constexpr double kDegree = M_PI / 180.0;

struct Difference {
  double position_m = 0.0;
  double yaw_rad = 0.0;
  double hidden = 0.0;
  double fastest_spin = 0.0;
};

// Largest differences over the flight.
Difference compare(const Scenario& scenario, std::uint64_t seed) {
  const auto commands = random_commands(scenario, kTestStart, seed);
  Simulation simulation(scenario, kTestStart);
  const Plant plant(scenario.vehicle, scenario.effects, kTestStart);
  ValveSchedule valves(plant.thruster_count(), plant.properties().timing);
  for (const ThrusterCommand& command : commands) {
    EXPECT_EQ(simulation.command(command), ValveSchedule::Taken::kInTime);
    EXPECT_EQ(valves.add(command), ValveSchedule::Taken::kInTime);
  }
  PlantState model{kTestStart, simulation.center_of_mass(), plant.initial_hidden()};
  Difference difference;
  for (int k = 1; k <= 200; ++k) {
    const double t = kTestStart + 0.1 * k;
    simulation.advance_to(t);
    advance(plant, valves, t, model);
    const PlanarState<double>& ode = simulation.center_of_mass();
    difference.position_m = std::max(difference.position_m, (ode.p_WC - model.body.p_WC).norm());
    difference.yaw_rad = std::max(difference.yaw_rad, std::abs(ode.yaw - model.body.yaw));
    difference.hidden =
        std::max(difference.hidden, (simulation.hidden() - model.hidden).lpNorm<Eigen::Infinity>());
    difference.fastest_spin = std::max(difference.fastest_spin, std::abs(ode.yaw_rate));
  }
  return difference;
}

void expect_agreement(const Scenario& scenario) {
  double worst_position = 0.0, worst_yaw = 0.0, fastest = 0.0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Difference difference = compare(scenario, seed);
    EXPECT_LT(difference.fastest_spin, 3.0) << "the requirement is about spin below 3 rad/s";
    EXPECT_LE(difference.position_m, 1e-3);
    EXPECT_LE(difference.yaw_rad, 0.1 * kDegree);
    EXPECT_LE(difference.hidden, 1e-3);
    worst_position = std::max(worst_position, difference.position_m);
    worst_yaw = std::max(worst_yaw, difference.yaw_rad);
    fastest = std::max(fastest, difference.fastest_spin);
  }
  std::printf("worst of 20 flights: %.2e m, %.2e rad; fastest spin %.2f rad/s\n", worst_position, worst_yaw,
              fastest);
}

TEST(OdeAgainstModel, WithoutEffects) { expect_agreement(test_scenario()); }

TEST(OdeAgainstModel, WithEveryEffect) { expect_agreement(all_effects_scenario()); }

// A finer step brings the two together as the square of the step: the simulator is of second order.
TEST(OdeAgainstModel, SecondOrderInTheStep) {
  Scenario scenario = all_effects_scenario();
  double coarse = 0.0, fine = 0.0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    scenario.step_s = 1e-3;
    coarse += compare(scenario, seed).position_m;
    scenario.step_s = 5e-4;
    fine += compare(scenario, seed).position_m;
  }
  EXPECT_LT(fine, 0.35 * coarse);
}

TEST(AllEffectsScenario, HasEveryRegisteredKind) {
  std::set<std::string> present, registered;
  for (const Effect& effect : all_effects_scenario().effects) present.insert(kind_of(effect));
  for (const EffectInfo& info : registered_effects()) registered.insert(info.kind);
  EXPECT_EQ(present, registered) << "add the new kind to config/scenario/all_effects.yaml";
}

}  // namespace
}  // namespace atmos
