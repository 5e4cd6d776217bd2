#include "atmos_nmpc/prediction.h"

#include <gtest/gtest.h>

#include <random>

#include "closed_loop.h"

namespace atmos {
namespace {

TEST(Prediction, AgreesWithThePlantUnderRandomPulses) {
  const Vehicle vehicle = load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml");
  constexpr double kStart = 1234.5;
  const Plant plant(vehicle, {}, kStart);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> duty(0.0, 1.0);
  ValveSchedule valves(8);
  PlantState truth{kStart, {{0.1, 0.2}, 0.3, {0.05, -0.1}, 0.4}, plant.initial_hidden()};
  State13<double> x = testing::state13_of(truth.body);
  for (int k = 0; k < 20; ++k) {
    ThrusterCommand command{kStart + 0.1 * k, 0.1, {}};
    for (int i = 0; i < 8; ++i) command.duty.push_back(duty(random));
    valves.add(command);
    advance(plant, valves, kStart + 0.1 * (k + 1), truth);
  }
  x = predict(vehicle, thruster_matrices(vehicle), valves, x, kStart, kStart + 2.0);
  State13<double> expected = testing::state13_of(truth.body);
  EXPECT_LT((x - expected).norm(), 1e-6);
}

TEST(Prediction, DoesNotGoBack) {
  const Vehicle vehicle = load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml");
  const State13<double> x = testing::state13_of({{0.1, 0.2}, 0.3, {0.05, -0.1}, 0.4});
  EXPECT_EQ(predict(vehicle, thruster_matrices(vehicle), ValveSchedule(8), x, 1234.5, 1234.4), x);
}

}  // namespace
}  // namespace atmos
