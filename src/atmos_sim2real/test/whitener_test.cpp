#include "atmos_sim2real/whitener.h"

#include <gtest/gtest.h>

#include <random>

namespace atmos {
namespace {

struct Track {
  std::vector<double> times, scatter, zero;
  std::vector<Travel> travel;
  explicit Track(std::size_t n) : scatter(n, 1e-4), zero(n, 0.0), travel(n, {2e-3, 2e-3, 1.0}) {
    double t = 1234.5;
    for (std::size_t i = 0; i < n; ++i) {
      times.push_back(t);
      t += i % 17 == 5 ? 0.03 : 0.01;  // some frames are lost
      if (i % 500 == 250) travel[i].turn = i % 1000 == 250 ? -1.0 : 0.3;
    }
  }
};

NoiseModel noise() {
  NoiseModel model;
  model.mocap = {1e-4, 1e-4, 4e-4};
  model.slow = {4e-4, 4e-4, 4e-3};
  model.slow_time_s = 3.0;
  model.rough = {1e-4, 1e-4, 2e-4};
  model.distortion = {2e-4, 2e-4, 3e-4};
  return model;
}

// Draws a measured track out of the very model that the whitener is built for.
std::vector<double> draw(const Track& track, const NoiseModel& model, Axis axis, std::uint32_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  double p = 0.3, v = 0.02, d = model.slow[axis] * normal(random), r = model.rough[axis] * normal(random),
         b = model.distortion[axis] * normal(random), slope = model.distortion[axis] * normal(random);
  std::vector<double> measured;
  for (std::size_t i = 0; i < track.times.size(); ++i) {
    measured.push_back(p + r + b + model.mocap[axis] * normal(random));
    if (i + 1 == track.times.size()) break;
    const double dt = track.times[i + 1] - track.times[i];
    const double decay = std::exp(-dt / model.slow_time_s);
    const double to_v = model.slow_time_s * (1.0 - decay);
    const double kick = model.scatter * std::sqrt(track.scatter[i]);
    // White acceleration over the interval: velocity and position change by correlated normals.
    const double a = normal(random), c = normal(random);
    p += dt * v + model.slow_time_s * (dt - to_v) * d + kick * dt * (0.5 * a + c / std::sqrt(12.0));
    v += to_v * d + kick * a;
    d = decay * d + model.slow[axis] * std::sqrt(1.0 - decay * decay) * normal(random);
    const Transition to(model, dt, track.travel[i]);
    r = to.rough_decay * r +
        model.rough[axis] * std::sqrt(1.0 - to.rough_decay * to.rough_decay) * normal(random);
    to.distort(b, slope);
    const double new_b = normal(random), along = to.new_bc / std::sqrt(to.new_bb);
    b += model.distortion[axis] * std::sqrt(to.new_bb) * new_b;
    slope += model.distortion[axis] * (along * new_b + std::sqrt(to.new_cc - along * along) * normal(random));
  }
  return measured;
}

TEST(Whitener, MakesItsOwnModelWhite) {
  const Track track(12000);
  const NoiseModel model = noise();
  for (const Axis axis : {kX, kYaw}) {
    const Whitener whitener(track.times, track.scatter, track.travel, model, axis);
    const std::vector<double> measured = draw(track, model, axis, 7);
    std::vector<double> e(track.times.size());
    whitener.whiten(measured.data(), track.zero.data(), track.zero.data(), e.data());
    const double n = static_cast<double>(e.size() - Whitener::kBurnIn);
    double square = 0.0;
    for (const double value : e) square += value * value;
    // The sample variance of n unit normals deviates by sqrt(2 / n).
    EXPECT_NEAR(square / n, 1.0, 4.0 * std::sqrt(2.0 / n));
    for (const std::size_t lag : {1u, 2u, 10u, 100u}) {
      double product = 0.0;
      for (std::size_t i = lag; i < e.size(); ++i) product += e[i] * e[i - lag];
      EXPECT_LT(std::abs(product / n), 4.0 / std::sqrt(n)) << "lag " << lag;
    }
  }
}

// Along a straight way: covariance s^2 (1 + l d) exp(-l d) with l = sqrt(3) / length, and back again the
// same.
TEST(Whitener, DistortionIsAFunctionOfThePlace) {
  const NoiseModel model = noise();
  for (const double step : {1e-4, 3e-3, 0.2}) {
    double b = 1.0, slope = 0.0;
    Transition(model, 0.01, {step, step, 1.0}).distort(b, slope);
    const double x = std::sqrt(3.0) * step / model.distortion_length_m;
    EXPECT_NEAR(b, (1.0 + x) * std::exp(-x), 1e-12);
    // Stationary: what is kept and what is new make the variance that was.
    const Transition to(model, 0.01, {step, step, 0.4});
    EXPECT_NEAR(to.b_from_b * to.b_from_b + to.b_from_c * to.b_from_c + to.new_bb, 1.0, 1e-9);
    EXPECT_NEAR(to.c_from_b * to.c_from_b + to.c_from_c * to.c_from_c + to.new_cc, 1.0, 1e-9);
    EXPECT_NEAR(to.b_from_b * to.c_from_b + to.b_from_c * to.c_from_c + to.new_bc, 0.0, 1e-9);
  }
  double b = 0.2, slope = 0.8;
  for (const double turn : {-1.0, 1.0}) Transition(model, 0.01, {1e-3, 1e-3, turn}).distort(b, slope);
  EXPECT_NEAR(b, 0.2, 1e-4);
}

TEST(Whitener, IsNotWhiteUnderAnotherModel) {
  const Track track(12000);
  NoiseModel wrong = noise();
  wrong.mocap = {2e-4, 2e-4, 8e-4};
  const std::vector<double> measured = draw(track, noise(), kX, 7);
  std::vector<double> e(track.times.size());
  Whitener(track.times, track.scatter, track.travel, wrong, kX)
      .whiten(measured.data(), track.zero.data(), track.zero.data(), e.data());
  double square = 0.0;
  for (const double value : e) square += value * value;
  EXPECT_LT(square / static_cast<double>(e.size()), 0.7);
}

TEST(Whitener, StepResponseIsWhitenOfAStep) {
  const Track track(600);
  const Whitener whitener(track.times, track.scatter, track.travel, noise(), kX);
  const std::size_t at = 300, count = 120;
  std::vector<double> dv(600, 0.0), dp(600, 0.0), e(600), response(count);
  dv[at] = 1.0;
  dp[at] = 0.5 * (track.times[at + 1] - track.times[at]);
  whitener.whiten(track.zero.data(), dv.data(), dp.data(), e.data());
  ASSERT_EQ(whitener.step_response(at, count, response.data()), count);
  for (std::size_t i = 0; i < count; ++i)
    EXPECT_NEAR(response[i], e[at + 1 + i], 1e-9 * (1.0 + std::abs(e[at + 1 + i])));
}

TEST(Whitener, IsLinear) {
  const Track track(400);
  const Whitener whitener(track.times, track.scatter, track.travel, noise(), kYaw);
  const std::vector<double> a = draw(track, noise(), kYaw, 1), b = draw(track, noise(), kYaw, 2);
  std::vector<double> sum(400), ea(400), eb(400), es(400);
  for (std::size_t i = 0; i < 400; ++i) sum[i] = a[i] + 2.0 * b[i];
  whitener.whiten(a.data(), track.zero.data(), track.zero.data(), ea.data());
  whitener.whiten(b.data(), track.zero.data(), track.zero.data(), eb.data());
  whitener.whiten(sum.data(), track.zero.data(), track.zero.data(), es.data());
  for (std::size_t i = 0; i < 400; ++i) EXPECT_NEAR(es[i], ea[i] + 2.0 * eb[i], 1e-6);
}

}  // namespace
}  // namespace atmos
