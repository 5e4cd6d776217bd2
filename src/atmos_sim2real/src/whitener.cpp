#include "atmos_sim2real/whitener.h"

#include <algorithm>
#include <cmath>

namespace atmos {

namespace {

// 1 - exp(-x) for x >= 0; the arguments here are mostly small, and this is called for every frame.
double lost_share(double x) {
  if (x > 0.02) return -std::expm1(-x);
  return x * (1.0 - x * (0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x / 120.0))));
}

}  // namespace

Transition::Transition(const NoiseModel& noise, double step_s, const Travel& travel) : dt(step_s) {
  const double lost = lost_share(dt / noise.slow_time_s);
  slow_decay = 1.0 - lost;
  slow_to_v = noise.slow_time_s * lost;
  slow_to_p = noise.slow_time_s * (dt - slow_to_v);
  rough_decay = 1.0 - lost_share(travel.path_m / noise.rough_length_m);
  const double x = std::sqrt(3.0) * travel.chord_m / noise.distortion_length_m;
  const double keep = 1.0 - lost_share(x), y = 2.0 * x, turn = travel.turn;
  b_from_b = keep * (1.0 + x);
  b_from_c = keep * x;
  c_from_b = -turn * keep * x;
  c_from_c = turn * keep * (1.0 - x);
  // 1 - exp(-y) (1 + y + y^2 / 2), of which short ways leave nothing but rounding.
  new_bb = y > 0.05 ? 1.0 - keep * keep * (1.0 + y + 0.5 * y * y)
                    : keep * keep * (y * y * y / 6.0) * (1.0 + y / 4.0 + y * y / 20.0);
  new_bc = turn * keep * keep * 0.5 * y * y;
  new_cc = 1.0 - turn * turn * (1.0 - lost_share(y) - keep * keep * (y - 0.5 * y * y));
}

Whitener::Whitener(const std::vector<double>& times, const std::vector<double>& scatter_variance,
                   const std::vector<Travel>& travel, const NoiseModel& noise, Axis axis) {
  const std::size_t n = times.size();
  step_.reserve(n);
  AxisCovariance covariance(noise, axis);
  double product = 1.0;  // of a few variances: one logarithm for all of them
  for (std::size_t i = 0; i < n; ++i) {
    const double variance = covariance.shown_variance();
    const bool settled = i >= static_cast<std::size_t>(kBurnIn);
    if (settled) product *= variance;
    if (i % 16 == 0 || i + 1 == n) {
      log_determinant_ += std::log(product);
      product = 1.0;
    }
    const double dt = i + 1 < n ? times[i + 1] - times[i] : 0.0;
    const Transition to_next(noise, dt, travel[i]);
    step_.push_back({to_next, covariance.see(), settled ? 1.0 / std::sqrt(variance) : 0.0});
    covariance.advance(to_next, scatter_variance[i]);
  }
}

template <class AfterFrame>
void Whitener::run(const double* measured, const double* dv, const double* dp, double* innovations,
                   const AfterFrame& after_frame) const {
  double p = measured[0], v = 0.0, d = 0.0, r = 0.0, b = 0.0, c = 0.0;
  const std::size_t n = step_.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Step& step = step_[i];
    const double e = measured[i] - p - r - b;
    innovations[i] = e * step.inverse_deviation;
    p += step.gain[0] * e;
    v += step.gain[1] * e;
    d += step.gain[2] * e;
    r += step.gain[3] * e;
    b += step.gain[4] * e;
    c += step.gain[5] * e;
    after_frame(i, p, v);
    if (i + 1 == n) break;
    p += v * step.to_next.dt + d * step.to_next.slow_to_p + dp[i];
    v += d * step.to_next.slow_to_v + dv[i];
    d *= step.to_next.slow_decay;
    r *= step.to_next.rough_decay;
    step.to_next.distort(b, c);
  }
}

void Whitener::whiten(const double* measured, const double* dv, const double* dp, double* innovations) const {
  run(measured, dv, dp, innovations, [](std::size_t, double, double) {});
}

namespace {

constexpr std::size_t kLook = 64;  // frames
// Share of the largest innovation. A parameter that flights hardly determine is scaled up far: 1e-6 was seen
// to change a verdict.
constexpr double kForgotten = 1e-11;

bool at_rest(const Whitener::Track& track, std::size_t i) {
  return track.measured[i] == 0.0 && track.dv[i] == 0.0 && track.dp[i] == 0.0;
}

}  // namespace

