#include "atmos_operator/mission.h"

#include <algorithm>

#include "atmos_operator/trajectory_shape.h"

namespace atmos {

const char* name_of(MissionState state) {
  switch (state) {
    case MissionState::kIdle:
      return "idle";
    case MissionState::kRunning:
      return "running";
    case MissionState::kFinished:
      return "finished";
    case MissionState::kStopped:
      return "stopped";
  }
  return "";
}

std::vector<double> Mission::pending(double now) const {
  std::vector<double> stamps;
  for (const double stamp : announced_stamps_) {
    if (stamp > now) stamps.push_back(stamp);
  }
  return stamps;
}

void Mission::remember(const MissionOrders& orders) {
  for (const auto& point : orders.points) announced_stamps_.push_back(point.stamp);
  for (const auto& trajectory : orders.trajectories) announced_stamps_.push_back(trajectory.stamp());
}

MissionOrders Mission::start(double now) {
  const std::vector<double> left = pending(now);
  announced_stamps_ = left;
  hold_.reset();
  t0_ = now;
  player_.emplace(program_.set_points, now);
  MissionOrders orders;
  orders.points = player_->due(now);
  for (const auto& settings : program_.trajectories) orders.trajectories.push_back(run_of(settings));
  // What an earlier run announced for the future gives way to what this run has for that instant.
  for (const double stamp : left) {
    StampedSetPoint point = *in_force(stamp);
    const TrajectorySettings* curve = nullptr;
    for (const auto& settings : program_.trajectories) {
      const double begin = t0_ + settings.time_s;
      if (begin <= stamp && begin >= point.stamp) curve = &settings;
    }
    const double into_curve_s = curve == nullptr ? 0.0 : stamp - t0_ - curve->time_s;
    if (curve != nullptr && into_curve_s < curve->duration_s) {
      orders.trajectories.push_back({*curve, t0_, into_curve_s});
      continue;
    }
    if (curve != nullptr) {  // over: the robot rests at its end
      const ShapePoint end = shape_at(*curve, curve->duration_s);
      point = {stamp, end.x.value, end.y.value, end.yaw.value};
    }
    point.stamp = stamp;
    orders.points.push_back(point);
  }
  remember(orders);
  return orders;
}

MissionOrders Mission::stop(double now, const StampedSetPoint& hold) {
  MissionOrders orders;
  if (!player_) return orders;
  hold_ = hold;
  hold_->stamp = now;
  orders.points.push_back(*hold_);
  for (const double stamp : pending(now)) {
    orders.points.push_back(hold);
    orders.points.back().stamp = stamp;
  }
  player_.reset();
  return orders;
}

MissionOrders Mission::due(double now) {
  MissionOrders orders;
  if (player_) orders.points = player_->due(now);
  remember(orders);
  return orders;
}

MissionOrders Mission::announced(double now) const {
  MissionOrders orders;
  if (hold_) orders.points.push_back(*hold_);
  if (player_) {
    orders.points = player_->announced(now);
    for (const auto& settings : program_.trajectories) orders.trajectories.push_back(run_of(settings));
  }
  return orders;
}

MissionState Mission::state(double now) const {
  if (hold_) return MissionState::kStopped;
  if (!player_) return MissionState::kIdle;
  double end = t0_ + program_.set_points.back().time_s;
  for (const auto& settings : program_.trajectories)
    end = std::max(end, t0_ + settings.time_s + settings.duration_s);
  return now < end ? MissionState::kRunning : MissionState::kFinished;
}

std::optional<StampedSetPoint> Mission::in_force(double now) const {
  if (!player_) return std::nullopt;
  std::optional<StampedSetPoint> found;
  for (const SetPoint& point : program_.set_points) {
    if (!found || t0_ + point.time_s <= now)
      found = StampedSetPoint{t0_ + point.time_s, point.x_m, point.y_m, point.yaw_rad};
  }
  return found;
}

}  // namespace atmos
