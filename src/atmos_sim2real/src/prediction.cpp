#include "atmos_sim2real/prediction.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <optional>
#include <sstream>
#include <stdexcept>

#include "atmos_model/predictor.h"
#include "atmos_sim2real/likelihood.h"

namespace atmos {

namespace {

constexpr double kRow = 0.1;  // s between the rows of a window

// The effects with a phase that a vibration may have in this recording.
struct Phase {
  std::vector<Effect> effects;
  double handicap;  // nats that speak against it beforehand
};

std::vector<Phase> phases_of(const std::vector<Effect>& effects) {
  constexpr int kPhases = 12;
  constexpr double kAnother = 5.0;  // nats
  std::vector<Phase> phases{{effects, 0.0}};
  for (std::size_t i = 0; i < effects.size(); ++i) {
    if (!std::holds_alternative<FloorVibration>(effects[i])) continue;
    for (int k = 1; k < kPhases; ++k) {
      phases.push_back({effects, kAnother});
      std::get<FloorVibration>(phases.back().effects[i]).phase_rad += k * 2.0 * M_PI / kPhases;
    }
  }
  return phases;
}

}  // namespace

std::vector<WindowStart> read_window_starts(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::invalid_argument(path + ": cannot be read");
  std::vector<WindowStart> starts;
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (number == 1) {
      if (line != "stamp,x,y,yaw,vx,vy,yaw_rate")
        throw std::invalid_argument(path + ":1: the header must be stamp,x,y,yaw,vx,vy,yaw_rate");
      continue;
    }
    if (line.empty()) continue;
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream fields(line);
    WindowStart start;
    PlanarState<double>& s = start.shown;
    std::string rest;
    if (!(fields >> start.stamp_s >> s.p_WC.x() >> s.p_WC.y() >> s.yaw >> s.v_WC.x() >> s.v_WC.y() >>
          s.yaw_rate) ||
        (fields >> rest))
      throw std::invalid_argument(path + ":" + std::to_string(number) + ": must be seven numbers");
    starts.push_back(start);
  }
  if (starts.empty()) throw std::invalid_argument(path + ": has no rows");
  return starts;
}

OpenLoop::OpenLoop(const Recording& recording, const Vehicle& vehicle, const std::vector<Effect>& effects)
    : recording_(recording) {
  // White noise from the first second; the rest of the recording is not looked at.
  Recording beginning = recording;
  beginning.poses.resize(std::min<std::size_t>(beginning.poses.size(), 120));
  const NoiseModel white = initial_noise({Flight::of_every_pose(beginning)});
  const std::vector<Phase> phases = phases_of(effects);
  constexpr double kSlow[] = {2e-4, 1e-3, 5e-3, 2.5e-2};  // m/s^2
  std::vector<std::optional<Track>> tracks(std::size(kSlow) * phases.size());
  in_parallel(tracks.size(), [&](std::size_t k) {
    NoiseModel noise = white;
    const double slow = kSlow[k / phases.size()];
    noise.slow = {slow, slow, 5.0 * slow};
    const Phase& phase = phases[k % phases.size()];
    tracks[k] = track_of(Plant(vehicle, phase.effects, recording.start_s()), noise, phase.handicap);
  });
  for (std::optional<Track>& track : tracks) tracks_.push_back(std::move(*track));
  for (const PoseSample& pose : recording.poses) times_.push_back(pose.time_s);
}

OpenLoop::Track OpenLoop::track_of(Plant plant, const NoiseModel& noise, double handicap) const {
  Flight flight = Flight::of_every_pose(recording_);
  flight.track(plant, noise);
  Track track{std::move(plant), {}, {}, {}};
  const ForceIntegrals forces = flight.integrate(track.plant, &track.hidden);
  const std::size_t n = flight.frames();
  track.log_likelihood.assign(n, -handicap);
  const auto whiteners = flight.whiteners(noise);
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const Whitener& whitener = (*whiteners)[axis];
    std::vector<double> e(n);
    whitener.whiten(forces.measured[axis].data(), forces.dv[axis].data(), forces.dp[axis].data(), e.data());
    double total = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      total -= 0.5 * e[i] * e[i] + whitener.log_deviation(i);
      track.log_likelihood[i] += total;
    }
  }
  track.motion = flight.motion();
  return track;
}

