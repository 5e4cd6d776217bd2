#include "atmos_mocap_bridge/nis_monitor.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

namespace atmos {
namespace {

using Verdict = NisMonitor::Verdict;

// After `frames` frames whose scatter is `scale` times the configured one.
NisMonitor monitor_of(double scale, int frames, unsigned seed = 5) {
  NisMonitor monitor(6, 40.0);
  std::mt19937_64 random(seed);
  std::chi_squared_distribution<double> nis(6.0);
  for (int k = 0; k < frames; ++k) monitor.add(scale * scale * nis(random));
  return monitor;
}

TEST(NisMonitor, NeedsEnoughFrames) {
  EXPECT_EQ(monitor_of(1.0, 0).verdict(), Verdict::kTooFew);
  EXPECT_EQ(monitor_of(10.0, 99).verdict(), Verdict::kTooFew);
  EXPECT_EQ(monitor_of(10.0, 100).verdict(), Verdict::kUnderstated);
}

TEST(NisMonitor, AConsistentFilterIsNeverAccused) {
  for (unsigned seed = 0; seed < 200; ++seed)
    ASSERT_EQ(monitor_of(1.0, 1000, seed).verdict(), Verdict::kConsistent) << seed;
}

TEST(NisMonitor, FindsDeviationsWrongByTwo) {
  for (unsigned seed = 0; seed < 50; ++seed) {
    EXPECT_EQ(monitor_of(2.0, 1000, seed).verdict(), Verdict::kUnderstated);
    EXPECT_EQ(monitor_of(0.5, 1000, seed).verdict(), Verdict::kOverstated);
  }
}

TEST(NisMonitor, OneOutlierIsNoVerdict) {
  NisMonitor monitor = monitor_of(1.0, 1000);
  monitor.add(1e12);
  monitor.add(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(monitor.verdict(), Verdict::kConsistent);
  EXPECT_LT(monitor.ratio(), 2.0);
}

TEST(NisMonitor, ForgetsWhatWasLongAgo) {
  NisMonitor monitor = monitor_of(3.0, 1000);
  EXPECT_EQ(monitor.verdict(), Verdict::kUnderstated);
  for (int k = 0; k < 5 * NisMonitor::kWindow; ++k) monitor.add(6.0);
  EXPECT_EQ(monitor.verdict(), Verdict::kConsistent);
}

}  // namespace
}  // namespace atmos
