#include "atmos_sim2real/prediction.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "atmos_model/predictor.h"
#include "atmos_sim2real/likelihood.h"

namespace atmos {

namespace {

constexpr double kRow = 0.1;  // s between the rows of a window

// Filters of several trusts in the model run side by side; at any frame the one that has predicted best so
// far counts.
struct CausalTrack {
  std::vector<Flight> flights;                  // one per level
  std::vector<std::vector<double>> likelihood;  // per level, summed up to each frame
  std::size_t best_at(std::size_t frame) const {
    std::size_t best = 0;
    for (std::size_t level = 1; level < likelihood.size(); ++level) {
      if (likelihood[level][frame] > likelihood[best][frame]) best = level;
    }
    return best;
  }
};

CausalTrack track(const Recording& recording, const Plant& plant) {
  CausalTrack out;
  for (const double slow : {2e-4, 1e-3, 5e-3, 2.5e-2}) {
    NoiseModel noise;
    // White noise from the first second; the rest of the recording is not looked at.
    Recording beginning = recording;
    beginning.poses.resize(std::min<std::size_t>(beginning.poses.size(), 120));
    noise = initial_noise({Flight(beginning)});
    noise.slow = {slow, slow, 5.0 * slow};
    Flight flight(recording);
    flight.track(plant, noise);
    const ForceIntegrals forces = flight.integrate(plant);
    const std::size_t n = flight.frames();
    std::vector<double> sum(n, 0.0);
    const auto whiteners = flight.whiteners(noise);
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      const Whitener& whitener = (*whiteners)[axis];
      std::vector<double> e(n);
      whitener.whiten(forces.measured[axis].data(), forces.dv[axis].data(), forces.dp[axis].data(), e.data());
      double total = 0.0;
      for (std::size_t i = 0; i < n; ++i) {
        total -= 0.5 * e[i] * e[i] + whitener.log_deviation(i);
        sum[i] += total;
      }
    }
    out.flights.push_back(std::move(flight));
    out.likelihood.push_back(std::move(sum));
  }
  return out;
}

// Index of the last frame stamped at or before `stamp`; the first one when there is none.
std::size_t frame_before(const std::vector<double>& times, double stamp) {
  const auto after = std::upper_bound(times.begin(), times.end(), stamp + 1e-6);
  return after == times.begin() ? 0 : static_cast<std::size_t>(after - times.begin()) - 1;
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

std::vector<WindowStart> estimate_window_starts(const Recording& recording, const Vehicle& vehicle,
                                                const std::vector<Effect>& effects, double horizon_s) {
  const Plant plant(vehicle, effects, recording.start_s());
  const CausalTrack causal = track(recording, plant);
  const std::vector<double>& times = causal.flights.front().times();
  std::vector<WindowStart> starts;
  for (double t = times.front() + 1.0; t + horizon_s <= times.back() + 1e-6; t += horizon_s) {
    const std::size_t frame = frame_before(times, t);
    starts.push_back({times[frame], causal.flights[causal.best_at(frame)].motion()[frame]});
  }
  return starts;
}

std::vector<PredictedPose> predict(const Recording& recording, const Vehicle& vehicle,
                                   const std::vector<Effect>& effects, const std::vector<WindowStart>& starts,
                                   double horizon_s) {
  const Plant plant(vehicle, effects, recording.start_s());
  ValveSchedule valves(plant.thruster_count(), plant.properties().timing);
  for (const ThrusterCommand& command : recording.commands) valves.add(command);

  // Hidden states that the body's motion drives need a motion: that of the best causal track.
  const CausalTrack causal = track(recording, plant);
  const std::vector<double>& times = causal.flights.front().times();
  std::vector<std::vector<VecX<double>>> hidden(causal.flights.size());
  for (std::size_t level = 0; level < causal.flights.size(); ++level)
    causal.flights[level].integrate(plant, &hidden[level]);

  const int rows = static_cast<int>(std::lround(horizon_s / kRow));
  std::vector<PredictedPose> predicted;
  for (const WindowStart& start : starts) {
    const std::size_t frame = frame_before(times, start.stamp_s);
    PlantState state;
    state.time_s = vehicle_time(plant, start.stamp_s);
    state.body = plant.from_measured(start.shown);
    state.hidden = hidden[causal.best_at(frame)][frame];
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
