#include "atmos_sim2real/proof.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace atmos {

namespace {

constexpr std::array<double, 3> kHorizons{5.0, 1.0, 10.0};  // s; figures show the first

// Joins the errors of several recordings, weighted by their windows.
struct Joined {
  double squares = 0.0, yaw_squares = 0.0, spread = 0.0;
  std::size_t windows = 0;

  void add(const PredictionError& error, double spread_rms) {
    const auto n = static_cast<double>(error.windows);
    squares += n * error.position_rms_m * error.position_rms_m;
    yaw_squares += n * error.yaw_rms_rad * error.yaw_rms_rad;
    spread += n * spread_rms * spread_rms;
    windows += error.windows;
  }
  PredictionError total() const {
    PredictionError error;
    error.windows = windows;
    if (windows == 0) return error;
    const auto n = static_cast<double>(windows);
    error.position_rms_m = std::sqrt(squares / n);
    error.yaw_rms_rad = std::sqrt(yaw_squares / n);
    error.position_fit_percent = spread > 0.0 ? 100.0 * (1.0 - std::sqrt(squares / spread)) : 0.0;
    return error;
  }
};

// Root mean square distance of the measured points from their mean, which the fit percentage is made of.
double spread_of(const PredictionError& error) {
  const double ratio = 1.0 - error.position_fit_percent / 100.0;
  return ratio > 1e-12 ? error.position_rms_m / ratio : 0.0;
}

// A recording, the part of it that windows may lie in, and the model that has not seen that part.
struct Unseen {
  const Recording* recording;
  double begin_s, end_s;
  std::vector<Effect> fitted;
};

std::vector<WindowStart> every(const std::vector<WindowStart>& starts, double horizon_s, double end_s) {
  std::vector<WindowStart> chosen;
  for (const WindowStart& start : starts) {
    const bool due = chosen.empty() || start.stamp_s > chosen.back().stamp_s + horizon_s - 0.5;
    if (due && start.stamp_s + horizon_s <= end_s + 1e-6) chosen.push_back(start);
  }
  return chosen;
}

// Errors at the ends of windows from `starts` of a flight if the model were right and only `noise` disturbed
// it: the covariance that a filter has at each start, propagated open loop.
PredictionError noise_floor(const Flight& flight, const NoiseModel& noise,
                            const std::vector<WindowStart>& starts, double horizon_s) {
  const std::vector<double>& times = flight.times();
  PredictionError error;
  double squares[kAxes] = {0.0, 0.0, 0.0};
  for (int axis = 0; axis < kAxes; ++axis) {
    const std::vector<double>& scatter = flight.scatter_variance()[static_cast<std::size_t>(axis)];
    AxisCovariance filter(noise, static_cast<Axis>(axis));
    std::size_t next = 0;
    for (std::size_t i = 0; i < times.size() && next < starts.size(); ++i) {
      filter.see();
      if (times[i] >= starts[next].stamp_s - 1e-6) {
        AxisCovariance window = filter;
        window.forget_what_predictions_leave_out();
        for (std::size_t j = i; j + 1 < times.size() && times[j] < starts[next].stamp_s + horizon_s; ++j)
          window.advance(Transition(noise, times[j + 1] - times[j], flight.travel()[j]), scatter[j]);
        squares[axis] += window.shown_variance();
        ++next;
      }
      if (i + 1 < times.size())
        filter.advance(Transition(noise, times[i + 1] - times[i], flight.travel()[i]), scatter[i]);
    }
    if (axis == 0) error.windows = next;
  }
  if (error.windows == 0) return error;
  const auto n = static_cast<double>(error.windows);
  error.position_rms_m = std::sqrt((squares[kX] + squares[kY]) / n);
  error.yaw_rms_rad = std::sqrt(squares[kYaw] / n);
  return error;
}

Proof prove(const Problem& problem, const NoiseModel& noise, const std::vector<Unseen>& parts) {
  std::array<std::array<Joined, 3>, kHorizons.size()> joined;
  struct Result {
    std::array<std::array<PredictionError, 3>, kHorizons.size()> errors;
    std::vector<PredictedPose> nominal, fitted;
  };
  std::vector<Result> results(parts.size());
  in_parallel(parts.size(), [&](std::size_t p) {
    const Unseen& part = parts[p];
    const Recording& recording = *part.recording;
    std::vector<Effect> fitted = problem.known;
    fitted.insert(fitted.end(), part.fitted.begin(), part.fitted.end());
    const OpenLoop nominal_loop(recording, *problem.vehicle, problem.known);
    std::optional<OpenLoop> own;  // where anything was fitted
    if (!part.fitted.empty()) own.emplace(recording, *problem.vehicle, fitted);
    const OpenLoop& fitted_loop = own ? *own : nominal_loop;
    const auto starts_of = [&](const OpenLoop& loop) {
      std::vector<WindowStart> starts = loop.window_starts(1.0);
      starts.erase(std::remove_if(starts.begin(), starts.end(),
                                  [&](const WindowStart& start) {
                                    return start.stamp_s < part.begin_s || start.stamp_s > part.end_s;
                                  }),
                   starts.end());
      return starts;
    };
    const std::vector<WindowStart> nominal_starts = starts_of(nominal_loop);
    const std::vector<WindowStart> fitted_starts = starts_of(fitted_loop);
    Flight smoothed(recording);
    smoothed.smooth(Plant(*problem.vehicle, fitted, recording.start_s()), noise, 1.0);
    for (std::size_t h = 0; h < kHorizons.size(); ++h) {
      const double horizon = kHorizons[h];
      const auto rows = [&](const OpenLoop& loop, const std::vector<WindowStart>& starts) {
        return loop.predict(every(starts, horizon, part.end_s), horizon);
      };
      const std::vector<PredictedPose> nominal_rows = rows(nominal_loop, nominal_starts);
      const std::vector<PredictedPose> fitted_rows = own ? rows(*own, fitted_starts) : nominal_rows;
      auto& [nominal, with_effects, floor] = results[p].errors[h];
      nominal = prediction_error(recording, nominal_rows);
      with_effects = prediction_error(recording, fitted_rows);
      floor = noise_floor(smoothed, noise, every(fitted_starts, horizon, part.end_s), horizon);
      floor.windows = nominal.windows;
      if (h == 0) {
        results[p].nominal = nominal_rows;
        results[p].fitted = fitted_rows;
      }
    }
  });

  Proof proof;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    for (std::size_t h = 0; h < kHorizons.size(); ++h) {
      const double spread = spread_of(results[p].errors[h][0]);
      for (std::size_t k = 0; k < 3; ++k) joined[h][k].add(results[p].errors[h][k], spread);
    }
    const bool continues = p > 0 && parts[p].recording == parts[p - 1].recording;
    if (!continues) proof.predicted.push_back({*parts[p].recording, {}, {}});
    PredictedRecording& shown = proof.predicted.back();
    shown.nominal.insert(shown.nominal.end(), results[p].nominal.begin(), results[p].nominal.end());
    shown.fitted.insert(shown.fitted.end(), results[p].fitted.begin(), results[p].fitted.end());
  }
  for (std::size_t h = 0; h < kHorizons.size(); ++h) {
    proof.horizons.push_back(
        {kHorizons[h], joined[h][0].total(), joined[h][1].total(), joined[h][2].total()});
  }
  return proof;
}

