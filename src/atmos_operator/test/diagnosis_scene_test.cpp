#include "atmos_operator/diagnosis_scene.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <stdexcept>

namespace atmos {
namespace {

class DiagnosisSceneTest : public ::testing::Test {
 protected:
  std::string write(const std::string& name, const std::string& text) {
    const std::string folder = ::testing::TempDir() + "operator_scene/";
    std::filesystem::create_directories(folder);
    std::ofstream(folder + name) << text;
    return folder + name;
  }
  std::string report() {
    write("plots.json", R"({"flights": [{"name": "a", "x_m": [0, 0.1, 0.5, 1.0], "y_m": [0, 0, 0, 0.5],
      "nominal": {"bin_s": 2, "axes": {"x": [1, 4], "y": [1, 4], "yaw": [1, null]}},
      "fitted": {"bin_s": 2, "axes": {"x": [1, 1], "y": [1, 1], "yaw": [1, 1]}}}]})");
    return write("report.json",
                 R"({"verdict": "explained", "effects": [{"statement": "the floor is tilted"}]})");
  }

  Vehicle vehicle_ = load_vehicle(std::string(ATMOS_CONFIG_DIR) + "/vehicle/atmos.yaml");
};

TEST_F(DiagnosisSceneTest, ATiltIsAPlaneUnderThePathsAndPushesDownhill) {
  const auto model =
      write("tilt.yaml", "effects: [{kind: floor_tilt, parameters: {slope_x: 0.001, slope_y: 0.0}}]");
  const DiagnosisScene scene = load_diagnosis_scene(vehicle_, model, report());
  EXPECT_EQ(scene.verdict, "explained");
  EXPECT_EQ(scene.statements, std::vector<std::string>{"the floor is tilted"});
  ASSERT_TRUE(scene.floor);
  const auto& row = scene.floor->height_m.front();
  EXPECT_NEAR(
      (row.back() - row.front()) / (scene.floor->grid.spacing_m * static_cast<double>(row.size() - 1)), 0.001,
      1e-9);
  EXPECT_NEAR(row.front() + row.back(), 0.0, 1e-12) << "mean 0";
  EXPECT_LE(scene.floor->grid.origin_m[0], -0.2);
  ASSERT_EQ(scene.forces.size(), 3u) << "the second point is too close to the first";
  for (const PlacedForce& force : scene.forces) {
    EXPECT_NEAR(force.force_W.x(), -0.001 * vehicle_.mass_kg * kGravity, 1e-9);
    EXPECT_NEAR(force.force_W.y(), 0.0, 1e-9);
  }
}

TEST_F(DiagnosisSceneTest, MismatchFollowsThePath) {
  const auto model = write("none.yaml", "effects: []");
  const DiagnosisScene scene = load_diagnosis_scene(vehicle_, model, report());
  ASSERT_EQ(scene.paths.size(), 1u);
  EXPECT_EQ(scene.paths[0].nominal, (std::vector<double>{1.0, 1.0, 4.0, 4.0}));
  EXPECT_EQ(scene.paths[0].fitted, (std::vector<double>(4, 1.0)));
  EXPECT_FALSE(scene.floor);
}

TEST_F(DiagnosisSceneTest, AMapAloneIsShownWithoutAReport) {
  const auto model =
      write("map.yaml",
            "effects:\n"
            "  - kind: floor_unevenness\n"
            "    parameters: {origin_m: [1, 2], spacing_m: 0.5, height_m: [[0, 0.002], [0, 0.002]]}\n"
            "  - kind: friction_patch\n"
            "    parameters: {coefficient: 0.01, center_x_m: 1.5, center_y_m: 2, radius_m: 0.3}\n");
  const DiagnosisScene scene = load_diagnosis_scene(vehicle_, model, "");
  EXPECT_EQ(scene.verdict, "");
  EXPECT_EQ(scene.statements.size(), 2u);
  ASSERT_TRUE(scene.floor);
  EXPECT_NEAR(scene.floor->highest_m, 0.001, 1e-12);
  EXPECT_EQ(scene.forces.size(), 4u);
  ASSERT_EQ(scene.patches.size(), 1u);
  EXPECT_EQ(scene.patches[0].radius_m, 0.3);
}

TEST_F(DiagnosisSceneTest, BadReportsAreNamed) {
  const auto model = write("none.yaml", "effects: []");
  const auto fault = [&](const std::string& path) {
    try {
      load_diagnosis_scene(vehicle_, model, path);
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  EXPECT_NE(fault("/no/such/report.json").find("/no/such/report.json: cannot be read"), std::string::npos);
  report();
  EXPECT_NE(fault(write("report.json", "{")).find("report.json: "), std::string::npos);
  EXPECT_NE(fault(write("report.json", "{}")).find("not a diagnosis' report"), std::string::npos);
  EXPECT_THROW(load_diagnosis_scene(vehicle_, "/no/such/model.yaml", ""), ConfigError);
}

TEST(DiagnosisColors, AreAtTheirEnds) {
  EXPECT_GT(diverging_color(1.0)[0], diverging_color(1.0)[2]);
  EXPECT_LT(diverging_color(-1.0)[0], diverging_color(-1.0)[2]);
  EXPECT_EQ(diverging_color(-3.0), diverging_color(-1.0));
  EXPECT_GT(mismatch_color(1.0)[1], mismatch_color(1.0)[0]);
  EXPECT_GT(mismatch_color(9.0)[0], mismatch_color(9.0)[1]);
  EXPECT_EQ(mismatch_color(0.2), mismatch_color(1.0));
}

}  // namespace
}  // namespace atmos
