#include "atmos_operator/trajectory_shape.h"

#include <cmath>

namespace atmos {

namespace {

// Share of the way after t, from rest to rest: speed 3 s^2 - 2 s^3 over each ramp, constant in between.
Derivatives progress(double t, double duration) {
  const double ramp = 0.2 * duration, speed = 1.0 / (duration - ramp);
  const bool falling = t > duration - ramp;
  const double u = falling ? duration - t : t;
  if (u >= ramp) return {speed * (t - 0.5 * ramp), speed, 0.0};
  const double s = u / ramp;
  const double way = speed * ramp * (s * s * s - 0.5 * s * s * s * s);
  const double rate = speed * (3.0 - 2.0 * s) * s * s, acceleration = speed / ramp * 6.0 * s * (1.0 - s);
  return falling ? Derivatives{1.0 - way, rate, -acceleration} : Derivatives{way, rate, acceleration};
}

// center + size * sin(multiple * angle + phase) for an angle that moves.
Derivatives wave(double center, double size, double multiple, double phase, const Derivatives& angle) {
  const double at = multiple * angle.value + phase, rate = multiple * angle.rate;
  return {center + size * std::sin(at), size * std::cos(at) * rate,
          size * (std::cos(at) * multiple * angle.acceleration - std::sin(at) * rate * rate)};
}

Derivatives scaled(const Derivatives& a, double factor) {
  return {factor * a.value, factor * a.rate, factor * a.acceleration};
}

}  // namespace

ShapePoint shape_at(const TrajectorySettings& settings, double t) {
  const Derivatives way = progress(t, settings.duration_s);
  const Derivatives angle = scaled(way, 2.0 * M_PI * settings.laps);
  const bool circle = settings.shape == TrajectorySettings::Shape::kCircle;
  ShapePoint point;
  point.x = wave(settings.center_x_m, settings.size_x_m, 1.0, circle ? 0.5 * M_PI : 0.0, angle);
  point.y = wave(settings.center_y_m, settings.size_y_m, circle ? 1.0 : 2.0, 0.0, angle);
  point.yaw = scaled(way, 2.0 * M_PI * settings.yaw_turns);
  point.yaw.value += settings.yaw_rad;
  return point;
}

}  // namespace atmos
