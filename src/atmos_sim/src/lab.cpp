#include "atmos_sim/lab.h"

#include <cmath>

#include "atmos_sim/random.h"

namespace atmos {

namespace {

constexpr double kStretch = 0.01;      // s
constexpr double kSameInstant = 1e-6;  // s

}  // namespace

Lab::Lab(const LabSettings& settings, std::uint32_t seed, double start_s, int thruster_count)
    : settings_(settings),
      quiet_(settings.thrust_scatter == 0.0 && settings.slow_force_n == 0.0 &&
             settings.slow_torque_n_m == 0.0),
      start_s_(start_s),
      pulses_(seed + 0x5ca77e5ULL),
      drift_(seed + 0xd51f7ULL),
      before_(VecX<double>::Zero(thruster_count)),
      excess_(VecX<double>::Zero(thruster_count)) {
  slow_.force_W = settings_.slow_force_n * normal_pair(drift_);
  slow_.torque = settings_.slow_torque_n_m * normal_pair(drift_).x();
}

void Lab::valves_moved(const VecX<double>& openings) {
  for (Eigen::Index i = 0; i < openings.size(); ++i) {
    if (openings[i] != 0.0 && before_[i] == 0.0)
      excess_[i] = settings_.thrust_scatter * normal_pair(pulses_).x();
  }
  before_ = openings;
}

PlanarWrench<double> Lab::wrench(double t, const PlantProperties& plant, double yaw,
                                 const VecX<double>& thrust) {
  const auto stretch = static_cast<std::int64_t>(std::floor((t - start_s_ + kSameInstant) / kStretch));
  const double decay = std::exp(-kStretch / settings_.slow_time_s);
  const double renew = std::sqrt(1.0 - decay * decay);
  for (; stretch_ < stretch; ++stretch_) {
    slow_.force_W = decay * slow_.force_W + renew * settings_.slow_force_n * normal_pair(drift_);
    slow_.torque = decay * slow_.torque + renew * settings_.slow_torque_n_m * normal_pair(drift_).x();
  }
  PlanarWrench<double> total = slow_;
  Vec2<double> force_B = Vec2<double>::Zero();
  for (Eigen::Index i = 0; i < thrust.size(); ++i) {
    const PlanarThruster& thruster = plant.thrusters[static_cast<std::size_t>(i)];
    const double excess = excess_[i] * thrust[i];
    force_B += excess * thruster.direction;
    total.torque += excess * cross2(thruster.position_m - plant.com_B, thruster.direction);
  }
  total.force_W += rotation_WB(yaw) * force_B;
  return total;
}

}  // namespace atmos
