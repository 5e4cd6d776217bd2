// The simulator against physics that can be said in one line.
#include <gtest/gtest.h>

#include <cmath>

#include "test_scenario.h"

namespace atmos {
namespace {

constexpr double kMass = 16.8;

// Force of one thruster with 0 to 3 others open, at 10 Hz between 0 and 100 % duty, as the paper measured it.
TEST(Physics, LoadCellShowsThePapersCoupling) {
  Scenario scenario = load_scenario(ATMOS_CONFIG_DIR "/scenario/load_cell.yaml");
  Simulation simulation(scenario, kTestStart);
  const std::vector<std::vector<int>> open = {{1}, {1, 4}, {1, 4, 6}, {1, 4, 6, 7}};
  const double published[] = {1.70, 1.49, 1.28, 1.06};
  double t = kTestStart;
  for (std::size_t others = 0; others < open.size(); ++others) {
    double sum = 0.0, count = 0.0;
    for (int period = 0; period < 20; ++period) {
      simulation.robot().command(open_thrusters(t, period % 2 == 0 ? 1.0 : 0.0, open[others]));
      for (int sample = 0; sample < 32; ++sample) {  // 320 samples/s
        simulation.advance_to(t + (sample + 0.5) / 320.0);
        const double force = simulation.robot().thrust()[0];
        if (period % 2 == 0) {
          sum += force;
          count += 1.0;
        } else {
          EXPECT_EQ(force, 0.0);
        }
      }
      t += 0.1;
    }
    EXPECT_NEAR(sum / count, published[others], 0.0051) << others << " others";
  }
  EXPECT_LT(simulation.robot().truth().v_WC.norm(), 0.02);  // held
}

// Height of the interpolating bicubic (Catmull-Rom) surface, written by itself.
double height(const FloorUnevenness& floor, double x, double y) {
  const auto cubic = [](const double(&h)[4], double t) {
    return h[1] + 0.5 * t *
                      (h[2] - h[0] +
                       t * (2 * h[0] - 5 * h[1] + 4 * h[2] - h[3] + t * (3 * (h[1] - h[2]) + h[3] - h[0])));
  };
  const double u = (x - floor.grid.origin_m[0]) / floor.grid.spacing_m;
  const double v = (y - floor.grid.origin_m[1]) / floor.grid.spacing_m;
  const int i = static_cast<int>(u), j = static_cast<int>(v);
  double column[4];
  for (int b = 0; b < 4; ++b) {
    double row[4];
    for (int a = 0; a < 4; ++a)
      row[a] = floor.height_m.at(static_cast<std::size_t>(j + b - 1)).at(static_cast<std::size_t>(i + a - 1));
    column[b] = cubic(row, u - i);
  }
  return cubic(column, v - j);
}

// A coasting robot trades kinetic energy, spin included, for the mean height of its bearings.
TEST(Physics, EnergyOnAHeightMap) {
  for (const std::string map : {"typical_lab_day", "harsh"}) {
    Scenario scenario = test_scenario();
    for (const Effect& effect : load_scenario(ATMOS_CONFIG_DIR "/scenario/" + map + ".yaml").effects) {
      if (std::holds_alternative<FloorUnevenness>(effect)) scenario.effects = {effect};
    }
    ASSERT_EQ(scenario.effects.size(), 1u);
    const auto& floor = std::get<FloorUnevenness>(scenario.effects[0]);
    scenario.start.x_m = -0.8;
    Simulation simulation(scenario, kTestStart);
    // A push, then 12 s of coasting over a metre or more, slowly spinning.
    for (const ThrusterCommand& command : repeated(open_thrusters(kTestStart, 1.0, {1, 3}), 6))
      simulation.robot().command(command);
    simulation.robot().command(open_thrusters(kTestStart + 0.6, 0.9, {2, 3}));
    simulation.advance_to(kTestStart + 0.7);
    const auto kinetic = [&] {
      const PlanarState<double>& s = simulation.robot().center_of_mass();
      return 0.5 * kMass * s.v_WC.squaredNorm() + 0.5 * 0.297 * s.yaw_rate * s.yaw_rate;
    };
    const auto mean_height = [&] {
      const PlanarState<double>& s = simulation.robot().center_of_mass();
      double sum = 0.0;
      for (const Eigen::Vector2d& bearing : scenario.vehicle.bearings_m) {
        const Vec2<double> p = s.p_WC + rotation_WB(s.yaw) * bearing;
        sum += height(floor, p.x(), p.y());
      }
      return sum / 3.0;
    };
    const double kinetic_0 = kinetic(), height_0 = mean_height();
    double largest = 0.0, worst = 0.0;
    for (int k = 1; k <= 120; ++k) {
      simulation.advance_to(kTestStart + 0.7 + 0.1 * k);
      const double work = -kMass * 9.81 * (mean_height() - height_0);
      largest = std::max(largest, std::abs(work));
      worst = std::max(worst, std::abs(kinetic() - kinetic_0 - work));
    }
    std::printf("%s: energy traded up to %.4f J, off by at most %.1e J\n", map.c_str(), largest, worst);
    EXPECT_GT(largest, 0.01);
    EXPECT_LE(worst, 0.01 * largest);
  }
}

TEST(Physics, TerminalSpeedUnderDrag) {
  Scenario scenario = test_scenario();
  scenario.duration_s = 200.0;
  const auto speed_after_push = [&](const Effect& drag) {
    scenario.effects = {drag};
    Simulation simulation(scenario, kTestStart);
    for (const ThrusterCommand& command : repeated(open_thrusters(kTestStart, 1.0, {1, 3}), 2000))
      simulation.robot().command(command);
    simulation.advance_to(kTestStart + 200.0);
    return simulation.robot().truth().v_WC.x();
  };
  EXPECT_NEAR(speed_after_push(ViscousDrag{{}, 4.0, 0.0}), 3.4 / 4.0, 1e-6);
  EXPECT_NEAR(speed_after_push(QuadraticDrag{{}, 4.0}), std::sqrt(3.4 / 4.0), 1e-6);
}

// Free decay after a push. A free body takes part: both frequency and damping rise by sqrt(M / (M - m)).
TEST(Physics, SloshFrequencyAndDampingFromFreeDecay) {
  for (const double moving : {0.01, 2.0}) {
    constexpr double kFrequency = 0.8, kDamping = 0.05;
    Scenario scenario = test_scenario();
    scenario.effects = {Slosh{{}, moving, kFrequency, kDamping, 0.0, 0.0},
                        ExternalImpulse{{}, {{kTestStart + 0.1, {2.0, 0.0}, 0.0}}}};
    Simulation simulation(scenario, kTestStart);
    simulation.advance_to(kTestStart + 0.2);
    std::vector<double> crossings, peaks;
    double before = simulation.robot().hidden()[1], rate_before = simulation.robot().hidden()[3];
    for (int k = 1; k <= 8000; ++k) {
      simulation.advance_to(kTestStart + 0.2 + 0.001 * k);
      const double now = simulation.robot().hidden()[1], rate = simulation.robot().hidden()[3];
      if (before < 0.0 && now >= 0.0) crossings.push_back(0.001 * (k - now / (now - before)));
      if (rate_before > 0.0 && rate <= 0.0) peaks.push_back(now);
      before = now;
      rate_before = rate;
    }
    ASSERT_GE(crossings.size(), 6u);
    ASSERT_GE(peaks.size(), 6u);
    const double decrement = std::log(peaks[0] / peaks[4]) / 4.0;
    const double damping = decrement / std::hypot(2 * M_PI, decrement);
    const double period = (crossings[4] - crossings[0]) / 4.0;
    const double frequency = 1.0 / (period * std::sqrt(1 - damping * damping));
    const double factor = std::sqrt(kMass / (kMass - moving));
    EXPECT_NEAR(frequency, kFrequency * factor, 1e-3 * kFrequency);
    EXPECT_NEAR(damping, kDamping * factor, 2e-2 * kDamping);
    // Body and moving mass keep the momentum of the push.
    const double v = simulation.robot().center_of_mass().v_WC.x();
    EXPECT_NEAR((kMass - moving) * v + moving * (v + simulation.robot().hidden()[3]), 2.0, 1e-5);
  }
}

}  // namespace
}  // namespace atmos