template <std::size_t N>
void Whitener::run_together(const std::array<const Whitener*, N>& axes, const std::array<Track, N>& tracks,
                            std::size_t first) {
  std::array<double, N> p, v{}, d{}, r{}, b{}, c{};
  for (std::size_t k = 0; k < N; ++k) p[k] = first == 0 ? tracks[k].measured[0] : 0.0;
  const std::size_t n = axes[0]->step_.size();
  double largest = 0.0, recent = 0.0;
  for (std::size_t i = first; i < n; ++i) {
    if (i % kLook == 0) {
      // What was pushed long ago and is forgotten is 0: a node of a map acts now and then.
      largest = std::max(largest, recent);
      std::size_t still = i;
      if (recent < kForgotten * largest) {
        while (still < n && std::all_of(tracks.begin(), tracks.end(),
                                        [&](const Track& track) { return at_rest(track, still); }))
          ++still;
      }
      if (still > i) {
        for (const Track& track : tracks) std::fill(track.innovations + i, track.innovations + still, 0.0);
        p = v = d = r = b = c = {};
        i = still;
        if (i == n) return;
      }
      recent = 0.0;
    }
    for (std::size_t k = 0; k < N; ++k) {
      const Step& step = axes[k]->step_[i];
      const Track& track = tracks[k];
      const double e = track.measured[i] - p[k] - r[k] - b[k];
      track.innovations[i] = e * step.inverse_deviation;
      recent = std::max(recent, std::abs(track.innovations[i]));
      const double after = v[k] + step.gain[1] * e, slow = d[k] + step.gain[2] * e;
      p[k] += step.gain[0] * e + after * step.to_next.dt + slow * step.to_next.slow_to_p + track.dp[i];
      v[k] = after + slow * step.to_next.slow_to_v + track.dv[i];
      d[k] = slow * step.to_next.slow_decay;
      r[k] = (r[k] + step.gain[3] * e) * step.to_next.rough_decay;
      b[k] += step.gain[4] * e;
      c[k] += step.gain[5] * e;
      step.to_next.distort(b[k], c[k]);
    }
  }
}

void Whitener::whiten(const std::vector<Whitener>& axes, const std::array<Track, kAxes>& tracks) {
  const std::size_t n = axes.front().step_.size();
  // Nothing is to be done before the first movement, nor for an axis without any.
  std::array<const Whitener*, kAxes> moving{};
  std::array<Track, kAxes> moved;
  std::size_t count = 0, first = n;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const Track& track = tracks[axis];
    std::size_t begin = 0;
    while (begin < n && at_rest(track, begin)) ++begin;
    first = std::min(first, begin);
    if (begin == n) {
      std::fill(track.innovations, track.innovations + n, 0.0);
      continue;
    }
    moving[count] = &axes[axis];
    moved[count++] = track;
  }
  for (std::size_t k = 0; k < count; ++k) std::fill(moved[k].innovations, moved[k].innovations + first, 0.0);
  if (count == 3) run_together<3>(moving, moved, first);
  if (count == 2) run_together<2>({moving[0], moving[1]}, {moved[0], moved[1]}, first);
  if (count == 1) run_together<1>({moving[0]}, {moved[0]}, first);
}

void Whitener::filter(const double* measured, const double* dv, const double* dp, double* innovations,
                      double* position, double* velocity) const {
  run(measured, dv, dp, innovations, [&](std::size_t i, double p, double v) {
    position[i] = p;
    velocity[i] = v;
  });
}

std::size_t Whitener::step_response(std::size_t at, std::size_t count, double* innovations) const {
  const std::size_t end = std::min(step_.size(), at + 1 + count);
  double p = 0.0, v = 1.0, d = 0.0, r = 0.0, b = 0.0, c = 0.0;
  std::size_t written = 0;
  for (std::size_t i = at + 1; i < end; ++i) {
    // The change happens half-way between the frames; from then on it is what whiten() does with measurements
    // of 0.
    const Transition& before = step_[i - 1].to_next;
    p += v * before.dt * (i == at + 1 ? 0.5 : 1.0) + d * before.slow_to_p;
    v += d * before.slow_to_v;
    d *= before.slow_decay;
    r *= before.rough_decay;
    before.distort(b, c);
    const Step& step = step_[i];
    const double e = -p - r - b;
    innovations[written++] = e * step.inverse_deviation;
    p += step.gain[0] * e;
    v += step.gain[1] * e;
    d += step.gain[2] * e;
    r += step.gain[3] * e;
    b += step.gain[4] * e;
    c += step.gain[5] * e;
  }
  return written;
}

}  // namespace atmos
