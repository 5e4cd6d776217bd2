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
    EXPECT_EQ(simulation.robot().command(command), ValveSchedule::Taken::kInTime);
    EXPECT_EQ(valves.add(command), ValveSchedule::Taken::kInTime);
  }
  PlantState model{kTestStart, simulation.robot().center_of_mass(), plant.initial_hidden()};
  Difference difference;
  for (int k = 1; k <= 200; ++k) {
    const double t = kTestStart + 0.1 * k;
    simulation.advance_to(t);
    advance(plant, valves, t, model);
    const PlanarState<double>& ode = simulation.robot().center_of_mass();
    difference.position_m = std::max(difference.position_m, (ode.p_WC - model.body.p_WC).norm());
    difference.yaw_rad = std::max(difference.yaw_rad, std::abs(ode.yaw - model.body.yaw));
    difference.hidden =
        std::max(difference.hidden, (simulation.robot().hidden() - model.hidden).lpNorm<Eigen::Infinity>());
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

// The simulator by itself: the error falls at least as the square of the step, wherever no force has a kink
// that depends on the place or the speed.
TEST(OdeAgainstModel, AtLeastSecondOrderInTheStep) {
  Scenario scenario = all_effects_scenario();
  const std::set<std::string> kinked = {"friction_patch", "coulomb_friction", "tether", "unmodelled"};
  scenario.effects.erase(
      std::remove_if(scenario.effects.begin(), scenario.effects.end(),
                     [&kinked](const Effect& effect) { return kinked.count(kind_of(effect)) != 0; }),
      scenario.effects.end());
  double coarse = 0.0, fine = 0.0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const auto end = [&scenario, seed](double step_s) {
      scenario.step_s = step_s;
      Simulation simulation(scenario, kTestStart);
      for (const ThrusterCommand& command : random_commands(scenario, kTestStart, seed))
        simulation.robot().command(command);
      simulation.advance_to(kTestStart + 20.0);
      return simulation.robot().truth().p_WC;
    };
    const Vec2<double> reference = end(1e-4);
    coarse += (end(1e-3) - reference).norm();
    fine += (end(5e-4) - reference).norm();
  }
  std::printf("5 flights, 1 ms: %.2e m, 0.5 ms: %.2e m\n", coarse, fine);
  EXPECT_LT(fine, 0.35 * coarse);
}

TEST(AllEffectsScenario, HasEveryRegisteredKind) {
  std::set<std::string> present, registered;
  for (const Effect& effect : all_effects_scenario().effects) present.insert(kind_of(effect));
  for (const EffectInfo& info : registered_effects()) registered.insert(info.kind);
  EXPECT_EQ(present, registered) << "add the new kind to config/scenario/all_effects.yaml";
}

// What the mocap would show along a flight: of the simulator, or of the model's predictor.
std::vector<MocapFrame> simulated_frames(const Scenario& scenario) {
  std::vector<MocapFrame> frames;
  for (const BatchRow& row : run_batch(scenario, random_commands(scenario, kTestStart, 3), kTestStart).rows)
    frames.push_back(row.frame);
  return frames;
}

std::vector<MocapFrame> predicted_frames(const Scenario& scenario) {
  const Plant plant(scenario.vehicle, scenario.effects, kTestStart);
  ValveSchedule valves(plant.thruster_count(), plant.properties().timing);
  for (const ThrusterCommand& command : random_commands(scenario, kTestStart, 3)) valves.add(command);
  PlanarState<double> at_O;
  at_O.p_WC = {scenario.start.x_m, scenario.start.y_m};
  at_O.yaw = scenario.start.yaw_rad;
  PlantState state{kTestStart, center_of_mass_state(at_O, plant.properties().com_B), plant.initial_hidden()};
  std::vector<MocapFrame> frames;
  for (int k = 0; k <= 2000; ++k) {
    const double latency = plant.properties().mocap_latency_s, stamp = kTestStart + 0.01 * k;
    advance(plant, valves, stamp - latency, state);
    const PlanarState<double> shown = plant.measured(state.body);
    frames.push_back(
        {stamp + plant.properties().stamp_skew * (stamp - latency - kTestStart), {shown.p_WC, shown.yaw}});
  }
  return frames;
}

struct FrameDifference {
  double position_m = 0.0, yaw_rad = 0.0, stamp_s = 0.0;
};

FrameDifference compare(const std::vector<MocapFrame>& a, const std::vector<MocapFrame>& b) {
  FrameDifference worst;
  for (std::size_t k = 0; k < a.size(); ++k) {
    worst.position_m = std::max(worst.position_m, (a[k].pose.p_W - b[k].pose.p_W).norm());
    worst.yaw_rad = std::max(worst.yaw_rad, std::abs(a[k].pose.yaw - b[k].pose.yaw));
    worst.stamp_s = std::max(worst.stamp_s, std::abs(a[k].stamp_s - b[k].stamp_s));
  }
  return worst;
}

// Every kind by itself, as config/scenario/all_effects.yaml has it: it makes a difference in the simulator,
// and the predictor tells that difference.
TEST(OdeAgainstModel, EveryKindIsSimulatedAndPredicted) {
  Scenario scenario = all_effects_scenario();
  scenario.mocap = MocapSettings{};
  const std::vector<Effect> all = scenario.effects;
  scenario.effects.clear();
  const std::vector<MocapFrame> nominal = simulated_frames(scenario);
  ASSERT_EQ(nominal.size(), 2001u);
  for (const EffectInfo& info : registered_effects()) {
    SCOPED_TRACE(info.kind);
    scenario.effects.clear();
    for (const Effect& effect : all) {
      if (kind_of(effect) == info.kind) scenario.effects.push_back(effect);
    }
    const std::vector<MocapFrame> simulated = simulated_frames(scenario);
    const FrameDifference error = compare(simulated, predicted_frames(scenario));
    EXPECT_LE(error.position_m, 1e-3);
    EXPECT_LE(error.yaw_rad, 0.1 * kDegree);
    EXPECT_LE(error.stamp_s, 1e-6);
    const FrameDifference change = compare(simulated, nominal);
    EXPECT_TRUE(change.position_m > std::max(2e-3, 20 * error.position_m) ||
                change.yaw_rad > std::max(2e-3, 20 * error.yaw_rad) || change.stamp_s > 1e-4)
        << "changes " << change.position_m << " m, " << change.yaw_rad << " rad, " << change.stamp_s << " s";
    std::printf("%-22s changes the flight by %.1e m %.1e rad; simulator against model %.1e m %.1e rad\n",
                info.kind.c_str(), change.position_m, change.yaw_rad, error.position_m, error.yaw_rad);
  }
}

}  // namespace
}  // namespace atmos
