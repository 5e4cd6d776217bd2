#include "atmos_operator/thrust_arrows.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace atmos {

std::vector<ThrustArrow> thrust_arrows(const Vehicle& vehicle, const std::vector<double>& duty,
                                       double metres_per_newton) {
  std::vector<ThrustArrow> arrows;
  if (duty.size() != vehicle.thrusters.size()) return arrows;
  if (!std::all_of(duty.begin(), duty.end(), [](double d) { return std::isfinite(d); })) return arrows;
  for (std::size_t i = 0; i < duty.size(); ++i) {
    if (duty[i] == 0.0) continue;
    const Thruster& thruster = vehicle.thrusters[i];
    const double length = std::abs(duty[i]) * thruster.force_n * metres_per_newton;
    ThrustArrow arrow{static_cast<int>(i) + 1, thruster.position_m - length * thruster.direction,
                      thruster.position_m};
    if (duty[i] < 0.0) std::swap(arrow.tail_B, arrow.head_B);
    arrows.push_back(arrow);
  }
  return arrows;
}

}  // namespace atmos
