#include "atmos_sim2real/discover.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <unsupported/Eigen/FFT>

#include "atmos_sim2real/laws.h"

namespace atmos {

namespace {

constexpr std::size_t kResponse = 200;  // frames: 4 s, by which the filter has forgotten a jump
constexpr std::size_t kStride = 2;      // frames between places at which a jump is tried
constexpr std::size_t kMostEvents = 12;

struct Jump {
  std::size_t flight;
  std::size_t frame;
  double gain;             // nats
  double velocity[kAxes];  // m/s, m/s, rad/s
};

// The best single jump of one flight given its innovations.
Jump best_jump(const Flight& flight, std::size_t index, const std::vector<Whitener>& whiteners,
               const Eigen::VectorXd& e) {
  const std::size_t n = flight.frames();
  const std::size_t places = n / kStride;
  std::vector<Jump> found(places);
  in_parallel(places, [&](std::size_t k) {
    const std::size_t at = k * kStride;
    Jump& jump = found[k];
    jump = {index, at, 0.0, {0, 0, 0}};
    if (at < Whitener::kBurnIn || at + 10 >= n) return;
    std::vector<double> h(kResponse);
    for (int axis = 0; axis < kAxes; ++axis) {
      const std::size_t count =
          whiteners[static_cast<std::size_t>(axis)].step_response(at, kResponse, h.data());
      const double* tail = e.data() + static_cast<std::size_t>(axis) * n + at + 1;
      double r = 0.0, power = 1e-300;
      for (std::size_t j = 0; j < count; ++j) {
        r -= h[j] * tail[j];
        power += h[j] * h[j];
      }
      jump.velocity[axis] = r / power;
      jump.gain += 0.5 * r * r / power;
    }
  });
  return *std::max_element(found.begin(), found.end(),
                           [](const Jump& a, const Jump& b) { return a.gain < b.gain; });
}

}  // namespace

namespace {

// Nats that one event must bring: it could have been anywhere.
double event_threshold(const std::vector<Flight>& flights, double least_gain) {
  double searched = 0.0;
  for (const Flight& flight : flights) searched += static_cast<double>(flight.frames() / kStride);
  return least_gain + std::log(searched);
}

void sort_by_time(std::vector<ImpulseEvent>& events) {
  std::sort(events.begin(), events.end(),
            [](const ImpulseEvent& a, const ImpulseEvent& b) { return a.time_s < b.time_s; });
}

std::vector<FreeParameter> free_pushes(const std::vector<ImpulseEvent>& events, std::size_t effect) {
  std::vector<FreeParameter> free;
  for (std::size_t k = 0; k < events.size(); ++k) {
    free.push_back({effect, "events", 4 * k, events[k].time_s, 0.2, 4e-3});
    free.push_back({effect, "events", 4 * k + 1, 0.0, 0.5, 1e-3});
    free.push_back({effect, "events", 4 * k + 2, 0.0, 0.5, 1e-3});
    free.push_back({effect, "events", 4 * k + 3, 0.0, 0.05, 1e-4});
  }
  return free;
}

}  // namespace

double smallest_push(const Problem& problem, const Fit& fit, double least_gain) {
  std::vector<double> sizes;
  for (std::size_t f = 0; f < problem.flights->size(); ++f) {
    const Flight& flight = (*problem.flights)[f];
    const double mass = problem.plant(fit.effects, f).properties().mass_kg;
    const auto whiteners = flight.whiteners(fit.noise);
    std::vector<double> h(kResponse);
    for (std::size_t at = kResponse; at + kResponse < flight.frames(); at += 50) {
      const std::size_t count = (*whiteners)[kX].step_response(at, kResponse, h.data());
      double power = 1e-300;
      for (std::size_t j = 0; j < count; ++j) power += h[j] * h[j];
      sizes.push_back(mass * std::sqrt(2.0 * event_threshold(*problem.flights, least_gain) / power));
    }
  }
  if (sizes.empty()) return std::numeric_limits<double>::infinity();
  std::nth_element(sizes.begin(), sizes.begin() + static_cast<long>(sizes.size() / 2), sizes.end());
  return sizes[sizes.size() / 2];
}

std::vector<Hypothesis> find_events(const Problem& problem, const Fit& fit, double least_gain) {
  ExternalImpulse impulse;
  const double threshold = event_threshold(*problem.flights, least_gain);

  for (std::size_t f = 0; f < problem.flights->size(); ++f) {
    const Flight& flight = (*problem.flights)[f];
    const PlantProperties properties = problem.plant(fit.effects, f).properties();
    const auto whiteners = flight.whiteners(fit.noise);
    Eigen::VectorXd e = fit.innovations[f];
    const std::size_t n = flight.frames();
    std::vector<double> h(kResponse);
    while (impulse.events.size() < kMostEvents) {
      const Jump jump = best_jump(flight, f, *whiteners, e);
      if (jump.gain < threshold) break;
      const double middle = 0.5 * (flight.times()[jump.frame] + flight.times()[jump.frame + 1]);
      impulse.events.push_back(
          {middle - 0.5 * ExternalImpulse::kDuration,
           {jump.velocity[kX] * properties.mass_kg, jump.velocity[kY] * properties.mass_kg},
           jump.velocity[kYaw] * properties.inertia_kg_m2});
      for (int axis = 0; axis < kAxes; ++axis) {
        const std::size_t count =
            (*whiteners)[static_cast<std::size_t>(axis)].step_response(jump.frame, kResponse, h.data());
        for (std::size_t j = 0; j < count; ++j)
          e[static_cast<Eigen::Index>(static_cast<std::size_t>(axis) * n + jump.frame + 1 + j)] +=
              h[j] * jump.velocity[axis];
      }
    }
  }
  if (impulse.events.empty()) return {};
  sort_by_time(impulse.events);

  Hypothesis hypothesis;
  hypothesis.kind = ExternalImpulse::kKind;
  hypothesis.local = true;
  hypothesis.starts.push_back({impulse, {}});
  hypothesis.penalty = (threshold - least_gain) * static_cast<double>(impulse.events.size());
  hypothesis.free = free_pushes(impulse.events, 0);
  return {hypothesis};
}

namespace {

// The model with other pushes, of which the present numbers are the start; not fitted.
Fit with_pushes(const Fit& fit, std::size_t index, std::vector<ImpulseEvent> events) {
  Fit other;
  other.effects = fit.effects;
  other.noise = fit.noise;
  for (const FreeParameter& free : fit.free) {
    if (free.effect != index) other.free.push_back(free);
  }
  sort_by_time(events);
  const auto after = std::find_if(other.free.begin(), other.free.end(),
                                  [&](const FreeParameter& free) { return free.effect > index; });
  const std::vector<FreeParameter> free = free_pushes(events, index);
  other.free.insert(after, free.begin(), free.end());
  std::get<ExternalImpulse>(other.effects[index]).events = std::move(events);
  return other;
}

Fit fitted(const Problem& problem, Fit start) {
  return fit(problem, std::move(start.effects), std::move(start.free), start.noise, FitEffort::kQuick);
}

}  // namespace

std::optional<Fit> with_pushes_again(const Problem& problem, const Fit& current, std::size_t index,
                                     double least_gain) {
  const double threshold = event_threshold(*problem.flights, least_gain);
  const auto pushes = [index](const Fit& fit) {
    return std::get<ExternalImpulse>(fit.effects[index]).events;
  };
  std::optional<Fit> changed;
  if (const auto more = find_events(problem, current, least_gain); !more.empty()) {
    std::vector<ImpulseEvent> all = pushes(current);
    const auto& found = std::get<ExternalImpulse>(more.front().starts.front().effect).events;
    all.insert(all.end(), found.begin(), found.end());
    Fit extended = fitted(problem, with_pushes(current, index, std::move(all)));
    if (extended.evidence - more.front().penalty > current.evidence) changed = std::move(extended);
  }
  for (;;) {
    const Fit& present = changed ? *changed : current;
    const std::vector<ImpulseEvent> events = pushes(present);
    if (events.size() < 2) return changed;
    std::vector<Fit> without;
    for (std::size_t k = 0; k < events.size(); ++k) {
      std::vector<ImpulseEvent> rest = events;
      rest.erase(rest.begin() + static_cast<long>(k));
      Fit start = with_pushes(present, index, std::move(rest));
      start = evaluate(problem, std::move(start.effects), std::move(start.free), start.noise);
      without.push_back(refine(problem, std::move(start), 2));
    }
    Fit& best = *std::max_element(without.begin(), without.end(), [](const Fit& a, const Fit& b) {
      return a.log_likelihood < b.log_likelihood;
    });
    if (present.log_likelihood - best.log_likelihood > threshold) return changed;
    changed = fitted(problem, std::move(best));
  }
}

namespace {

// The strongest line in the spectrum of the innovations of some axes, where it stands out of white noise.
std::optional<Line> strongest_line(const Flight& flight, const Eigen::VectorXd& innovations, int first_axis,
                                   int last_axis, double least_gain) {
  const std::size_t n = flight.frames();
  std::size_t padded = 1;
  while (padded < 2 * n) padded *= 2;
  const double rate = static_cast<double>(n - 1) / flight.recording().duration_s();
  // Innovations put on an even grid in time, so that lost frames do not smear the line.
  const auto cells = static_cast<std::size_t>(std::lround(flight.recording().duration_s() * rate)) + 1;
  std::vector<double> power(padded / 2, 0.0);
  Eigen::FFT<double> fft;
  for (int axis = first_axis; axis <= last_axis; ++axis) {
    std::vector<double> even(padded, 0.0);
    for (std::size_t i = 0; i < n; ++i) {
      const auto cell = static_cast<std::size_t>(std::lround((flight.times()[i] - flight.times()[0]) * rate));
      if (cell < cells)
        even[cell] += innovations[static_cast<Eigen::Index>(static_cast<std::size_t>(axis) * n + i)];
    }
    std::vector<std::complex<double>> spectrum;
    fft.fwd(spectrum, even);
    for (std::size_t k = 0; k < power.size(); ++k)
      power[k] += std::norm(spectrum[k]) / static_cast<double>(n);
  }
  // Below 0.3 Hz the slow force is at home; near the frame rate's half nothing is left of a force.
  const auto bin = [&](double hz) {
    return static_cast<std::size_t>(hz * static_cast<double>(padded) / rate);
  };
  const std::size_t first = bin(0.3), last = std::min(power.size() - 1, bin(0.4 * rate));
  const auto peak =
      std::max_element(power.begin() + static_cast<long>(first), power.begin() + static_cast<long>(last));
  const double choices = static_cast<double>(last - first);
  if (*peak < least_gain + std::log(choices)) return std::nullopt;
  return Line{static_cast<double>(peak - power.begin()) * rate / static_cast<double>(padded), choices,
              flight.recording().duration_s()};
}

}  // namespace

std::vector<Hypothesis> find_oscillations(const Problem& problem, const Fit& fit, double least_gain) {
  std::vector<Hypothesis> found;
  for (std::size_t f = 0; f < problem.flights->size(); ++f) {
    const Flight& flight = (*problem.flights)[f];
    const auto turning = strongest_line(flight, fit.innovations[f], kYaw, kYaw, least_gain);
    if (turning) found.push_back(swinging_torque(*turning));
    const auto line = strongest_line(flight, fit.innovations[f], kX, kY, least_gain);
    if (!line) continue;

    FloorVibration vibration;
    vibration.frequency_hz = line->frequency_hz;
    vibration.amplitude_n = 1.0;
    // Amplitudes of sine and cosine along x and y by least squares, then the line along which they swing.
    Eigen::MatrixXd Z(fit.innovations[f].size(), 4);
    for (int c = 0; c < 4; ++c) {
      vibration.direction_rad = c < 2 ? 0.0 : M_PI / 2.0;
      vibration.phase_rad = c % 2 == 0 ? 0.0 : M_PI / 2.0;
      Z.col(c) = presence_column(problem, fit, vibration, f);
    }
    const Eigen::Vector4d a = (Z.transpose() * Z).ldlt().solve(-Z.transpose() * fit.innovations[f]);
    Eigen::Matrix2d swing;  // rows: x, y; columns: sine, cosine
    swing << a[0], a[1], a[2], a[3];
    const Eigen::JacobiSVD<Eigen::Matrix2d> svd(swing, Eigen::ComputeFullU | Eigen::ComputeFullV);
    constexpr double kRound = 0.2;  // width over length of an ellipse that is no line
    if (svd.singularValues()[1] > kRound * svd.singularValues()[0]) found.push_back(circling_force(*line));
    vibration.amplitude_n = svd.singularValues()[0];
    vibration.direction_rad = std::atan2(svd.matrixU()(1, 0), svd.matrixU()(0, 0));
    vibration.phase_rad = std::atan2(svd.matrixV()(1, 0), svd.matrixV()(0, 0));
    if (vibration.direction_rad < 0.0) {  // a line has two directions: one in [0, pi)
      vibration.direction_rad += M_PI;
      vibration.phase_rad = std::remainder(vibration.phase_rad + M_PI, 2.0 * M_PI);
    }

    Hypothesis hypothesis;
    hypothesis.kind = FloorVibration::kKind;
    hypothesis.local = true;
    hypothesis.penalty = std::log(line->choices);
    hypothesis.starts.push_back({vibration, {}});
    hypothesis.free = {
        {0, "amplitude_n", 0, 0.0, 0.5, 1e-3},
        {0, "frequency_hz", 0, vibration.frequency_hz, 0.5 / flight.recording().duration_s(), 1e-5},
        {0, "phase_rad", 0, vibration.phase_rad, 2.0, 1e-3},
        {0, "direction_rad", 0, vibration.direction_rad, 2.0, 1e-3}};
    found.push_back(std::move(hypothesis));
  }
  return found;
}

}  // namespace atmos
