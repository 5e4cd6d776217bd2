#include "atmos_sim2real/settle.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "atmos_sim2real/discover.h"
#include "atmos_sim2real/floor_map.h"
#include "atmos_sim2real/map_prior.h"
#include "atmos_sim2real/onset.h"
#include "atmos_sim2real/patch.h"

namespace atmos {

NoiseModel with_likelier_pulses(const Problem& problem, const std::vector<Effect>& effects,
                                const NoiseModel& present, double looseness) {
  constexpr double kClear = 3.0;  // nats
  const auto smoothed = [&](NoiseModel noise) {
    smooth_all(problem, effects, noise, looseness);
    noise = profile_noise(problem, effects, noise, true);
    return std::pair(evaluate(problem, effects, {}, noise).log_likelihood, noise);
  };
  NoiseModel other = present;
  other.joins_pulses = !present.joins_pulses;
  const auto [other_likelihood, other_noise] = smoothed(other);
  const auto [likelihood, noise] = smoothed(present);
  if (other_likelihood < likelihood + kClear) return noise;
  smooth_all(problem, effects, other_noise, looseness);
  return other_noise;
}

namespace {

// The priors of all maps but the newest effect were chosen beside less: weighs them again.
Fit with_priors_again(const Problem& problem, Fit current) {
  for (std::size_t i = 0; i + 1 < current.effects.size(); ++i) {
    if (over_the_floor(current.effects[i])) current = with_best_prior(problem, std::move(current), i);
  }
  return current;
}

}  // namespace

Fit settled(const Problem& problem, Fit current, double looseness) {
  constexpr int kMost = 4;
  constexpr double kEnough = 2.0;  // nats
  const auto newest = std::prev(current.effects.end());
  const bool earlier_map = std::any_of(current.effects.begin(), newest, over_the_floor);
  const bool map = earlier_map || over_the_floor(*newest);
  for (int round = 0; round < kMost; ++round) {
    for (std::size_t i = 0; round == 0 && i < current.effects.size(); ++i) {
      current = refine_onset(problem, std::move(current), i);
      current = refine_patch(problem, std::move(current), i, looseness);
    }
    if (round == 0)
      current.noise = with_likelier_pulses(problem, current.effects, current.noise, looseness);
    else
      smooth_all(problem, current.effects, current.noise, looseness);
    const double before = current.log_likelihood;
    current = fit(problem, current.effects, current.free, current.noise,
                  round == 0 ? FitEffort::kThorough : FitEffort::kQuick);
    if (round == 0 && earlier_map)
      current = with_priors_again(problem, std::move(current));
    else if (map)
      break;  // costly, and what it pushes does not depend on the velocity
    if (round > 0 && std::abs(current.log_likelihood - before) < kEnough) break;
  }
  return current;
}

Fit with_pushes_reviewed(const Problem& problem, Fit current, double looseness,
                         const SearchOptions& options) {
  for (std::size_t i = 0; i < current.effects.size(); ++i) {
    if (!std::holds_alternative<ExternalImpulse>(current.effects[i])) continue;
    const auto reviewed = with_pushes_again(problem, current, i, options.accept_gain_of_local);
    if (!reviewed) continue;
    const auto count = [i](const Fit& fit) {
      return std::to_string(std::get<ExternalImpulse>(fit.effects[i]).events.size());
    };
    options.progress("  pushes: " + count(*reviewed) + " instead of " + count(current));
    smooth_all(problem, reviewed->effects, reviewed->noise, looseness);
    current = fit(problem, reviewed->effects, reviewed->free, reviewed->noise, FitEffort::kQuick);
  }
  return current;
}

}  // namespace atmos
