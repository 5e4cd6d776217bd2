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

Transition::Transition(const NoiseModel& noise, double step_s, double travel_m) : dt(step_s) {
  const double lost = lost_share(dt / noise.slow_time_s);
  slow_decay = 1.0 - lost;
  slow_to_v = noise.slow_time_s * lost;
  slow_to_p = noise.slow_time_s * (dt - slow_to_v);
  distortion_decay = 1.0 - lost_share(travel_m / noise.distortion_length_m);
}

AxisCovariance::AxisCovariance(const NoiseModel& noise, Axis axis)
    : mocap2_(noise.mocap[axis] * noise.mocap[axis]),
      slow2_(noise.slow[axis] * noise.slow[axis]),
      distortion2_(noise.distortion[axis] * noise.distortion[axis]),
      scatter2_(noise.scatter * noise.scatter),
      aa_(slow2_),
      bb_(distortion2_) {}

std::array<double, 4> AxisCovariance::see() {
  const double p = pp_ + pb_, v = pv_ + vb_, a = pa_ + ab_, b = pb_ + bb_;
  const double s = 1.0 / (p + b + mocap2_);
  pp_ -= s * p * p;
  pv_ -= s * p * v;
  pa_ -= s * p * a;
  pb_ -= s * p * b;
  vv_ -= s * v * v;
  va_ -= s * v * a;
  vb_ -= s * v * b;
  aa_ -= s * a * a;
  ab_ -= s * a * b;
  bb_ -= s * b * b;
  return {s * p, s * v, s * a, s * b};
}

void AxisCovariance::advance(const Transition& to, double scatter_variance) {
  // Scatter enters as white acceleration; the floor under it keeps the filter from believing itself without
  // limit.
  const double dt = to.dt, decay = to.slow_decay, keep = to.distortion_decay;
  const double q = scatter2_ * scatter_variance + 1e-12 * dt;
  const double pp = pp_ + dt * pv_ + to.slow_to_p * pa_, pv = pv_ + dt * vv_ + to.slow_to_p * va_;
  const double pa = pa_ + dt * va_ + to.slow_to_p * aa_, pb = pb_ + dt * vb_ + to.slow_to_p * ab_;
  const double vv = vv_ + to.slow_to_v * va_, va = va_ + to.slow_to_v * aa_, vb = vb_ + to.slow_to_v * ab_;
  pp_ = pp + dt * pv + to.slow_to_p * pa + q * dt * dt / 3.0;
  pv_ = pv + to.slow_to_v * pa + q * dt / 2.0;
  pa_ = decay * pa;
  pb_ = keep * pb;
  vv_ = vv + to.slow_to_v * va + q;
  va_ = decay * va;
  vb_ = keep * vb;
  aa_ = decay * decay * aa_ + slow2_ * (1.0 - decay * decay);
  ab_ *= decay * keep;
  bb_ = keep * keep * bb_ + distortion2_ * (1.0 - keep * keep);
}

void AxisCovariance::forget_what_predictions_leave_out() {
  aa_ = slow2_;
  bb_ = distortion2_;
}

Whitener::Whitener(const std::vector<double>& times, const std::vector<double>& scatter_variance,
                   const std::vector<double>& travel, const NoiseModel& noise, Axis axis) {
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
  double p = measured[0], v = 0.0, d = 0.0, b = 0.0;
  const std::size_t n = step_.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Step& step = step_[i];
    const double e = measured[i] - p - b;
    innovations[i] = e * step.inverse_deviation;
    p += step.gain[0] * e;
    v += step.gain[1] * e;
    d += step.gain[2] * e;
    b += step.gain[3] * e;
    after_frame(i, p, v);
    if (i + 1 == n) break;
    p += v * step.to_next.dt + d * step.to_next.slow_to_p + dp[i];
    v += d * step.to_next.slow_to_v + dv[i];
    d *= step.to_next.slow_decay;
    b *= step.to_next.distortion_decay;
  }
}

void Whitener::whiten(const double* measured, const double* dv, const double* dp, double* innovations) const {
  run(measured, dv, dp, innovations, [](std::size_t, double, double) {});
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
  double p = 0.0, v = 1.0, d = 0.0, b = 0.0;
  std::size_t written = 0;
  for (std::size_t i = at + 1; i < end; ++i) {
    // The change happens half-way between the frames; from then on it is what whiten() does with measurements
    // of 0.
    const Transition& before = step_[i - 1].to_next;
    p += v * before.dt * (i == at + 1 ? 0.5 : 1.0) + d * before.slow_to_p;
    v += d * before.slow_to_v;
    d *= before.slow_decay;
    b *= before.distortion_decay;
    const Step& step = step_[i];
    const double e = -p - b;
    innovations[written++] = e * step.inverse_deviation;
    p += step.gain[0] * e;
    v += step.gain[1] * e;
    d += step.gain[2] * e;
    b += step.gain[3] * e;
  }
  return written;
}

}  // namespace atmos
