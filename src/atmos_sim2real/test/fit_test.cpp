#include "atmos_sim2real/fit.h"

#include <gtest/gtest.h>

#include "atmos_sim2real/library.h"
#include "atmos_sim2real/onset.h"
#include "atmos_sim2real/patch.h"
#include "atmos_sim2real/placebo.h"
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
  fitted = fit(problem, fitted.effects, fitted.free, fitted.noise);
  add_covariance(problem, fitted);
  return fitted;
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

FrictionPatch disc(double coefficient, double x, double y, double radius) {
  FrictionPatch patch;
  patch.coefficient = coefficient;
  patch.center_x_m = x;
  patch.center_y_m = y;
  patch.radius_m = radius;
  return patch;
}

// Back and forth along x and y: a push of 0.5 s, a coast of 3 s, and the same push the other way.
std::vector<ThrusterCommand> crossings(double duration_s) {
  const std::vector<int> pushes[] = {{1, 3}, {2, 4}, {6, 8}, {5, 7}};  // +x, -x, +y, -y
  std::vector<ThrusterCommand> commands;
  for (int k = 0; k < static_cast<int>(duration_s / 0.1); ++k) {
    const int leg = k / 50 % 4, within = k % 50;
    // +x, -x, +y, -y; the last half of each leg brakes.
    const int push = within < 5 ? leg : within >= 35 && within < 40 ? leg ^ 1 : -1;
    ThrusterCommand command{kStart + 0.1 * k, 0.1, std::vector<double>(8, 0.0)};
    if (push >= 0) {
      for (const int thruster : pushes[push]) command.duty[static_cast<std::size_t>(thruster - 1)] = 1.0;
    }
    commands.push_back(command);
  }
  return commands;
}

