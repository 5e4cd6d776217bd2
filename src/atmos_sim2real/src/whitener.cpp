#include "atmos_sim2real/whitener.h"

#include <algorithm>
#include <cmath>

namespace atmos {

Whitener::Whitener(const std::vector<double>& times, const std::vector<double>& scatter_variance,
                   const std::vector<double>& travel, const NoiseModel& noise, Axis axis) {
  const std::size_t n = times.size();
  step_.resize(n);
  const double r = noise.mocap[axis] * noise.mocap[axis];
  const double slow = noise.slow[axis] * noise.slow[axis];
  const double distortion = noise.distortion[axis] * noise.distortion[axis];

  // Diffuse start: far wider than anything a recording can show.
  Eigen::Matrix4d P = Eigen::Matrix4d::Zero();
  P.diagonal() << 1e2, 1e1, slow, distortion;
  Eigen::Matrix4d F = Eigen::Matrix4d::Identity();
  for (std::size_t i = 0; i < n; ++i) {
    Step& step = step_[i];
    const Eigen::Vector4d PH = P.col(0) + P.col(3);
    const double S = PH[0] + PH[3] + r;
    const Eigen::Vector4d K = PH / S;
    for (int k = 0; k < 4; ++k) step.gain[k] = K[k];
    step.inverse_deviation = i < static_cast<std::size_t>(kBurnIn) ? 0.0 : 1.0 / std::sqrt(S);
    if (i >= static_cast<std::size_t>(kBurnIn)) log_determinant_ += std::log(S);
    if (i + 1 == n) {
      step.dt = 0.0;
      break;
    }
    P.noalias() -= K * PH.transpose();

    const double dt = times[i + 1] - times[i];
    const double decay = std::exp(-dt / noise.slow_time_s);
    step.dt = dt;
    step.slow_decay = decay;
    step.slow_to_v = noise.slow_time_s * (1.0 - decay);
    step.slow_to_p = noise.slow_time_s * (dt - step.slow_to_v);
    step.distortion_decay = std::exp(-travel[i] / noise.distortion_length_m);
    F(0, 1) = dt;
    F(0, 2) = step.slow_to_p;
    F(1, 2) = step.slow_to_v;
    F(2, 2) = decay;
    F(3, 3) = step.distortion_decay;
    P = F * P * F.transpose();
    // Scatter enters as white acceleration; the floor under it keeps the filter from believing itself without
    // limit.
    const double q = noise.scatter * noise.scatter * scatter_variance[i] + 1e-12 * dt;
    P(0, 0) += q * dt * dt / 3.0;
    P(0, 1) += q * dt / 2.0;
    P(1, 0) += q * dt / 2.0;
    P(1, 1) += q;
    const double q_slow = slow * (1.0 - decay * decay);
    P(2, 2) += q_slow;
    P(3, 3) += distortion * (1.0 - step.distortion_decay * step.distortion_decay);
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
    p += v * step.dt + d * step.slow_to_p + dp[i];
    v += d * step.slow_to_v + dv[i];
    d *= step.slow_decay;
    b *= step.distortion_decay;
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
    const Step& before = step_[i - 1];
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
