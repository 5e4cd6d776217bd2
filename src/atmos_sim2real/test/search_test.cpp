#include "atmos_sim2real/search.h"

#include <gtest/gtest.h>

#include <array>
#include <optional>

#include "atmos_sim2real/discover.h"
#include "atmos_sim2real/floor_map.h"
#include "atmos_sim2real/simpler_form.h"
#include "synthetic.h"

namespace atmos {
namespace {

constexpr double kStart = 1.7e9;

struct Flown {
  Vehicle vehicle = nominal_vehicle();
  std::vector<Flight> flights;
  Problem problem{&vehicle, {}, &flights};

  Flown(const std::vector<Effect>& truth, double duration_s, std::uint32_t seed) {
    flights.emplace_back(fly(vehicle, truth, pulse_commands(kStart, duration_s, seed), seed + 1).recording);
  }
  Flown(const std::vector<ThrusterCommand>& commands, std::uint32_t seed,
        const std::vector<Effect>& truth = {}) {
    flights.emplace_back(fly(vehicle, truth, commands, seed).recording);
  }
  Flown(const Flown&) = delete;

  // The effects with the free parameters that the library gives their kinds.
  Fit fitted(const std::vector<Effect>& effects) {
    std::vector<FreeParameter> free;
    for (std::size_t i = 0; i < effects.size(); ++i) {
      for (const Hypothesis& hypothesis : hypotheses(vehicle, flights)) {
        if (hypothesis.kind != kind_of(effects[i]) || hypothesis.thruster != thruster_of(effects[i]))
          continue;
        for (const FreeParameter& parameter : at_effect(hypothesis.free, i)) free.push_back(parameter);
      }
    }
    const NoiseModel noise = initial_noise(flights);
    smooth_all(problem, effects, noise, 4.0);
    return fit(problem, effects, free, noise);
  }

