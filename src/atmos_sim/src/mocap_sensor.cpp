#include "atmos_sim/mocap_sensor.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "atmos_sim/random.h"

namespace atmos {

namespace {

constexpr double kSameInstant = 1e-7;  // s: frames and dropouts are told apart far more coarsely

constexpr double kShortestWave = 0.8, kLongestWave = 3.0;  // m, of the distortion
constexpr double kLargestJitter = 3.0;                     // standard deviations

}  // namespace

MocapSensor::MocapSensor(const MocapSettings& settings, std::uint32_t seed, double start_s)
    : settings_(settings),
      start_s_(start_s),
      frame_(static_cast<std::int64_t>(std::ceil((start_s - kSameInstant) * settings.rate_hz))),
      random_(seed),
      jitter_(seed + 0x717e5ULL) {
  std::mt19937_64 draw(seed + 0xd15707ULL);
  for (Wave& wave : distortion_) {
    const double length = kShortestWave + (kLongestWave - kShortestWave) * uniform(draw);
    const double direction = 2.0 * M_PI * uniform(draw);
    wave.number_W = 2.0 * M_PI / length * Vec2<double>(std::cos(direction), std::sin(direction));
    wave.phase = 2.0 * M_PI * uniform(draw);
    // A sine of amplitude a varies by a / sqrt 2; the waves are independent.
    wave.amplitude_W = settings_.distortion_m * std::sqrt(2.0 / kWaves) * normal_pair(draw);
  }
}

Vec2<double> MocapSensor::distortion(const Vec2<double>& p_W) const {
  Vec2<double> sum = Vec2<double>::Zero();
  for (const Wave& wave : distortion_)
    sum += std::sin(wave.number_W.dot(p_W) + wave.phase) * wave.amplitude_W;
  return sum;
}

MocapFrame MocapSensor::expose(const Robot& robot) {
  const double due = next_frame_s();
  ++frame_;
  assert(std::abs(robot.time_s() - due) < kSameInstant);
  const PlantProperties& plant = robot.plant().properties();

  // Always the same draws, whatever becomes of the frame.
  const Vec2<double> noise_W = settings_.noise_m * normal_pair(random_);
  const double noise_yaw = settings_.noise_rad * normal_pair(random_).x();
  const bool lost_by_chance = uniform(random_) < settings_.dropout_probability;

  const double shown = due - plant.mocap_latency_s;
  // docs/effects.md, clock_skew: t0 + (t - t0)(1 + ratio) + latency for the instant t that is shown.
  MocapFrame frame{due + (shown - start_s_) * plant.stamp_skew, {}};
  if (settings_.stamp_jitter_s > 0.0)
    frame.stamp_s +=
        settings_.stamp_jitter_s * std::clamp(normal_pair(jitter_).x(), -kLargestJitter, kLargestJitter);
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
  const PlanarState<double> measured = robot.plant().measured(robot.center_of_mass_at(shown));
  frame.pose.p_W = measured.p_WC + distortion(measured.p_WC) + noise_W;
  frame.pose.yaw = measured.yaw + noise_yaw;
  return frame;
}

}  // namespace atmos
