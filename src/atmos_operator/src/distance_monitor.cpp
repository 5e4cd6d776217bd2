#include "atmos_operator/distance_monitor.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "atmos_model/allocator.h"

namespace atmos {

namespace {

constexpr double kStep_s = 0.02;  // of the prediction
constexpr double kPoint_s = 0.1;  // between the points of a path
constexpr double kForEver_s = 1e4;
constexpr double kNoise_m = 0.01;  // of a predicted distance: standing robots close by are no danger
constexpr double kStill_m_s = 1e-6;
constexpr double kRest_m_s = 0.02;  // slower than that a stopped robot has come to rest

// Distance gone after t of braking from `speed`.
double braked_way(double speed, double deceleration, double t) {
  const double s = std::clamp(t, 0.0, speed / deceleration);
  return speed * s - 0.5 * deceleration * s * s;
}

bool is_finite(const SeenMotion& m) {
  return std::isfinite(m.stamp_s) && m.p_W.allFinite() && m.v_W.allFinite() && std::isfinite(m.yaw) &&
         std::isfinite(m.yaw_rate);
}

}  // namespace

BrakingAbility braking_ability(const Vehicle& vehicle) {
  const Allocator allocator(vehicle);
  double force = std::numeric_limits<double>::infinity();
  constexpr int kDirections = 72;
  for (int k = 0; k < kDirections; ++k) {
    const double angle = 2.0 * M_PI * k / kDirections;
    force = std::min(force, allocator.attainable_scale({std::cos(angle), std::sin(angle), 0.0}));
  }
  return {vehicle.radius_m, force / vehicle.mass_kg, allocator.max_wrench()[2] / vehicle.inertia_kg_m2.z()};
}

BrakingPath::BrakingPath(const SeenMotion& from, const BrakingAbility& ability,
                         const DistanceMonitorSettings& settings)
    : from_(from),
      deceleration_m_s2_(settings.asked_share * ability.acceleration_m_s2),
      yaw_deceleration_rad_s2_(settings.asked_share * ability.yaw_acceleration_rad_s2),
      coast_s_(0.5 * settings.reaction_s) {
  end_s_ = from.stamp_s + coast_s_ +
           std::max(from.v_W.norm() / deceleration_m_s2_, std::abs(from.yaw_rate) / yaw_deceleration_rad_s2_);
}

BrakingPoint BrakingPath::at(double time_s) const {
  const double t = std::max(0.0, time_s - from_.stamp_s), braking = t - coast_s_;
  BrakingPoint point{time_s, from_.p_W, from_.v_W, Eigen::Vector2d::Zero(), from_.yaw, from_.yaw_rate, 0.0};
  point.p_W += std::min(t, coast_s_) * from_.v_W;
  point.yaw += std::min(t, coast_s_) * from_.yaw_rate;
  if (braking <= 0.0) return point;

  const double speed = from_.v_W.norm(), a = deceleration_m_s2_;
  if (speed > kStill_m_s) {
    const Eigen::Vector2d along = from_.v_W / speed;
    const bool moving = braking < speed / a;
    point.p_W += braked_way(speed, a, braking) * along;
    point.v_W = moving ? Eigen::Vector2d((speed - a * braking) * along) : Eigen::Vector2d::Zero();
    if (moving) point.a_W = -a * along;
  }
  const double spin = std::abs(from_.yaw_rate), b = yaw_deceleration_rad_s2_;
  const double sense = from_.yaw_rate < 0.0 ? -1.0 : 1.0;
  const bool turning = braking < spin / b;
  point.yaw += sense * braked_way(spin, b, braking);
  point.yaw_rate = turning ? sense * (spin - b * braking) : 0.0;
  point.yaw_acceleration = turning ? -sense * b : 0.0;
  return point;
}

std::vector<BrakingPoint> BrakingPath::points_from(double start_s) const {
  std::vector<BrakingPoint> points;
  const double begin = std::max(start_s, from_.stamp_s);
  for (double t = begin; t < end_s_; t += kPoint_s) points.push_back(at(t));
  const double rest = std::max(begin, end_s_) + kPoint_s;
  for (const double t : {rest, rest + kForEver_s}) {
    points.push_back(at(rest));
    points.back().time_s = t;
  }
  return points;
}

DistanceMonitor::DistanceMonitor(std::vector<Robot> robots, const DistanceMonitorSettings& settings)
    : robots_(std::move(robots)),
      settings_(settings),
      motions_(robots_.size()),
      paths_(robots_.size()),
      settled_(robots_.size(), false),
      allowed_(robots_.size() * robots_.size(), std::numeric_limits<double>::quiet_NaN()) {}

bool DistanceMonitor::seen(std::size_t robot) const {
  const double last_s = motions_[robot] ? motions_[robot]->stamp_s : first_s_;
  return now_s_ - last_s <= settings_.stale_s;
}

Eigen::Vector2d DistanceMonitor::position_now(std::size_t robot) const {
  const SeenMotion& motion = *motions_[robot];
  return motion.p_W + (now_s_ - motion.stamp_s) * motion.v_W;
}

double DistanceMonitor::body_distance(std::size_t a, std::size_t b) const {
  return (position_now(a) - position_now(b)).norm() - robots_[a].ability.radius_m -
         robots_[b].ability.radius_m;
}

// Where a robot is, from where it was seen, t after that, if it brakes with `deceleration`. Until a moving
// robot brakes it may still gain speed.
Eigen::Vector2d DistanceMonitor::way(std::size_t robot, double deceleration, double t) const {
  const Eigen::Vector2d& v_W = motions_[robot]->v_W;
  if (v_W.norm() < kStill_m_s) return Eigen::Vector2d::Zero();
  const double speed = most_speed(robot), reaction = settings_.reaction_s;
  const double length = speed * std::min(t, reaction) + braked_way(speed, deceleration, t - reaction);
  return length * v_W.normalized();
}

double DistanceMonitor::most_speed(std::size_t robot) const {
  const double seen = motions_[robot]->v_W.norm();
  return seen + std::min(seen, robots_[robot].ability.acceleration_m_s2 * settings_.reaction_s);
}

// Whichever of the two brakes better: where ways cross, the later one may be the worse off for it.
double DistanceMonitor::least_distance_if_braked(std::size_t a, std::size_t b) const {
  const Eigen::Vector2d apart = position_now(a) - position_now(b);
  const double full_a = robots_[a].ability.acceleration_m_s2, full_b = robots_[b].ability.acceleration_m_s2;
  const double end_s = settings_.reaction_s +
                       std::max(most_speed(a) / full_a, most_speed(b) / full_b) / settings_.counted_share;
  double least = apart.norm();
  for (const double share_a : {settings_.counted_share, settings_.asked_share}) {
    for (const double share_b : {settings_.counted_share, settings_.asked_share}) {
      for (double t = kStep_s; t < end_s + kStep_s; t += kStep_s)
        least = std::min(least, (apart + way(a, share_a * full_a, t) - way(b, share_b * full_b, t)).norm());
    }
  }
  return least - robots_[a].ability.radius_m - robots_[b].ability.radius_m;
}

void DistanceMonitor::stop(std::size_t robot, const std::string& why, std::vector<std::size_t>& stopped) {
  if (paths_[robot] || !motions_[robot]) return;
  paths_[robot].emplace(*motions_[robot], robots_[robot].ability, settings_);
  settled_[robot] = false;
  reason_ = why;
  stopped.push_back(robot);
}

std::vector<std::size_t> DistanceMonitor::see(std::size_t robot, const SeenMotion& motion) {
  std::vector<std::size_t> stopped;
  if (!is_finite(motion) || (motions_[robot] && motion.stamp_s <= motions_[robot]->stamp_s)) return stopped;
  motions_[robot] = motion;
  now_s_ = std::max(now_s_, motion.stamp_s);
  first_s_ = std::min(first_s_, motion.stamp_s);

  // It came to rest where its controller brought it, not where its path ends: it is not to creep back.
  if (paths_[robot] && !settled_[robot] && motion.v_W.norm() < kRest_m_s) {
    settled_[robot] = true;
    paths_[robot].emplace(motion, robots_[robot].ability, settings_);
    stopped.push_back(robot);
  }

  char text[120];
  for (std::size_t other = 0; other < robots_.size(); ++other) {
    if (other == robot) continue;
    if (!seen(other)) {
      std::snprintf(text, sizeof(text), "%s is not seen", robots_[other].name.c_str());
      stop(robot, text, stopped);
      continue;
    }
    if (!motions_[other]) continue;
    const double distance = body_distance(robot, other);
    double& allowed_m = allowed(std::min(robot, other), std::max(robot, other));
    const double grown = std::min(settings_.margin_m, distance - kNoise_m);
    allowed_m = std::isnan(allowed_m) ? grown : std::max(allowed_m, grown);
    const double least = least_distance_if_braked(robot, other);
    if (least >= allowed_m) continue;
    std::snprintf(text, sizeof(text), "%s and %s: %.2f m apart, braking leaves %.2f m",
                  robots_[robot].name.c_str(), robots_[other].name.c_str(), distance, least);
    stop(robot, text, stopped);
    stop(other, text, stopped);
  }
  return stopped;
}

void DistanceMonitor::release() {
  for (auto& path : paths_) path.reset();
  std::fill(allowed_.begin(), allowed_.end(), std::numeric_limits<double>::quiet_NaN());
  reason_.clear();
}

double DistanceMonitor::distance_m(std::size_t robot) const {
  double nearest = std::numeric_limits<double>::infinity();
  if (!motions_[robot]) return nearest;
  for (std::size_t other = 0; other < robots_.size(); ++other) {
    if (other != robot && motions_[other] && seen(other))
      nearest = std::min(nearest, body_distance(robot, other));
  }
  return nearest;
}

}  // namespace atmos
