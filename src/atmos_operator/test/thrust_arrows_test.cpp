#include "atmos_operator/thrust_arrows.h"

#include <gtest/gtest.h>

#include <limits>

namespace atmos {
namespace {

const Vehicle& vehicle() {
  static const Vehicle loaded = load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml");
  return loaded;
}

std::vector<double> only(std::size_t thruster, double duty) {
  std::vector<double> result(8, 0.0);
  result[thruster - 1] = duty;
  return result;
}

TEST(ThrustArrows, PointAlongTheForceWithTheHeadAtTheNozzle) {
  const auto arrows =
      thrust_arrows(vehicle(), only(1, 0.5), 0.2);  // thruster 1 pushes along +x at (-0.12, 0.12)
  ASSERT_EQ(arrows.size(), 1u);
  EXPECT_EQ(arrows[0].thruster, 1);
  EXPECT_TRUE(arrows[0].head_B.isApprox(Eigen::Vector3d(-0.12, 0.12, 0.0)));
  EXPECT_NEAR((arrows[0].head_B - arrows[0].tail_B - Eigen::Vector3d(0.5 * 1.7 * 0.2, 0, 0)).norm(), 0.0,
              1e-12);
}

TEST(ThrustArrows, NegativeDutyTurnsTheArrowRound) {
  const auto arrows = thrust_arrows(vehicle(), only(5, -1.0), 0.1);
  ASSERT_EQ(arrows.size(), 1u);
  EXPECT_GT((arrows[0].head_B - arrows[0].tail_B).y(), 0.0);  // thruster 5 pushes along -y
}

TEST(ThrustArrows, ClosedValvesHaveNone) { EXPECT_TRUE(thrust_arrows(vehicle(), only(1, 0.0), 0.2).empty()); }

TEST(ThrustArrows, NothingForABadCommand) {
  EXPECT_TRUE(thrust_arrows(vehicle(), {1.0, 1.0}, 0.2).empty());
  EXPECT_TRUE(thrust_arrows(vehicle(), only(2, std::numeric_limits<double>::quiet_NaN()), 0.2).empty());
}

}  // namespace
}  // namespace atmos