TEST(Fit, FindsThePatchFromAWrongDisc) {
  const Vehicle vehicle = nominal_vehicle();
  const FrictionPatch truth = disc(4e-4, 0.1, 0.05, 0.3);
  std::vector<Flight> flights;
  flights.emplace_back(fly(vehicle, {truth}, crossings(80.0), 32).recording);
  const Problem problem{&vehicle, {}, &flights};
  const NoiseModel noise = initial_noise(flights);
  smooth_all(problem, {}, noise, 20.0);
  FreeParameter coefficient{0, "coefficient", 0, 0.0, 2e-3, 2e-5};
  const Fit wrong = evaluate(problem, {disc(2e-4, 0.22, -0.05, 0.42)}, {coefficient},
                             profile_noise(problem, {}, noise, true));
  const Fit found = refine_patch(problem, wrong, 0, 4.0);
  const FrictionPatch& patch = std::get<FrictionPatch>(found.effects.front());
  EXPECT_NEAR(patch.coefficient, truth.coefficient, 0.05 * truth.coefficient);
  EXPECT_NEAR(patch.center_x_m, truth.center_x_m, 0.03);
  EXPECT_NEAR(patch.center_y_m, truth.center_y_m, 0.03);
  EXPECT_NEAR(patch.radius_m, truth.radius_m, 0.03);
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

TEST(Fit, DelaysThatNearlyCancelAreKnownAsWellAsStated) {
  // Of pulses of milliseconds many vanish between opening and closing; what delays both alike shows little.
  const Vehicle vehicle = nominal_vehicle();
  const ValveDelay late{{}, 4.1e-3, 1.6e-3};
  std::vector<Flight> flights;
  Lab quiet{5e-5, 1.5e-4};
  quiet.slow_m_s2 *= 0.1;
  quiet.slow_rad_s2 *= 0.1;
  flights.emplace_back(
      fly(vehicle, {late}, shortened(pulse_commands(kStart, 60.0, 5), 0.03), 6, quiet).recording);
  const Problem problem{&vehicle, {}, &flights};
  Fit fitted = fit_kinds(vehicle, flights, {ValveDelay::kKind});
  add_covariance(problem, fitted);
  const double deviation = std::sqrt(fitted.covariance(0, 0));
  const auto loss = [&](double both_s) {
    std::vector<Effect> moved = fitted.effects;
    std::get<ValveDelay>(moved[0]).open_s += both_s;
    std::get<ValveDelay>(moved[0]).close_s += both_s;
    return fitted.log_likelihood - evaluate(problem, moved, {}, fitted.noise).log_likelihood;
  };
  // Two deviations cost two nats, or less where the prior says as much as the flight.
  const double curvature = loss(2.0 * deviation) + loss(-2.0 * deviation);
  EXPECT_GT(curvature, 0.3);
  EXPECT_LT(curvature, 6.0);
}

TEST(Library, OffersPatchesThatOnlyABearingTouches) {
  // The centre stays within centimetres; the bearings stand around it.
  const Vehicle vehicle = nominal_vehicle();
  std::vector<Flight> flights;
  flights.emplace_back(fly(vehicle, {}, shortened(pulse_commands(kStart, 20.0, 5), 0.2), 6).recording);
  const Box box = visited(flights);
  ASSERT_LT(box.x1 - box.x0, 0.3);
  const std::vector<Hypothesis> library = hypotheses(vehicle, flights);
  const auto patch = std::find_if(library.begin(), library.end(),
                                  [](const Hypothesis& h) { return h.kind == FrictionPatch::kKind; });
  ASSERT_NE(patch, library.end());
  const auto offers = [&](double x, double y) {
    return std::any_of(patch->starts.begin(), patch->starts.end(), [&](const Start& start) {
      const FrictionPatch& disc = std::get<FrictionPatch>(start.effect);
      return std::hypot(disc.center_x_m - x, disc.center_y_m - y) < 0.11;
    });
  };
  EXPECT_TRUE(offers(box.x0 - 0.35, box.y0));
  EXPECT_TRUE(offers(box.x1, box.y1 + 0.35));
  EXPECT_FALSE(offers(box.x1 + 1.2, box.y1));
}

TEST(Placebo, OnlyTheRightThrusterAndTheRealCommandsExplain) {
  const Vehicle vehicle = nominal_vehicle();
  ThrusterEfficiency weak;
  weak.thruster = 3;
  weak.factor = 0.8;
  FloorTilt tilt;
  tilt.slope_x = 3e-4;
  std::vector<Flight> flights;
  flights.emplace_back(fly(vehicle, {weak, tilt}, pulse_commands(kStart, 40.0, 5), 6).recording);
  const Problem problem{&vehicle, {}, &flights};
  const NoiseModel noise = initial_noise(flights);
  smooth_all(problem, {weak, tilt}, noise, 4.0);
  const std::vector<Placebo> checks = placebo_checks(problem, evaluate(problem, {weak, tilt}, {}, noise), 1);
  ASSERT_EQ(checks.size(), 2u);
  EXPECT_GT(checks[0].as_claimed, 50.0);
  EXPECT_LT(checks[0].wrong_thruster.value(), 0.5 * checks[0].as_claimed);
  EXPECT_NE(checks[0].best_wrong_thruster, 3);
  EXPECT_LT(checks[0].shuffled_commands.value(), 0.2 * checks[0].as_claimed);
  EXPECT_GT(checks[1].as_claimed, 50.0);
  EXPECT_FALSE(checks[1].wrong_thruster.has_value());
  EXPECT_FALSE(checks[1].shuffled_commands.has_value());
}

TEST(Placebo, NoValveLeaksANegativeJet) {
  // Thruster 3 is opposite to thruster 4: what one lets out the other would have to take in.
  const Vehicle vehicle = nominal_vehicle();
  ThrusterLeak leak;
  leak.thruster = 4;
  leak.fraction = 0.02;
  std::vector<Flight> flights;
  flights.emplace_back(fly(vehicle, {leak}, pulse_commands(kStart, 40.0, 5), 6).recording);
  const Problem problem{&vehicle, {}, &flights};
  const NoiseModel noise = initial_noise(flights);
  smooth_all(problem, {leak}, noise, 4.0);
  const std::vector<Placebo> checks = placebo_checks(problem, evaluate(problem, {leak}, {}, noise), 1);
  EXPECT_GT(checks[0].as_claimed, 50.0);
  EXPECT_LT(checks[0].wrong_thruster.value(), 0.8 * checks[0].as_claimed);
}

TEST(Onset, IsFoundBeyondPulsesThatSpeakAgainstIt) {
  // A wrong onset was found beside what was not known then; the motion was smoothed with it.
  const Vehicle vehicle = nominal_vehicle();
  ThrusterDead dead;
  dead.thruster = 2;
  dead.since_s = kStart + 15.0;
  std::vector<ThrusterCommand> commands = pulse_commands(kStart, 90.0, 5);
  const std::vector<ThrusterCommand> faint = shortened(commands, 0.04);
  for (std::size_t k = 200; k < 600; ++k) commands[k] = faint[k];
  std::vector<Flight> flights;
  flights.emplace_back(fly(vehicle, {dead}, commands, 6).recording);
  const Problem problem{&vehicle, {}, &flights};
  for (const double away : {10.0, 20.0, 30.0, 40.0}) {
    ThrusterDead wrong = dead;
    wrong.since_s += away;
    NoiseModel noise = initial_noise(flights);
    for (int pass = 0; pass < 3; ++pass) {
      smooth_all(problem, {wrong}, noise, 1.0);
      noise = profile_noise(problem, {wrong}, noise, true);
    }
    const double likelihood = evaluate(problem, {dead}, {}, noise).log_likelihood;
    const Fit refined = refine_onset(problem, evaluate(problem, {wrong}, {}, noise), 0);
    EXPECT_GT(refined.log_likelihood, likelihood - 0.5) << away;
  }
}

TEST(Fit, FrictionThatHoldsTheRobotLeavesNoForce) {
  // A velocity that is a millimetre per second off would be a quarter of a newton.
  const Vehicle vehicle = nominal_vehicle();
  const CoulombFriction friction{{}, 1.5e-3};
  Lab lab{6e-4, 2e-3};
  lab.slow_m_s2 = lab.slow_rad_s2 = 0.0;
  const std::vector<ThrusterCommand> commands = shortened(pulse_commands(1.7e9, 60.0, 5), 0.15);
  std::vector<Flight> flights{Flight(fly(vehicle, {friction}, commands, 6, lab).recording)};
  const Problem problem{&vehicle, {}, &flights};
  NoiseModel noise = initial_noise(flights);
  for (int pass = 0; pass < 6; ++pass) {
    smooth_all(problem, {friction}, noise, pass == 0 ? 20.0 : 4.0);
    noise = profile_noise(problem, {friction}, noise, true);
  }
  EXPECT_LT(noise.slow[kX], 1e-4);
  EXPECT_LT(noise.scatter, 0.1);
}

}  // namespace
}  // namespace atmos