const OpenLoop::Track& OpenLoop::best_at(std::size_t frame) const {
  return *std::max_element(tracks_.begin(), tracks_.end(), [&](const Track& a, const Track& b) {
    return a.log_likelihood[frame] < b.log_likelihood[frame];
  });
}

// Index of the last frame stamped at or before `stamp`; the first one when there is none.
std::size_t OpenLoop::frame_before(double stamp) const {
  const auto after = std::upper_bound(times_.begin(), times_.end(), stamp + 1e-6);
  return after == times_.begin() ? 0 : static_cast<std::size_t>(after - times_.begin()) - 1;
}

std::vector<WindowStart> OpenLoop::window_starts(double horizon_s) const {
  std::vector<WindowStart> starts;
  for (double t = times_.front() + 1.0; t + horizon_s <= times_.back() + 1e-6; t += horizon_s) {
    const std::size_t frame = frame_before(t);
    starts.push_back({times_[frame], best_at(frame).motion[frame]});
  }
  return starts;
}

std::vector<PredictedPose> OpenLoop::predict(const std::vector<WindowStart>& starts, double horizon_s) const {
  const Plant& any = tracks_.front().plant;  // valves know of no phase
  ValveSchedule valves(any.thruster_count(), any.properties().timing);
  for (const ThrusterCommand& command : recording_.commands) valves.add(command);
  const int rows = static_cast<int>(std::lround(horizon_s / kRow));
  std::vector<PredictedPose> predicted;
  for (const WindowStart& start : starts) {
    const std::size_t frame = frame_before(start.stamp_s);
    const Track& track = best_at(frame);
    const Plant& plant = track.plant;
    PlantState state;
    state.time_s = vehicle_time(plant, start.stamp_s);
    state.body = plant.from_measured(start.shown);
    state.hidden = track.hidden[frame];
    for (int row = 1; row <= rows; ++row) {
      const double stamp = start.stamp_s + row * kRow;
      advance(plant, valves, vehicle_time(plant, stamp), state);
      const PlanarState<double> shown = plant.measured(state.body);
      predicted.push_back({start.stamp_s, stamp, shown.p_WC.x(), shown.p_WC.y(), shown.yaw});
    }
  }
  return predicted;
}

PredictionError prediction_error(const Recording& recording, const std::vector<PredictedPose>& predicted) {
  const auto& poses = recording.poses;
  PredictionError error;
  double squares = 0.0, yaw_squares = 0.0, spread = 0.0;
  std::vector<Eigen::Vector2d> measured;
  for (std::size_t i = 0; i < predicted.size(); ++i) {
    const bool last_row =
        i + 1 == predicted.size() || predicted[i + 1].window_start_s != predicted[i].window_start_s;
    if (!last_row) continue;
    const PredictedPose& row = predicted[i];
    const auto after = std::lower_bound(poses.begin(), poses.end(), row.stamp_s,
                                        [](const PoseSample& pose, double t) { return pose.time_s < t; });
    if (after == poses.begin() || after == poses.end()) continue;
    const PoseSample &b = *after, &a = *(after - 1);
    if (b.time_s - a.time_s > 0.05) continue;
    const double u = (row.stamp_s - a.time_s) / (b.time_s - a.time_s);
    const Eigen::Vector2d p(a.x_m + u * (b.x_m - a.x_m), a.y_m + u * (b.y_m - a.y_m));
    const double yaw = a.yaw_rad + u * (b.yaw_rad - a.yaw_rad);
    squares += (p - Eigen::Vector2d(row.x_m, row.y_m)).squaredNorm();
    const double turn = wrap_angle(yaw - row.yaw_rad);
    yaw_squares += turn * turn;
    measured.push_back(p);
  }
  error.windows = measured.size();
  if (measured.empty()) return error;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const auto& p : measured) mean += p / static_cast<double>(measured.size());
  for (const auto& p : measured) spread += (p - mean).squaredNorm();
  const auto n = static_cast<double>(measured.size());
  error.position_rms_m = std::sqrt(squares / n);
  error.yaw_rms_rad = std::sqrt(yaw_squares / n);
  error.position_fit_percent = 100.0 * (1.0 - std::sqrt(squares / std::max(spread, 1e-300)));
  return error;
}

}  // namespace atmos
