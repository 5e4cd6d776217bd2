// The map between two clocks against a simulated network.
#include "atmos_mocap_bridge/clock_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace atmos {
namespace {

constexpr double kStart = 1.7e9;  // ROS time of remote time 0, a date of our days

// A server's clock that runs `drift` fast, whose frames take kLeast_s and an exponential rest to arrive.
class Network {
 public:
  static constexpr double kLeast_s = 0.004;
  explicit Network(double drift, double jitter_s, unsigned seed = 3)
      : drift_(drift), jitter_(1.0 / jitter_s), random_(seed) {}

  double remote(double t) const { return t * (1.0 + drift_); }
  double arrival(double t) { return kStart + t + kLeast_s + jitter_(random_) + extra; }
  // Takes the frame exposed at `t` and returns the error of its stamp against the best there is.
  double error(ClockMap& map, double t) { return map.add(remote(t), arrival(t)) - (kStart + t + kLeast_s); }

  double extra = 0.0;

 private:
  double drift_;
  std::exponential_distribution<double> jitter_;
  std::mt19937_64 random_;
};

TEST(ClockMap, FollowsOffsetAndDriftThroughJitter) {
  for (const double drift : {-5e-5, 0.0, 5e-5}) {
    Network network(drift, 0.002);
    ClockMap map;
    double worst = 0.0, worst_late = 0.0;
    for (int k = 0; k < 60000; ++k) {
      const double error = std::abs(network.error(map, 0.01 * k));
      if (k > 200) worst = std::max(worst, error);
      if (k > 6000) worst_late = std::max(worst_late, error);
    }
    EXPECT_LT(worst, 1.2e-3) << drift;  // 20 s at 5e-5, before the drift can be told
    EXPECT_LT(worst_late, 2e-4) << drift;
    EXPECT_NEAR(map.drift(), -drift, 3e-6);
    EXPECT_EQ(map.restarts(), 1u);
    std::printf("drift %g: error %.3f ms, after a minute %.3f ms\n", drift, 1e3 * worst, 1e3 * worst_late);
  }
}

TEST(ClockMap, ACongestedNetworkDoesNotShiftTheStamps) {
  Network network(2e-5, 0.001);
  ClockMap map;
  for (int k = 0; k < 10000; ++k) network.error(map, 0.01 * k);
  network.extra = 0.15;
  double worst = 0.0;
  for (int k = 10000; k < 13000; ++k) worst = std::max(worst, std::abs(network.error(map, 0.01 * k)));
  EXPECT_LT(worst, 5e-4);
  EXPECT_EQ(map.restarts(), 1u);
}

TEST(ClockMap, StampsAscend) {
  Network network(-1e-4, 0.01);
  ClockMap map;
  double last = -1.0;
  for (int k = 0; k < 30000; ++k) {
    const double stamp = map.add(network.remote(k / 300.0), network.arrival(k / 300.0));
    ASSERT_GT(stamp, last) << k;
    last = stamp;
  }
}

TEST(ClockMap, ARestartedServerStartsAnew) {
  Network network(0.0, 0.001);
  ClockMap map;
  for (int k = 0; k < 3000; ++k) network.error(map, 0.01 * k);
  // The server's clock begins at 0 again, 40 s of ROS time after the start.
  const double stamp = map.add(0.0, kStart + 40.0 + 0.004);
  EXPECT_NEAR(stamp, kStart + 40.004, 1e-6);
  EXPECT_EQ(map.restarts(), 2u);
}

TEST(ClockMap, AClockThatIsSetIsFollowed) {
  for (const double step : {-10.0, 10.0}) {
    Network network(0.0, 0.001);
    ClockMap map;
    for (int k = 0; k < 3000; ++k) network.error(map, 0.01 * k);
    double stamp = 0.0, arrival = 0.0;
    for (int k = 3000; k < 3500; ++k) {
      arrival = network.arrival(0.01 * k) + step;
      stamp = map.add(0.01 * k, arrival);
    }
    EXPECT_NEAR(stamp, arrival, 0.02) << step;
    EXPECT_EQ(map.restarts(), 2u);
  }
}

}  // namespace
}  // namespace atmos
