// Random numbers that are the same with every standard library, which leaves the algorithm of its
// distributions open.
#pragma once

#include <cmath>
#include <random>

#include "atmos_model/planar.h"

namespace atmos {

// In (0, 1): 53 random bits, never 0, so that its logarithm exists.
inline double uniform(std::mt19937_64& random) {
  return (static_cast<double>(random() >> 11) + 0.5) * 0x1p-53;
}

// Two independent standard normal numbers (Box and Muller).
inline Vec2<double> normal_pair(std::mt19937_64& random) {
  const double radius = std::sqrt(-2.0 * std::log(uniform(random)));
  const double angle = 2.0 * M_PI * uniform(random);
  return {radius * std::cos(angle), radius * std::sin(angle)};
}

}  // namespace atmos
