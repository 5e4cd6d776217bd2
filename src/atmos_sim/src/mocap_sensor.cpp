#include "atmos_sim/mocap_sensor.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

namespace atmos {

namespace {

constexpr double kSameInstant = 1e-7;  // s: frames and dropouts are told apart far more coarsely

// In (0, 1): 53 random bits, never 0, so that its logarithm exists. Own code, because the standard leaves the
// algorithm of its distributions to the library.
double uniform(std::mt19937_64& random) { return (static_cast<double>(random() >> 11) + 0.5) * 0x1p-53; }

// Two independent standard normal numbers (Box and Muller).
Vec2<double> normal_pair(std::mt19937_64& random) {
  const double radius = std::sqrt(-2.0 * std::log(uniform(random)));
  const double angle = 2.0 * M_PI * uniform(random);
  return {radius * std::cos(angle), radius * std::sin(angle)};
}

}  // namespace

MocapSensor::MocapSensor(const MocapSettings& settings, std::uint32_t seed, double start_s)
    : settings_(settings),
      start_s_(start_s),
      frame_(static_cast<std::int64_t>(std::ceil((start_s - kSameInstant) * settings.rate_hz))),
      random_(seed) {}

MocapFrame MocapSensor::expose(const Simulation& simulation) {
  const double due = next_frame_s();
  ++frame_;
  assert(std::abs(simulation.time_s() - due) < kSameInstant);
  const PlantProperties& plant = simulation.plant().properties();

  // Always the same draws, whatever becomes of the frame.
  const Vec2<double> noise_W = settings_.noise_m * normal_pair(random_);
  const double noise_yaw = settings_.noise_rad * normal_pair(random_).x();
  const bool lost_by_chance = uniform(random_) < settings_.dropout_probability;

  const double shown = due - plant.mocap_latency_s;
  // docs/effects.md, clock_skew: t0 + (t - t0)(1 + ratio) + latency for the instant t that is shown.
  MocapFrame frame{due + (shown - start_s_) * plant.stamp_skew, {}};
  const double since_start = due - start_s_;
  const bool in_stretch =
      std::any_of(settings_.dropouts.begin(), settings_.dropouts.end(), [&](const Dropout& dropout) {
        return since_start >= dropout.start_s - kSameInstant &&
               since_start < dropout.start_s + dropout.duration_s - kSameInstant;
      });
  if (lost_by_chance || in_stretch) {
    frame.pose.p_W.setConstant(std::numeric_limits<double>::quiet_NaN());
    frame.pose.yaw = std::numeric_limits<double>::quiet_NaN();
    return frame;
  }
  const PlanarState<double> measured = simulation.plant().measured(simulation.center_of_mass_at(shown));
  frame.pose.p_W = measured.p_WC + noise_W;
  frame.pose.yaw = measured.yaw + noise_yaw;
  return frame;
}

}  // namespace atmos
