#include "atmos_operator/setpoint_player.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>

namespace atmos {
namespace {

constexpr double kStart = 1234.5;

std::vector<double> stamps(const std::vector<StampedSetPoint>& points) {
  std::vector<double> result;
  for (const auto& point : points) result.push_back(point.stamp - kStart);
  return result;
}

SetpointPlayer player() {
  return SetpointPlayer({{0.0, 0.0, 0.0, 0.0}, {20.0, 1.0, 0.0, 0.5}, {40.0, 1.0, 1.0, 1.5}}, kStart);
}

using Stamps = std::vector<double>;

TEST(SetpointPlayer, AnnouncesOneAhead) {
  SetpointPlayer p = player();
  EXPECT_EQ(stamps(p.due(kStart)), (Stamps{0.0, 20.0}));
  EXPECT_TRUE(p.due(kStart + 19.999).empty());
  EXPECT_FALSE(p.finished());
  EXPECT_EQ(stamps(p.due(kStart + 20.0)), (Stamps{40.0}));
  EXPECT_TRUE(p.finished());
  EXPECT_TRUE(p.due(kStart + 100.0).empty());
}

TEST(SetpointPlayer, CatchesUpAfterAClockJump) {
  SetpointPlayer p = player();
  EXPECT_EQ(stamps(p.due(kStart + 55.0)), (Stamps{0.0, 20.0, 40.0}));
}

TEST(SetpointPlayer, TellsANewcomerWhatHoldsAndWhatIsNext) {
  SetpointPlayer p = player();
  EXPECT_TRUE(p.announced(kStart).empty());
  p.due(kStart);
  EXPECT_EQ(stamps(p.announced(kStart + 1.0)), (Stamps{0.0, 20.0}));
  p.due(kStart + 21.0);
  EXPECT_EQ(stamps(p.announced(kStart + 21.0)), (Stamps{20.0, 40.0}));
  EXPECT_EQ(stamps(p.announced(kStart + 80.0)), (Stamps{40.0}));
}

TEST(SetpointPlayer, KeepsThePose) {
  SetpointPlayer p = player();
  const auto points = p.due(kStart + 20.0);
  EXPECT_EQ(points[2].x_m, 1.0);
  EXPECT_EQ(points[2].y_m, 1.0);
  EXPECT_EQ(points[2].yaw_rad, 1.5);
}

std::string written(const std::string& text) {
  const std::string path = testing::TempDir() + "operator_sequence.yaml";
  std::ofstream(path) << text;
  return path;
}

TEST(LoadSequence, ReadsAFileOfSetPointsAlone) {
  const auto sequence =
      load_sequence(written("setpoints:\n"
                            "  - {time_s: 0, x_m: 0, y_m: 0, yaw_deg: 0}\n"
                            "  - {time_s: 500, x_m: 1, y_m: -1, yaw_deg: 180}\n"));
  ASSERT_EQ(sequence.size(), 2u);
  EXPECT_EQ(sequence[1].time_s, 500.0);
  EXPECT_DOUBLE_EQ(sequence[1].yaw_rad, M_PI);
}

TEST(LoadSequence, NamesEveryFault) {
  try {
    load_sequence(
        written("setpoints:\n"
                "  - {time_s: 1, x_m: 0, y_m: 0, yaw_deg: 0}\n"
                "  - {time_s: 5, x_m: oops, y_m: -1, yaw_deg: 180}\n"
                "  - {time_s: 4, x_m: 0, y_m: 0, yaw_deg: 0}\n"
                "speed: 3\n"));
    FAIL() << "no fault reported";
  } catch (const ConfigError& error) {
    EXPECT_EQ(error.faults().size(), 4u) << error.what();
  }
}

TEST(LoadSequence, RefusesAnEmptyOne) {
  EXPECT_THROW(load_sequence(written("setpoints: []\n")), ConfigError);
}

}  // namespace
}  // namespace atmos
