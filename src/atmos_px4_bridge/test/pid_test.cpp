#include "atmos_px4_bridge/pid.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <string>

#include "atmos_model/strict_yaml.h"
#include "atmos_px4_bridge/flight_controller_config.h"

namespace atmos {
namespace {

constexpr double kStart = 1234.5, kPeriod = 0.1, kInertia = 0.297;
const char* const kFile = ATMOS_CONFIG_DIR "/flight_controller/atmos.yaml";

Vehicle vehicle() { return load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml"); }

// Yaw under the loop's torque within `limit`, plus a constant disturbance [N m].
struct Spin {
  Pid loop;
  double rate = 0.0, stamp = kStart;

  void period(double setpoint, double disturbance = 0.0, double limit = 1e9) {
    const double torque = loop.output(stamp, setpoint, rate);
    const double given = std::min(limit, std::max(-limit, torque));
    loop.achieved(given);
    rate += kPeriod / kInertia * (given + disturbance);
    stamp += kPeriod;
  }
};

TEST(Pid, EveryTermHasItsMeaning) {
  Pid loop({2.0, 10.0, 0.5, 0.25, 1.0});
  EXPECT_DOUBLE_EQ(loop.output(kStart, 0.3, 0.1), 2.0 * 0.2 + 0.25 * 0.3);
  loop.achieved(2.0 * 0.2 + 0.25 * 0.3);
  EXPECT_EQ(loop.integral(), 0.0);  // no time has passed
  EXPECT_NEAR(loop.output(kStart + kPeriod, 0.3, 0.14), 2.0 * 0.16 - 0.5 * 0.4 + 0.25 * 0.3, 1e-9);
  loop.achieved(2.0 * 0.16 - 0.5 * 0.4 + 0.25 * 0.3);
  const double fade = 1.0 - std::pow(0.16 / (400.0 * M_PI / 180.0), 2);
  EXPECT_NEAR(loop.integral(), 10.0 * 0.16 * kPeriod * fade, 1e-9);
}

TEST(Pid, ShippedGainsReachTheRateAgainstADisturbance) {
  Spin spin{Pid(load_flight_controller(kFile, vehicle()).rate)};
  for (int k = 0; k < 100; ++k) spin.period(0.4, 0.05, 0.5);
  EXPECT_NEAR(spin.rate, 0.4, 1e-3);
  EXPECT_NEAR(spin.loop.integral(), -0.05, 1e-3);
}

TEST(Pid, DoesNotWindUpWhileSaturated) {
  Spin spin{Pid({1.5, 1.0, 0.0, 0.0, 0.2})};
  for (int k = 0; k < 50; ++k)
    spin.period(0.0, 0.3, 0.1);  // a hand that turns it, stronger than the thrusters
  EXPECT_GT(spin.rate, 1.0);
  EXPECT_EQ(spin.loop.integral(), 0.0);
}

TEST(Pid, IntegralStaysWithinItsLimitAndFadesForLargeErrors) {
  Pid loop({0.01, 100.0, 0.0, 0.0, 0.2});
  for (int k = 0; k < 10; ++k) {
    const double torque = loop.output(kStart + kPeriod * k, 0.5, 0.0);
    loop.achieved(torque);
  }
  EXPECT_DOUBLE_EQ(loop.integral(), 0.2);
  Pid fast({0.01, 100.0, 0.0, 0.0, 0.2});
  for (int k = 0; k < 10; ++k) fast.achieved(fast.output(kStart + kPeriod * k, 7.0, 0.0));
  EXPECT_EQ(fast.integral(), 0.0);
}

TEST(Pid, ForgetsAfterAGapAndKeepsTheIntegralWithoutAMeasurement) {
  Pid loop({1.0, 1.0, 0.0, 0.0, 0.2});
  for (int k = 0; k < 5; ++k) loop.achieved(loop.output(kStart + kPeriod * k, 0.5, 0.0));
  const double held = loop.integral();
  EXPECT_GT(held, 0.1);
  EXPECT_EQ(loop.output(kStart + 0.5, 0.5, std::nullopt), held);
  loop.achieved(held);
  EXPECT_EQ(loop.integral(), held);
  EXPECT_EQ(loop.output(kStart + 5.0, 0.0, 0.0), 0.0);
}

TEST(FlightControllerFile, EveryBrokenRuleIsNamed) {
  const std::string path = ::testing::TempDir() + "flight_controller_under_test.yaml";
  std::ofstream(path) << "flight_controller: {rate: {p_n_m_s: 0, i_n_m: -1, d_n_m_s2: x, gain: 2}}";
  try {
    load_flight_controller(path, vehicle());
    ADD_FAILURE();
  } catch (const ConfigError& error) {
    for (const char* key :
         {"p_n_m_s", "i_n_m", "d_n_m_s2", "gain", "integral_limit_n_m", "feed_forward_n_m_s"})
      EXPECT_NE(std::string(error.what()).find(key), std::string::npos) << error.what();
  }
  std::remove(path.c_str());
}

TEST(FlightControllerFile, TakesAModelAndRefusesOneThatCannotBeFlown) {
  const std::string path = ::testing::TempDir() + "flight_controller_with_model.yaml";
  const auto load_with = [&path](const std::string& effects) {
    std::ofstream(::testing::TempDir() + "model_under_test.yaml") << "effects: [" << effects << "]";
    std::ofstream(path) << "flight_controller: {model: model_under_test.yaml, rate: {p_n_m_s: 1, i_n_m: 0, "
                           "d_n_m_s2: 0, feed_forward_n_m_s: 0, integral_limit_n_m: 0}}";
    return load_flight_controller(path, vehicle());
  };
  EXPECT_EQ(load_with("{kind: thruster_dead, parameters: {thruster: 3, since_s: 0}}").model.size(), 1U);
  std::string all;
  for (int i = 1; i <= 6; ++i)
    all += "{kind: thruster_dead, parameters: {thruster: " + std::to_string(i) + ", since_s: 0}},";
  EXPECT_THROW(load_with(all), ConfigError);
  EXPECT_THROW(load_with("{kind: gremlins}"), ConfigError);
}

}  // namespace
}  // namespace atmos
