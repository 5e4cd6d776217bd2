#include "atmos_model/predictor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "nominal.h"

namespace atmos {
namespace {

constexpr double kAcceleration = 1.7 / 16.8;

PlantState start_of(const Plant& plant) { return {kStart, {}, plant.initial_hidden()}; }

TEST(Predictor, APulseTrainHasAClosedForm) {
  const Plant plant(nominal_vehicle(), {}, kStart);
  ValveSchedule valves(8);
  constexpr double kPeriod = 0.125;  // with these duties every edge is a double exactly, at 1.7e9 s too
  const std::vector<double> duties{47.0 / 128, 1.0, 7.0 / 128, 0.0, 106.0 / 128};
  double p = 0.0, v = 0.0, previous = kStart;
  for (std::size_t k = 0; k < duties.size(); ++k) {
    const double stamp = kStart + kPeriod * k;
    valves.add({stamp, kPeriod, {duties[k], 0, duties[k], 0, 0, 0, 0, 0}});
    const double close = stamp + duties[k] * kPeriod, end = kStart + kPeriod * (k + 1);
    p += v * (close - stamp) + kAcceleration * (close - stamp) * (close - stamp);
    v += 2 * kAcceleration * (close - stamp);
    p += v * (end - close);
    previous = end;
  }
  PlantState state = start_of(plant);
  advance(plant, valves, previous, state);
  EXPECT_EQ(state.time_s, previous);
  EXPECT_NEAR(state.body.p_WC.x(), p, 1e-9);
  EXPECT_NEAR(state.body.v_WC.x(), v, 1e-9);
  EXPECT_NEAR(state.body.p_WC.y(), 0.0, 1e-12);
  EXPECT_NEAR(state.body.yaw, 0.0, 1e-12);
  EXPECT_NEAR(state.hidden[0], 0.0035 * 2 * kPeriod * (288.0 / 128), 1e-12);
}

TEST(Predictor, ConstantTorqueHasAClosedForm) {
  const Plant plant(nominal_vehicle(), {}, kStart);
  ValveSchedule valves(8);
  valves.add({kStart, 4.0, {0, 1, 1, 0, 0, 0, 0, 0}});
  PlantState state = start_of(plant);
  advance(plant, valves, kStart + 2.0, state);
  const double alpha = 2 * 1.7 * 0.12 / 0.297;
  EXPECT_NEAR(state.body.yaw, 0.5 * alpha * 4.0, 1e-9);
  EXPECT_NEAR(state.body.yaw_rate, alpha * 2.0, 1e-9);
  EXPECT_NEAR(state.body.p_WC.norm(), 0.0, 1e-12);
}

// Turning while pushing has no closed form: compare with the midpoint rule at a tiny step, written from the
// equations.
TEST(Predictor, AgreesWithAnIndependentFineStepIntegrator) {
  const Plant plant(nominal_vehicle(), {SupplyCoupling{{}, 0.121}, FloorTilt{{}, 0.0005, -0.0003}}, kStart);
  ValveSchedule valves(8);
  std::mt19937 random(5);
  std::uniform_int_distribution<int> tenth(0, 10);
  std::vector<std::vector<double>> duties;
  for (int k = 0; k < 10; ++k) {
    duties.emplace_back();
    for (int i = 0; i < 8; ++i) duties.back().push_back(0.1 * tenth(random));
    valves.add({kStart + 0.125 * k, 0.125, duties.back()});
  }
  PlantState state = start_of(plant);
  advance(plant, valves, kStart + 1.25, state);

  const double dx[8] = {1, -1, 1, -1, 0, 0, 0, 0}, dy[8] = {0, 0, 0, 0, -1, 1, -1, 1};
  const double lever[8] = {-.12, .12, .12, -.12, -.12, .12, .12, -.12};
  double x = 0, y = 0, yaw = 0, vx = 0, vy = 0, w = 0;
  const double h = 0.0125 / 500;  // every edge is a multiple of 0.0125 s
  for (int step = 0; step < 50000; ++step) {
    double o[8], n = 0, fx = 0, fy = 0, torque = 0;
    for (int i = 0; i < 8; ++i) n += o[i] = (step % 5000) < 500 * std::lround(10 * duties[step / 5000][i]);
    for (int i = 0; i < 8; ++i) {
      const double f = 1.7 * o[i] * (1 - 0.121 * (n - o[i]));
      fx += f * dx[i];
      fy += f * dy[i];
      torque += f * lever[i];
    }
    const double middle = yaw + 0.5 * h * w + h * h / 8 * torque / 0.297;
    const double ax = (std::cos(middle) * fx - std::sin(middle) * fy) / 16.8 - 9.81 * 0.0005;
    const double ay = (std::sin(middle) * fx + std::cos(middle) * fy) / 16.8 + 9.81 * 0.0003;
    x += h * vx + 0.5 * h * h * ax;
    y += h * vy + 0.5 * h * h * ay;
    vx += h * ax;
    vy += h * ay;
    yaw += h * w + 0.5 * h * h * torque / 0.297;
    w += h * torque / 0.297;
  }
  // Edges near 1.7e9 s are off by up to 0.2 us, which moves the robot by some 1e-8 m within the second.
  EXPECT_NEAR(state.body.p_WC.x(), x, 1e-7);
  EXPECT_NEAR(state.body.p_WC.y(), y, 1e-7);
  EXPECT_NEAR(state.body.yaw, yaw, 1e-6);
  EXPECT_GT(std::abs(yaw), 0.01);
}

TEST(Predictor, IsOfOrderFour) {
  const Plant plant(nominal_vehicle(), {}, kStart);
  ValveSchedule valves(8);
  valves.add({kStart, 8.0, {1, 0, 0, 0, 0, 0, 0, 0}});
  const auto fly = [&](double step) {
    PlantState state = start_of(plant);
    advance(plant, valves, kStart + 4.0, state, step);
    return state.body.p_WC;
  };
  const Eigen::Vector2d fine = fly(1e-3);
  EXPECT_NEAR(std::log2((fly(0.2) - fine).norm() / (fly(0.1) - fine).norm()), 4.0, 0.3);
}

TEST(Predictor, StandsStillWhenTimeDoes) {
  const Plant plant(nominal_vehicle(), {}, kStart);
  PlantState state = start_of(plant);
  state.body.v_WC.x() = 1.0;
  advance(plant, ValveSchedule(8), kStart, state);
  advance(plant, ValveSchedule(8), kStart - 1.0, state);
  EXPECT_EQ(state.time_s, kStart);
  EXPECT_EQ(state.body.p_WC.x(), 0.0);
}

}  // namespace
}  // namespace atmos
