// A server that restarts every hour, through session, clock map and filter in simulated time: an hour and a
// half; ATMOS_LONG_TESTS=1: 24 hours. No leak, no stale output, every restart survived.
#include <gtest/gtest.h>
#include <malloc.h>

#include <cstdlib>
#include <random>

#include "atmos_mocap_bridge/clock_map.h"
#include "qtm_link.h"
#include "sensor_simulator.h"

namespace atmos::qtm::test {
namespace {

constexpr double kFrame_s = 0.01, kHour_s = 3600.0, kRestart_s = 20.0;
constexpr double kDrift = 3e-5, kLeastDelay_s = 0.004, kNoise_m = 0.0003, kNoise_rad = 0.0009;

TEST(QtmSoak, AServerThatRestartsEveryHour) {
  const double hours = std::getenv("ATMOS_LONG_TESTS") != nullptr ? 24.0 : 1.5;
  std::mt19937_64 random(11);
  std::exponential_distribution<double> jitter(1.0 / 0.001);
  std::normal_distribution<double> normal;
  Link link(two_bodies());
  ClockMap clock;
  PoseFilter filter(atmos::test::nominal_config(), atmos::test::nominal_vehicle());
  std::uint64_t published = 0, expected = 0;
  double worst_stamp = 0.0, worst_position = 0.0, server_start = 0.0;
  std::size_t heap_after_first_hour = 0;
  const auto frames = static_cast<std::int64_t>(hours * kHour_s / kFrame_s);
  for (std::int64_t k = 0; k < frames; ++k) {
    const double t = kFrame_s * static_cast<double>(k);
    link.now = kStart + t;
    const double in_hour = std::fmod(t, kHour_s);
    const bool server_runs = t < kHour_s - kRestart_s || in_hour >= kRestart_s;
    if (!server_runs && link.server) link.disconnect();
    const std::uint64_t connections = link.session.counters().connections;
    link.step(server_runs);
    if (link.session.counters().connections != connections) server_start = t;
    if (!link.server) continue;

    // The robot circles; the server's clock started with it and drifts.
    const double angle = 0.1 * t;
    PoseFrame truth{0.0,
                    {std::cos(angle), std::sin(angle), 0.0},
                    Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()))};
    PoseFrame shown = truth;
    shown.p_WB += kNoise_m * Eigen::Vector3d(normal(random), normal(random), normal(random));
    const Eigen::Vector3d turn = kNoise_rad * Eigen::Vector3d(normal(random), normal(random), normal(random));
    shown.q_WB = shown.q_WB * Eigen::AngleAxisd(turn.norm(), turn.normalized());
    Frame frame;
    frame.timestamp_us = static_cast<std::uint64_t>(1e6 * (t - server_start) * (1.0 + kDrift));
    frame.number = static_cast<std::uint32_t>(k);
    frame.bodies = {to_body(truth), to_body(shown)};
    link.server->add(frame);
    link.now += kLeastDelay_s + jitter(random);
    link.talk();
    ++expected;
    for (const Link::Received& received : link.received) {
      PoseFrame pose = received.pose;
      pose.stamp_s = clock.add(pose.stamp_s, link.now);
      const FrameResult result = filter.take_frame(pose);
      ASSERT_EQ(filter.estimate().stamp_s, pose.stamp_s) << "stale";
      published += result.published ? 1 : 0;
      if (t - server_start < 60.0) continue;
      worst_stamp = std::max(worst_stamp, std::abs(pose.stamp_s - (kStart + t + kLeastDelay_s)));
      worst_position = std::max(worst_position, (filter.estimate().p_WB - truth.p_WB).norm());
    }
    link.received.clear();
    if (k == static_cast<std::int64_t>(1.2 * kHour_s / kFrame_s))
      heap_after_first_hour = mallinfo2().uordblks;
  }
  const std::size_t heap = mallinfo2().uordblks;
  const auto& counters = link.session.counters();
  std::printf(
      "%.1f h: %lu connections, %lu of %lu frames published, heap %+ld bytes since the second hour, worst "
      "stamp "
      "%.3f ms, worst position %.2f mm\n",
      hours, counters.connections, published, expected,
      static_cast<long>(heap) - static_cast<long>(heap_after_first_hour), 1e3 * worst_stamp,
      1e3 * worst_position);
  EXPECT_EQ(counters.connections, static_cast<std::uint64_t>(hours) + (hours == 24.0 ? 0u : 1u));
  EXPECT_GT(published, expected * 999 / 1000);
  EXPECT_LT(worst_stamp, 5e-4);
  EXPECT_LT(worst_position, 5e-3);
  EXPECT_LT(heap, heap_after_first_hour + 65536);
}

}  // namespace
}  // namespace atmos::qtm::test
