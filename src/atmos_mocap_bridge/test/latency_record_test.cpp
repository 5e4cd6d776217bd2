#include "atmos_mocap_bridge/latency_record.h"

#include <gtest/gtest.h>

namespace atmos {
namespace {

TEST(LatencyRecord, NothingYet) { EXPECT_EQ(LatencyRecord().summary().count, 0u); }

TEST(LatencyRecord, KnownAnswers) {
  LatencyRecord record;
  for (int k = 1000; k > 0; --k) record.add(1e-3 * k);
  const auto summary = record.summary();
  EXPECT_EQ(summary.count, 1000u);
  EXPECT_DOUBLE_EQ(summary.median_s, 0.501);
  EXPECT_DOUBLE_EQ(summary.p99_s, 0.991);
  EXPECT_DOUBLE_EQ(summary.max_s, 1.0);
}

TEST(LatencyRecord, TheOldestValuesGo) {
  LatencyRecord record;
  record.add(1.0);
  for (std::size_t k = 0; k < LatencyRecord::kSize; ++k) record.add(0.1);
  EXPECT_EQ(record.summary().count, LatencyRecord::kSize);
  EXPECT_EQ(record.summary().max_s, 0.1);
}

}  // namespace
}  // namespace atmos