// The model's parameters as other flights have them; pushes stay, as those know nothing of them.
std::vector<Effect> refitted(const Problem& problem, Fit final, std::vector<Flight> others) {
  final.hold([&](const FreeParameter& free) {
    return std::holds_alternative<ExternalImpulse>(final.effects[free.effect]);
  });
  if (final.free.empty()) return final.effects;
  const Problem rest{problem.vehicle, problem.known, &others};
  for (std::size_t f = 0; f < others.size(); ++f)
    others[f].smooth(rest.plant(final.effects, f), final.noise, 4.0);
  return refine(rest, evaluate(rest, final.effects, final.free, final.noise), 3).effects;
}

Recording between(Recording recording, double begin_s, double end_s) {
  auto& poses = recording.poses;
  poses.erase(
      std::remove_if(poses.begin(), poses.end(),
                     [&](const PoseSample& pose) { return pose.time_s < begin_s || pose.time_s > end_s; }),
      poses.end());
  return recording;
}

}  // namespace

Proof prove_held_out(const Problem& problem, const Fit& final, const std::vector<Recording>& held_out) {
  std::vector<Unseen> parts;
  for (const Recording& recording : held_out)
    parts.push_back(
        {&recording, recording.poses.front().time_s, recording.poses.back().time_s, final.effects});
  Proof proof = prove(problem, final.noise, parts);
  proof.on = kHeldOut;
  return proof;
}

Proof prove_on_blocks(const Problem& problem, const Fit& final) {
  const std::vector<Flight>& flights = *problem.flights;
  std::vector<Unseen> parts;
  for (const Flight& flight : flights)
    parts.push_back({&flight.recording(), flight.times().front(), flight.times().back(), {}});
  if (flights.size() == 1) {
    const double middle = 0.5 * (parts.front().begin_s + parts.front().end_s);
    parts.push_back({parts.front().recording, middle, parts.front().end_s, {}});
    parts.front().end_s = middle;
  }
  in_parallel(parts.size(), [&](std::size_t p) {
    std::vector<Flight> others;
    for (std::size_t other = 0; other < parts.size(); ++other) {
      if (other == p) continue;
      others.push_back(flights.size() > 1 ? flights[other]
                                          : Flight(between(flights.front().recording(), parts[other].begin_s,
                                                           parts[other].end_s)));
    }
    parts[p].fitted = refitted(problem, final, std::move(others));
  });
  Proof proof = prove(problem, final.noise, parts);
  proof.on = kBlocks;
  return proof;
}

}  // namespace atmos
