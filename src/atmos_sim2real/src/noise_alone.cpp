#include "atmos_sim2real/noise_alone.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "atmos_sim2real/screen.h"

namespace atmos {

NoiseAlone noise_alone(const Problem& problem, const Fit& fit, int draws, std::uint32_t seed) {
  constexpr double kBlock = 6.0;  // s
  NoiseAlone alone;
  std::mt19937_64 random(seed);
  for (std::size_t f = 0; f < fit.innovations.size(); ++f) {
    const std::vector<double>& times = (*problem.flights)[f].times();
    NoiseAlone::Flips flips;
    double end = 0.0;
    for (Eigen::Index row = 0; row < fit.innovations[f].size(); ++row) {
      const auto frame = static_cast<std::size_t>(row) % times.size();
      if (frame > 0 && times[frame] < end) continue;
      flips.begins.push_back(row);
      end = times[frame] + kBlock;
    }
    flips.signs.resize(static_cast<Eigen::Index>(flips.begins.size()), draws);
    for (double& sign : flips.signs.reshaped()) sign = random() % 2 == 0 ? 1.0 : -1.0;
    flips.begins.push_back(fit.innovations[f].size());
    alone.flights.push_back(std::move(flips));
  }
  return alone;
}

double p_value(const std::vector<Screened>& scored) {
  double best = -std::numeric_limits<double>::infinity();
  Eigen::ArrayXd largest;
  for (const Screened& screened : scored) {
    if (screened.score_of_noise.empty()) continue;
    const Eigen::Map<const Eigen::ArrayXd> draws(screened.score_of_noise.data(),
                                                 static_cast<Eigen::Index>(screened.score_of_noise.size()));
    largest = largest.size() == 0 ? Eigen::ArrayXd(draws) : Eigen::ArrayXd(largest.max(draws));
    best = std::max(best, screened.score);
  }
  if (largest.size() < 2) return 1.0;
  constexpr double kEuler = 0.5772156649;
  const double mean = largest.mean();
  const double deviation =
      std::sqrt((largest - mean).square().sum() / static_cast<double>(largest.size() - 1));
  const double scale = deviation * std::sqrt(6.0) / M_PI;
  return -std::expm1(-std::exp(-(best - mean) / scale - kEuler));
}

}  // namespace atmos
