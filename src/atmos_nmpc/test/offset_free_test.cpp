// Offset-free against nominal control on a tilted floor with supply coupling, with pulses as the plant fires
// them.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "atmos_nmpc/config.h"
#include "closed_loop.h"

namespace atmos {
namespace {

using testing::kDegree;
using testing::kLabNoise;
using testing::kStart;

struct Steady {
  Eigen::Vector2d position;  // mean error over the last 5 s, m
  double yaw;                // rad
  testing::FlightRow last;
};

class OffsetFree : public ::testing::Test {
 protected:
  Steady hold(const std::string& file, const std::vector<Effect>& effects, double yaw,
              testing::Noise noise = kLabNoise, double seconds = 20.0) const {
    const ControllerConfig config =
        load_controller(ATMOS_CONFIG_DIR "/controller/" + file + ".yaml", vehicle_);
    Controller controller(vehicle_, config, true, [] { return 0.0; });
    controller.add_goal(testing::planar_goal(kStart, 0.5, 0.0, yaw));
    testing::Flight flight(vehicle_, controller, kStart, {}, noise, 5, effects);
    Steady steady{{0.0, 0.0}, 0.0, {}};
    const int periods = static_cast<int>(10.0 * seconds);
    for (int k = 0; k < periods; ++k) {
      steady.last = flight.period();
      EXPECT_TRUE(is_success(steady.last.decision.solve.status)) << k;
      if (k < periods - 50) continue;
      steady.position += (steady.last.truth.p_WC - Eigen::Vector2d(0.5, 0.0)) / 50.0;
      steady.yaw += (steady.last.truth.yaw - yaw) / 50.0;
    }
    return steady;
  }
  static std::vector<Effect> tilted() {
    FloorTilt tilt;
    tilt.slope_x = 0.002;
    SupplyCoupling coupling;
    coupling.fraction_per_open_thruster = 0.125;
    return {coupling, tilt};
  }

  const Vehicle vehicle_ = load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml");
};

TEST_F(OffsetFree, NominalKeepsCentimetresOnATiltedFloor) {
  for (const char* file : {"wrench", "direct_allocation"})
    EXPECT_GT(hold(file, tilted(), 0.0).position.norm(), 0.01) << file;
}

TEST_F(OffsetFree, NoOffsetWithTheObserver) {
  for (const char* file : {"offset_free_wrench", "offset_free_direct_allocation"}) {
    for (const double yaw : {0.0, 45.0 * kDegree, 120.0 * kDegree}) {
      SCOPED_TRACE(std::string(file) + " at " + std::to_string(yaw));
      const Steady steady = hold(file, tilted(), yaw);
      EXPECT_LT(steady.position.norm(), 0.001);
      EXPECT_LT(std::abs(steady.yaw), 0.1 * kDegree);
      ASSERT_TRUE(steady.last.decision.disturbance);
      // The floor's push and what coupling takes from the thrust against it: up to three eighths.
      const double found = -steady.last.decision.disturbance->mean.acceleration_W.x();
      EXPECT_GT(found, 0.9 * 0.002 * kGravity);
      EXPECT_LT(found, 1.1 * 0.002 * kGravity / (1.0 - 3.0 * 0.125));
    }
  }
}

TEST_F(OffsetFree, WithoutNoiseTheOffsetVanishes) {
  for (const char* file : {"offset_free_wrench", "offset_free_direct_allocation"}) {
    const Steady steady = hold(file, tilted(), 0.0, {}, 40.0);
    EXPECT_LT(steady.position.norm(), 1e-4) << file;
    EXPECT_LT(std::abs(steady.yaw), 1e-3) << file;
  }
}

TEST_F(OffsetFree, DisturbanceBeyondTheThrustersDoesNotWindUp) {
  // A slope that pushes with more than 1.5 N for 10 s, then a level floor.
  const ControllerConfig config =
      load_controller(ATMOS_CONFIG_DIR "/controller/offset_free_wrench.yaml", vehicle_);
  Controller controller(vehicle_, config, true, [] { return 0.0; });
  controller.add_goal(testing::planar_goal(kStart, 0.0, 0.0, 0.0));
  FloorTilt steep;
  steep.slope_x = 0.012;  // 2 N
  testing::Flight pushed(vehicle_, controller, kStart, {}, kLabNoise, 5, {steep});
  for (int k = 0; k < 50; ++k) pushed.period();
  EXPECT_LT(pushed.truth().p_WC.x(), -0.2);
  testing::Flight level(vehicle_, controller, pushed.now(), pushed.truth(), kLabNoise, 6);
  double overshoot = 0.0;
  for (int k = 0; k < 250; ++k) overshoot = std::max(overshoot, level.period().truth.p_WC.x());
  EXPECT_LT(overshoot, 0.05);
  EXPECT_LT(level.truth().p_WC.norm(), 0.005);
}

}  // namespace
}  // namespace atmos
