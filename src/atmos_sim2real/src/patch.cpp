#include "atmos_sim2real/patch.h"

#include <algorithm>

namespace atmos {

namespace {

constexpr double kWidestStep = 0.16, kFinestStep = 0.003;  // m
constexpr double kBetter = 1.0;                            // nats
constexpr int kMostRounds = 16;
constexpr int kNeighbours = 27;  // in center and radius, itself among them

// The disc's neighbour `n` with the coefficient that suits it.
Fit neighbour(const Problem& problem, const Fit& at, std::size_t effect, double step, int n) {
  std::vector<Effect> effects = at.effects;
  FrictionPatch& patch = std::get<FrictionPatch>(effects[effect]);
  patch.center_x_m += step * (n % 3 - 1);
  patch.center_y_m += step * (n / 3 % 3 - 1);
  patch.radius_m = std::max(0.05, patch.radius_m + step * (n / 9 - 1));
  return refine(problem, evaluate(problem, std::move(effects), at.free, at.noise), 2);
}

}  // namespace

Fit refine_patch(const Problem& problem, Fit fit, std::size_t effect, double looseness) {
  if (!std::holds_alternative<FrictionPatch>(fit.effects[effect])) return fit;
  const std::vector<FreeParameter> all = fit.free;
  fit.hold([&](const FreeParameter& free) { return free.effect != effect || free.name != "coefficient"; });
  double step = kWidestStep;
  for (int round = 0; round < kMostRounds && step > kFinestStep; ++round) {
    // What moves the edge on one side alone moves centre and radius together.
    std::vector<Fit> tried(kNeighbours);
    in_parallel(tried.size(), [&](std::size_t n) {
      tried[n] = neighbour(problem, fit, effect, step, static_cast<int>(n));
    });
    const Fit& same = tried[kNeighbours / 2];
    const Fit& best = *std::max_element(tried.begin(), tried.end(), [](const Fit& a, const Fit& b) {
      return a.log_likelihood < b.log_likelihood;
    });
    const bool better = best.log_likelihood > same.log_likelihood + kBetter;
    fit = best;
    step = better ? std::min(2.0 * step, kWidestStep) : 0.5 * step;
    if (!better) continue;
    smooth_all(problem, fit.effects, fit.noise, looseness);
    fit.noise = profile_noise(problem, fit.effects, fit.noise, false);
  }
  return evaluate(problem, fit.effects, all, fit.noise);
}

}  // namespace atmos