  std::vector<Hypothesis> library_without(const std::vector<std::string>& kinds) {
    std::vector<Hypothesis> library;
    for (const Hypothesis& hypothesis : hypotheses(vehicle, flights)) {
      if (std::find(kinds.begin(), kinds.end(), hypothesis.kind) == kinds.end() && hypothesis.law.empty())
        library.push_back(hypothesis);
    }
    return library;
  }
};

TEST(Screening, SaysOfAnEffectsPlaceWhatARefitWithoutItWouldSay) {
  // Without the inertia the thrust moves, and the mass after it.
  const InertiaError inertia{{}, 1.1};
  Flown flown({inertia}, 60.0, 11);
  const Fit both = flown.fitted({ThrustScale{}, inertia});
  const std::vector<Hypothesis> library = flown.library_without({"inertia_error", "thrust_scale"});
  const Screening screening(flown.problem, both, library);

  const Fit rest =
      refine(flown.problem, evaluate(flown.problem, {both.effects[0]}, {both.free.front()}, both.noise), 4);
  const double lost = both.log_likelihood - rest.log_likelihood;
  EXPECT_GT(lost, 20.0) << "there is nothing to compare";
  EXPECT_NEAR(screening.worth(1), lost, 0.1 * lost);
  const Screened refitted = screen(flown.problem, rest, library).front();
  const Screened in_place = screening.in_place_of(1).front();
  EXPECT_EQ(refitted.hypothesis->kind, "mass_error");
  EXPECT_EQ(in_place.hypothesis, refitted.hypothesis) << in_place.hypothesis->kind;
  EXPECT_NEAR(in_place.score, refitted.score, 0.1 * lost);
  // Beside both there is nothing left to explain.
  EXPECT_LT(screening.beside().front().score, 0.1 * lost);
}

TEST(Screening, ThrustersMoveTheRobotTheSameWhateverPushesFromOutside) {
  Tether tether;
  tether.anchor_x_m = 1.0;
  tether.stiffness_n_m = 0.3;
  Flown flown({tether}, 20.0, 21);
  const Fit fit = evaluate(flown.problem, {tether, ThrustScale{}}, {}, initial_noise(flown.flights));
  Fit alone = *without_outside(flown.problem, fit);
  ASSERT_EQ(alone.effects.size(), 1u);
  EXPECT_GT((alone.innovations[0] - fit.innovations[0]).norm(), 1.0) << "the tether does not pull";
  const FreeParameter factor{1, "factor", 0, 1.0, 0.15, 1e-3};
  const Eigen::MatrixXd with_tether =
      column_block(flown.problem, fit, fit.innovations[0], at_effect({factor}, 1), 0);
  const Eigen::MatrixXd without =
      column_block(flown.problem, alone, alone.innovations[0], at_effect({factor}, 0), 0);
  EXPECT_LT((with_tether - without).norm(), 1e-6 * without.norm());
}

// The best start of one kind beside the nominal model.
Screened best_of(Flown& flown, const std::string& kind) {
  std::vector<Hypothesis> library = hypotheses(flown.vehicle, flown.flights);
  library = {*std::find_if(library.begin(), library.end(),
                           [&](const Hypothesis& hypothesis) { return hypothesis.kind == kind; })};
  const NoiseModel noise = initial_noise(flown.flights);
  smooth_all(flown.problem, {}, noise, 5.0);
  const Fit nominal = evaluate(flown.problem, {}, {}, profile_noise(flown.problem, {}, noise, true));
  Screened best = screen(flown.problem, nominal, library).front();
  best.hypothesis = nullptr;  // gone with the library
  return best;
}

TEST(Screening, SeesAMassThatSwingsBetweenTwoFrequenciesOfTheLibrary) {
  Slosh swinging;
  swinging.mass_kg = 1.0;
  swinging.damping_ratio = 0.03;
  for (const double frequency_hz : {0.54, 0.57, 0.6}) {
    swinging.frequency_hz = frequency_hz;
    Flown flown({swinging}, 40.0, 31);
    const Screened best = best_of(flown, Slosh::kKind);
    EXPECT_GT(best.score, 20.0) << frequency_hz << " Hz";
    EXPECT_NEAR(std::get<Slosh>(best.start.effect).frequency_hz, frequency_hz, 0.1 * frequency_hz);
  }
}

TEST(Screening, SeesTheLeverOfAMassThatSwingsFast) {
  Slosh swinging;
  swinging.mass_kg = 1.4;
  swinging.frequency_hz = 1.5;
  swinging.x_m = -0.06;
  Flown flown({swinging}, 40.0, 31);
  const Slosh best = std::get<Slosh>(best_of(flown, Slosh::kKind).start.effect);
  EXPECT_LT(best.x_m, 0.0);
  EXPECT_EQ(best.y_m, 0.0);
}

TEST(Screening, SeesADelayThatIsLongerThanMostPulses) {
  Flown flown({CommandDelay{{}, 0.045}}, 40.0, 31);
  EXPECT_NEAR(std::get<CommandDelay>(best_of(flown, CommandDelay::kKind).start.effect).delay_s, 0.045, 0.01);
}

TEST(Library, NoMoreThanHalfOfTheVehicleSwings) {
  Flown flown({}, 10.0, 41);
  Slosh heavy;
  heavy.mass_kg = flown.vehicle.mass_kg;
  std::vector<Effect> effects{heavy};
  for (const Hypothesis& hypothesis : hypotheses(flown.vehicle, flown.flights)) {
    if (hypothesis.kind == Slosh::kKind) clamp_to_bounds(effects, hypothesis.free);
  }
  EXPECT_DOUBLE_EQ(std::get<Slosh>(effects.front()).mass_kg, 0.5 * flown.vehicle.mass_kg);
  EXPECT_NO_THROW(Plant(flown.vehicle, effects, kStart));
}

TEST(Library, TheFloorReachesACellBeyondTheBearings) {
  Flown flown({}, 40.0, 41);
  const Box box = visited(flown.flights);
  for (const Hypothesis& hypothesis : hypotheses(flown.vehicle, flown.flights)) {
    if (hypothesis.kind != FloorUnevenness::kKind) continue;
    const Lattice lattice = lattice_of(hypothesis.starts.front().effect);
    const double reach = 0.15 + lattice.grid.spacing_m;
    const Eigen::Vector2d low = lattice.place(0), high = lattice.place(lattice.nodes() - 1);
    EXPECT_LE(low.x(), box.x0 - reach);
    EXPECT_LE(low.y(), box.y0 - reach);
    EXPECT_GE(high.x(), box.x1 + reach);
    EXPECT_GE(high.y(), box.y1 + reach);
  }
}

TEST(Library, ValvesThatSwallowPulsesAreMovedInFineSteps) {
  // Pulses of 2 to 10 ms: later opening swallows some, later closing brings them back, and a slope over many
  // of them does not say what both together do.
  const std::vector<ThrusterCommand> commands = shortened(pulse_commands(kStart, 40.0, 71), 0.1);
  const ValveDelay valves{{}, 0.0081, 0.0034}, later{{}, 0.0082, 0.0035};
  Flown flown(commands, 72, {valves});
  const Fit fit = flown.fitted({valves});
  const Fit now = evaluate(flown.problem, {valves}, fit.free, fit.noise);
  const Eigen::VectorXd slope = linearisation_of(flown.problem, now)->columns[0].rowwise().sum();
  const Eigen::VectorXd moved =
      (evaluate(flown.problem, {later}, {}, fit.noise).innovations[0] - now.innovations[0]) / 1e-4;
  EXPECT_LT((slope - moved).norm(), 0.3 * moved.norm());
}

// A law that contains a named effect must not be believed more readily of a large one: a drag of
// 18 N s2/m2 was once called a power of the speed with an exponent of 0.501.
TEST(Library, ADragIsAsPlausibleAsTheLawThatContainsIt) {
  Flown flown({}, 10.0, 41);
  double named = 0.0, of_law = 0.0;
  for (const Hypothesis& hypothesis : hypotheses(flown.vehicle, flown.flights)) {
    if (hypothesis.kind == QuadraticDrag::kKind) named = hypothesis.free.front().prior_width;
    if (hypothesis.law == "a drag that grows with a power of the speed")
      of_law = hypothesis.free.front().prior_width;
  }
  ASSERT_GT(of_law, 0.0);
  EXPECT_GE(named, of_law);
}

std::vector<std::string> named_by(Flown& flown) {
  const SearchResult found = search(flown.problem, hypotheses(flown.vehicle, flown.flights), SearchOptions());
  std::vector<std::string> kinds;
  for (const Claim& claim : found.claims) kinds.push_back(claim.hypothesis.kind);
  std::sort(kinds.begin(), kinds.end());
  return kinds;
}

// The simpler form of a fitted effect, if it has one.
std::optional<Effect> simpler(Flown& flown, const Effect& effect) {
  const std::vector<Hypothesis> library = hypotheses(flown.vehicle, flown.flights);
  const auto claimed = std::find_if(library.begin(), library.end(), [&](const Hypothesis& hypothesis) {
    return hypothesis.kind == kind_of(effect) && hypothesis.thruster == thruster_of(effect);
  });
  const auto form = simpler_form(flown.problem, flown.fitted({effect}), 0, *claimed, library);
  if (!form) return std::nullopt;
  return form->fit.effects.back();
}

TEST(SimplerForm, ValvesThatOpenAsLateAsTheyCloseAreLateCommands) {
  Flown late({CommandDelay{{}, 0.045}}, 40.0, 51);
  const auto delay = simpler(late, ValveDelay{{}, 0.04, 0.05});
  ASSERT_TRUE(delay && std::holds_alternative<CommandDelay>(*delay));
  EXPECT_NEAR(std::get<CommandDelay>(*delay).delay_s, 0.045, 0.001);
  Flown valves({ValveDelay{{}, 0.009, 0.017}}, 40.0, 52);
  EXPECT_FALSE(simpler(valves, ValveDelay{{}, 0.009, 0.017}));
}

TEST(SimplerForm, AThrusterWithoutThrustIsDead) {
  ThrusterDead dead;
  dead.thruster = 5;
  ThrusterEfficiency weak;
  weak.thruster = 5;
  weak.factor = 0.05;
  Flown without({dead}, 40.0, 61);
  const auto form = simpler(without, weak);
  ASSERT_TRUE(form && std::holds_alternative<ThrusterDead>(*form));
  EXPECT_EQ(std::get<ThrusterDead>(*form).thruster, 5);
  weak.factor = 0.1;
  Flown weakly({weak}, 40.0, 62);
  EXPECT_FALSE(simpler(weakly, weak));
}

ExternalImpulse pushes_along_x(const std::vector<std::pair<double, double>>& at_and_n_s) {
  ExternalImpulse pushes;
  for (const auto& [at_s, n_s] : at_and_n_s) pushes.events.push_back({kStart + at_s, {n_s, 0.0}, 0.0});
  return pushes;
}

TEST(Pushes, ThoseThatWereMissedAreFoundAndThoseThatAreNotThereGo) {
  const ExternalImpulse truth = pushes_along_x({{15.0, 0.2}, {18.0, -0.15}});
  Flown flown({truth}, 40.0, 81);
  const auto believed_of = [&](const ExternalImpulse& pushes) {
    smooth_all(flown.problem, {pushes}, initial_noise(flown.flights), 4.0);
    const NoiseModel noise = profile_noise(flown.problem, {truth}, initial_noise(flown.flights), true);
    return evaluate(flown.problem, {pushes}, {}, noise);
  };
  constexpr double kEach = 20.0;
  const auto reviewed =
      with_pushes_again(flown.problem, believed_of(pushes_along_x({{15.0, 0.2}, {30.0, 1e-4}})), 0, kEach);
  ASSERT_TRUE(reviewed);
  const auto& events = std::get<ExternalImpulse>(reviewed->effects.front()).events;
  ASSERT_EQ(events.size(), 2u);
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_NEAR(events[k].time_s, truth.events[k].time_s, 0.1);
    EXPECT_NEAR(events[k].impulse_n_s.x(), truth.events[k].impulse_n_s.x(), 0.02);
  }
  EXPECT_FALSE(with_pushes_again(flown.problem, believed_of(truth), 0, kEach));
}

TEST(Search, NamesClockAndValvesTogether) {
  Flown flown({ValveDelay{{}, 0.009, 0.017}}, 60.0, 2);
  Recording skewed = flown.flights.front().recording();
  for (PoseSample& pose : skewed.poses) pose.time_s = kStart + (pose.time_s - kStart) * (1.0 - 2e-3);
  flown.flights.front() = Flight(skewed);
  EXPECT_EQ(named_by(flown), (std::vector<std::string>{"clock_skew", "valve_delay"}));
}

TEST(Search, AMocapThatIsDistortedOverTheFloorIsNoEffect) {
  // Back and forth along x and y, half a metre each.
  std::vector<ThrusterCommand> commands;
  for (int k = 0; k < 1000; ++k) {
    ThrusterCommand command{kStart + 0.1 * k, 0.1, std::vector<double>(8, 0.0)};
    const int leg = k / 100, within = k % 100;
    const bool out = within < 5 || within >= 85, back = within >= 40 && within < 50;
    const bool along_x = leg % 2 == 0;
    if (out || back) {
      for (const int thruster : along_x ? (out ? std::array{1, 3} : std::array{2, 4})
                                        : (out ? std::array{6, 8} : std::array{5, 7}))
        command.duty[static_cast<std::size_t>(thruster - 1)] = 0.7;
    }
    commands.push_back(command);
  }
  Flown flown(commands, 5);
  Recording distorted = flown.flights.front().recording();
  for (PoseSample& pose : distorted.poses) {
    const double x = pose.x_m;
    pose.x_m += 1.6e-3 * std::sin(6.0 * x + 4.0 * pose.y_m);
    pose.y_m += 1.6e-3 * std::cos(5.0 * x - 6.0 * pose.y_m);
  }
  flown.flights.front() = Flight(distorted);
  EXPECT_EQ(named_by(flown), std::vector<std::string>());
}

TEST(Search, SeesWhetherThrustScattersByOpeningOrByCommand) {
  // Push, brake, push back, brake: for 0.4 s each at first, then for 0.1 s.
  std::vector<ThrusterCommand> commands = pulse_commands(kStart, 80.0, 91);
  for (std::size_t k = 0; k < commands.size(); ++k) {
    const bool begins = k % 10 == 0;
    for (double& duty : commands[k].duty) duty = begins && duty > 0.0 ? 1.0 : 0.0;
    if (!begins && k % 10 < 4 && k < 400) commands[k].duty = commands[k - 1].duty;
  }
  for (const bool by_opening : {false, true}) {
    Lab lab{5e-4, 2e-3, 0.05};
    lab.scatter_s = by_opening ? 1.0 : 0.1;
    Flown flown({}, 1.0, 92);
    flown.flights = {Flight(fly(flown.vehicle, {}, commands, 93, lab).recording)};
    const std::vector<Hypothesis> few{hypotheses(flown.vehicle, flown.flights).front()};
    EXPECT_EQ(search(flown.problem, few, SearchOptions()).final.noise.joins_pulses, by_opening);
  }
}

TEST(Search, AForceThatGoesRoundIsNoVibrationAlongALine) {
  Unmodelled round;
  round.force_x_n = "a*cos(9*t)";
  round.force_y_n = "a*sin(9*t)";
  round.coefficients = {{"a", {0.2, "N"}}};
  Flown circling({round}, 60.0, 2);
  EXPECT_EQ(named_by(circling), (std::vector<std::string>{"unmodelled"}));
  FloorVibration along;
  along.amplitude_n = 0.2;
  along.frequency_hz = 1.4;
  along.direction_rad = 0.7;
  Flown swinging({along}, 60.0, 2);
  EXPECT_EQ(named_by(swinging), (std::vector<std::string>{"floor_vibration"}));
}

TEST(Search, AThrusterDiesInThePulseAfterALongRest) {
  std::vector<ThrusterCommand> commands = pulse_commands(kStart, 60.0, 2);
  for (int k = 270; k < 330; ++k) commands[static_cast<std::size_t>(k)].duty[4] = 0.0;
  commands[330].duty[4] = 1.0;
  const double since_s = kStart + 33.06;
  Flown flown(commands, 3, {ThrusterDead{{}, 5, since_s}});
  const SearchResult found = search(flown.problem, hypotheses(flown.vehicle, flown.flights), SearchOptions());
  ASSERT_EQ(found.claims.size(), 1u);
  const auto* dead = std::get_if<ThrusterDead>(&found.final.effects.front());
  ASSERT_NE(dead, nullptr);
  EXPECT_NEAR(dead->since_s, since_s, 0.03);
}

TEST(Search, NamesALawThatNoTwoKnownEffectsExplain) {
  Unmodelled lift;
  lift.force_x_n = "-k*vy";
  lift.force_y_n = "k*vx";
  lift.coefficients = {{"k", {1.5, "N s/m"}}};
  Flown flown({lift}, 60.0, 2);
  EXPECT_EQ(named_by(flown), (std::vector<std::string>{"unmodelled"}));
}

TEST(Search, AMagnetUnderTheFloorIsNoUnevenFloor) {
  const std::string dx = "(-0.4 - x - r*cos(yaw))", dy = "(-0.35 - y - r*sin(yaw))";
  const std::string pull = "k*exp(-(" + dx + "^2 + " + dy + "^2)/w^2)";
  Unmodelled magnet;
  magnet.force_x_n = dx + "*" + pull;
  magnet.force_y_n = dy + "*" + pull;
  magnet.torque_n_m = "(r*cos(yaw)*" + dy + " - r*sin(yaw)*" + dx + ")*" + pull;
  magnet.coefficients = {{"k", {0.5, "N/m"}}, {"r", {0.15, "m"}}, {"w", {0.55, "m"}}};
  Flown flown({magnet}, 90.0, 2);
  EXPECT_EQ(named_by(flown), (std::vector<std::string>{"unmodelled"}));
}

}  // namespace
}  // namespace atmos
