#include "atmos_sim2real/placebo.h"

#include <algorithm>
#include <random>

namespace atmos {

namespace {

using Innovations = std::vector<Eigen::VectorXd>;  // per flight

// Whether its opposite is as physical: no valve leaks a negative jet.
bool goes_both_ways(const Effect& effect) {
  return !std::holds_alternative<ThrusterLeak>(effect) &&
         !std::holds_alternative<ThrusterLeakSince>(effect) &&
         !std::holds_alternative<ThrusterStuckOpen>(effect) && !std::holds_alternative<ThrusterDead>(effect);
}

// What going from `without` to `with` gains when it may go further, or less far, or, if it goes both ways,
// the other way.
double best_gain(const Innovations& from, const Innovations& without, const Innovations& with,
                 bool both_ways) {
  double along = 0.0, squared = 0.0;
  for (std::size_t f = 0; f < from.size(); ++f) {
    const Eigen::VectorXd change = with[f] - without[f];
    along -= from[f].dot(change);
    squared += change.squaredNorm();
  }
  return squared > 0.0 && (both_ways || along > 0.0) ? 0.5 * along * along / squared : 0.0;
}

// The same motion under commands that came in another order.
std::vector<Flight> shuffled(const std::vector<Flight>& flights, std::mt19937& random) {
  std::vector<Flight> out;
  for (const Flight& flight : flights) {
    std::vector<ThrusterCommand> commands = flight.recording().commands;
    for (std::size_t i = commands.size(); i > 1; --i)
      std::swap(commands[i - 1].duty, commands[random() % i].duty);
    out.push_back(flight.under(std::move(commands)));
  }
  return out;
}

}  // namespace

std::vector<Placebo> placebo_checks(const Problem& problem, const Fit& final, std::uint32_t seed) {
  constexpr int kShuffles = 5;
  const auto innovations_of = [&](const Problem& of, const std::vector<Effect>& effects) {
    return evaluate(of, effects, {}, final.noise).innovations;
  };
  std::vector<Placebo> checks(final.effects.size());
  std::vector<std::vector<Effect>> others(final.effects.size(), final.effects);  // without each
  std::vector<Innovations> without;
  for (std::size_t i = 0; i < checks.size(); ++i) {
    others[i].erase(others[i].begin() + static_cast<long>(i));
    without.push_back(innovations_of(problem, others[i]));
    checks[i].as_claimed = best_gain(without[i], without[i], final.innovations, true);

    const int own = thruster_of(final.effects[i]);
    if (own == 0) continue;
    std::vector<Effect> moved = final.effects;
    checks[i].wrong_thruster = 0.0;
    for (int other = 1; other <= static_cast<int>(problem.vehicle->thrusters.size()); ++other) {
      if (other == own) continue;
      set_thruster(moved[i], other);
      const double gain =
          best_gain(without[i], without[i], innovations_of(problem, moved), goes_both_ways(final.effects[i]));
      if (gain < *checks[i].wrong_thruster) continue;
      checks[i].wrong_thruster = gain;
      checks[i].best_wrong_thruster = other;
    }
  }

  std::mt19937 random(seed);
  for (int shuffle = 0; shuffle < kShuffles; ++shuffle) {
    std::vector<Flight> flights = shuffled(*problem.flights, random);
    const Problem placebo{problem.vehicle, problem.known, &flights};
    const Innovations all = innovations_of(placebo, final.effects);
    for (std::size_t i = 0; i < checks.size(); ++i) {
      if (acts_from_outside(final.effects[i])) continue;
      const Innovations rest = innovations_of(placebo, others[i]);
      const double gain = best_gain(without[i], rest, all, goes_both_ways(final.effects[i]));
      // What does not depend on commands changes the same whatever their order.
      double difference = 0.0, size = 0.0;
      for (std::size_t f = 0; f < all.size(); ++f) {
        const Eigen::VectorXd change = final.innovations[f] - without[i][f];
        difference += (all[f] - rest[f] - change).squaredNorm();
        size += change.squaredNorm();
      }
      constexpr double kSame = 1e-3;  // of the change's square
      if (difference > kSame * size)
        checks[i].shuffled_commands = std::max(checks[i].shuffled_commands.value_or(0.0), gain);
    }
  }
  return checks;
}

}  // namespace atmos
