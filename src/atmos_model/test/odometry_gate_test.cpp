#include "atmos_model/odometry_gate.h"

#include <gtest/gtest.h>

namespace atmos {
namespace {

constexpr double kStart = 1234.5;

TEST(OdometryGate, WaitsForTheStatusAndForTheOdometryItPromises) {
  OdometryGate gate;
  EXPECT_FALSE(gate.complete(kStart));
  gate.on_odometry(kStart);
  EXPECT_FALSE(gate.complete(kStart));
  gate.on_status(kStart, true);
  EXPECT_TRUE(gate.complete(kStart));
  EXPECT_FALSE(gate.complete(kStart + 0.1));
  gate.on_status(kStart + 0.1, true);
  EXPECT_FALSE(gate.complete(kStart + 0.1));
  gate.on_odometry(kStart + 0.1);
  EXPECT_TRUE(gate.complete(kStart + 0.1));
}

TEST(OdometryGate, ALostFrameStillWaitsForTheOdometryBeforeIt) {
  OdometryGate gate;
  gate.on_status(kStart, true);
  gate.on_status(kStart + 0.01, false);
  EXPECT_FALSE(gate.complete(kStart + 0.01));
  gate.on_odometry(kStart);
  EXPECT_TRUE(gate.complete(kStart + 0.01));
}

}  // namespace
}  // namespace atmos
