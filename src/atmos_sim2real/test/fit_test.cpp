#include "atmos_sim2real/fit.h"

#include <gtest/gtest.h>

#include "atmos_sim2real/library.h"
#include "synthetic.h"

namespace atmos {
namespace {

constexpr double kStart = 1.7e9;

// Fits the effects of two kinds of the library to a flight, the way the search does.
Fit fit_kinds(const Vehicle& vehicle, std::vector<Flight>& flights, const std::vector<std::string>& kinds) {
  const Problem problem{&vehicle, {}, &flights};
  std::vector<Effect> effects;
  std::vector<FreeParameter> free;
  for (const std::string& kind : kinds) {
    for (const Hypothesis& hypothesis : hypotheses(vehicle, flights)) {
      if (hypothesis.kind != kind) continue;
      for (FreeParameter parameter : hypothesis.free) {
        parameter.effect = effects.size();
        free.push_back(parameter);
      }
      effects.push_back(hypothesis.starts.front().effect);
    }
  }
  const NoiseModel noise = initial_noise(flights);
  flights.front().smooth(problem.plant({}, 0), noise, 20.0);
  Fit fitted = fit(problem, effects, free, noise);
  flights.front().smooth(problem.plant(fitted.effects, 0), fitted.noise, 4.0);
  return fit(problem, fitted.effects, fitted.free, fitted.noise);
}

TEST(Fit, RecoversCouplingAndTiltWithinTheirDeviations) {
  const Vehicle vehicle = nominal_vehicle();
  const double coupling = 0.08, slope_x = 3e-4, slope_y = -2e-4;
  const std::vector<Effect> truth = {SupplyCoupling{{}, coupling}, FloorTilt{{}, slope_x, slope_y}};
  std::vector<Flight> flights;
  flights.emplace_back(fly(vehicle, truth, pulse_commands(kStart, 60.0, 11), 12).recording);
  const Fit fitted = fit_kinds(vehicle, flights, {"supply_coupling", "floor_tilt"});

  const double expected[] = {coupling, slope_x, slope_y};
  ASSERT_EQ(fitted.free.size(), 3u);
  for (std::size_t p = 0; p < 3; ++p) {
    const double deviation = std::sqrt(fitted.covariance(static_cast<long>(p), static_cast<long>(p)));
    EXPECT_NEAR(parameter(fitted.effects, fitted.free[p]), expected[p], 3.0 * deviation)
        << fitted.free[p].name;
    EXPECT_LT(3.0 * deviation, 0.5 * std::abs(expected[p])) << "the flight says little";
  }
}

TEST(Fit, LikelihoodFallsAwayFromTheTruth) {
  const Vehicle vehicle = nominal_vehicle();
  std::vector<Flight> flights;
  flights.emplace_back(
      fly(vehicle, {SupplyCoupling{{}, 0.08}}, pulse_commands(kStart, 40.0, 21), 22).recording);
  const Problem problem{&vehicle, {}, &flights};
  const NoiseModel noise = initial_noise(flights);
  flights.front().smooth(problem.plant({}, 0), noise, 20.0);
  const auto at = [&](double c) {
    return evaluate(problem, {SupplyCoupling{{}, c}}, {}, noise).log_likelihood;
  };
  EXPECT_GT(at(0.08), at(0.0) + 50.0);
  EXPECT_GT(at(0.08), at(0.16) + 50.0);
}

}  // namespace
}  // namespace atmos
