#include "atmos_operator/setpoint_queue.h"

#include <gtest/gtest.h>

namespace atmos {
namespace {

TEST(SetpointQueue, HoldsFromItsStamp) {
  SetpointQueue queue;
  EXPECT_FALSE(queue.at(1e9));
  queue.add({1020.0, 1.0, 0.0, 0.0});
  queue.add({1000.0, 0.0, 0.0, 0.0});
  EXPECT_FALSE(queue.at(999.0));
  EXPECT_EQ(queue.at(1000.0)->stamp, 1000.0);
  EXPECT_EQ(queue.at(1019.9)->stamp, 1000.0);
  EXPECT_EQ(queue.at(1020.0)->x_m, 1.0);
}

TEST(SetpointQueue, SameStampReplaces) {
  SetpointQueue queue;
  queue.add({1000.0, 1.0, 0.0, 0.0});
  queue.add({1000.0, 2.0, 0.0, 0.0});
  EXPECT_EQ(queue.at(1001.0)->x_m, 2.0);
}

}  // namespace
}  // namespace atmos
