#include "atmos_nmpc/config.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "atmos_model/strict_yaml.h"

namespace atmos {
namespace {

const char* const kFile = ATMOS_CONFIG_DIR "/controller/direct_allocation.yaml";

class ControllerFile : public ::testing::Test {
 protected:
  // Loads the shipped file with one piece of its text replaced and returns the faults as one text.
  std::string faults_with(const std::string& from, const std::string& to) const {
    std::ifstream in(kFile);
    std::stringstream text;
    text << in.rdbuf();
    std::string changed = text.str();
    const std::size_t at = changed.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    changed.replace(at, from.size(), to);
    const std::string path = ::testing::TempDir() + "controller_under_test.yaml";
    std::ofstream(path) << changed;
    std::string what;
    try {
      load_controller(path, vehicle_);
    } catch (const ConfigError& error) {
      what = error.what();
    }
    std::remove(path.c_str());
    return what;
  }

  const Vehicle vehicle_ = load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml");
};

TEST_F(ControllerFile, TheShippedOneLoads) {
  const ControllerConfig config = load_controller(kFile, vehicle_);
  EXPECT_EQ(config.step_s, vehicle_.pwm.period_s);
  EXPECT_EQ(config.attitude_error, AttitudeError::kVector);
}

TEST_F(ControllerFile, EveryShippedOneLoads) {
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(ATMOS_CONFIG_DIR "/controller")) {
    SCOPED_TRACE(entry.path().string());
    ++files;
    EXPECT_NO_THROW({
      const ControllerConfig config = load_controller(entry.path().string(), vehicle_);
      const std::string name = entry.path().filename().string();
      EXPECT_EQ(config.observer.has_value(), name.rfind("offset_free", 0) == 0);
    });
  }
  EXPECT_GE(files, 4);
}

TEST_F(ControllerFile, KeysOfAnotherFormulationAreRefused) {
  EXPECT_NE(faults_with("formulation: direct_allocation", "formulation: wrench").find("pair_force_n"),
            std::string::npos);
  EXPECT_NE(faults_with("pair_force_n: 1.5", "force_n: 1.5").find("force_n"), std::string::npos);
  EXPECT_NE(faults_with("  limits:", "  observer: {}\n  limits:").find("position_noise_m"),
            std::string::npos);
}

TEST_F(ControllerFile, EachBrokenRuleIsNamed) {
  const struct {
    const char *from, *to, *named;
  } cases[] = {
      {"steps: 20", "steps: 0", "steps"},
      {"steps: 20", "steps: 20, stride: 2", "stride"},
      {"step_s: 0.1", "step_s: 0.2", "step_s"},
      {"formulation: direct_allocation", "formulation: magic", "formulation"},
      {"attitude_error: vector", "attitude_error: euler", "attitude_error"},
      {"force: 10", "force: 0", "force"},
      {"force: 10", "", "force"},
      {"tol: 1.0e-4", "tolerance: 1.0e-4", "tolerance"},
      {"tol: 1.0e-4", "tol: tight", "tol"},
      {"time_limit_s: 0.06", "time_limit_s: 0.2", "time_limit_s"},
      {"lead_s: 0.02", "lead_s: 0.02 s", "lead_s"},
      {"odometry_lost_s: 0.5", "odometry_lost_s: 0.05", "odometry_lost_s"},
      {"position: [200, 200, 200]", "position: [0, 0, 0]", "position"},
      {"velocity_m_s: [1, 1, 1]", "velocity_m_s: [1, 1]", "velocity_m_s"},
      {"  limits:", "  model: ../nowhere.yaml\n  limits:", "nowhere.yaml"},
      {"  limits:", "  places: {keep_in_m: [[0, 0], [0, 1], [1, 1], [1, 0]]}\n  limits:", "keep_in_m"},
      {"  limits:", "  places: {keep_in_m: [[0, 0], [1, 0]]}\n  limits:", "keep_in_m"},
      {"  limits:", "  places: {obstacles: [{center_m: [0, 0], radius_m: 0}]}\n  limits:", "radius_m"},
      {"  limits:", "  places: {robots: [snap]}\n  limits:", "robot_distance_m"},
  };
  for (const auto& broken : cases) {
    const std::string what = faults_with(broken.from, broken.to);
    EXPECT_NE(what.find(broken.named), std::string::npos) << broken.to << " -> " << what;
    if (std::string(broken.named) != "nowhere.yaml") {
      EXPECT_NE(what.find("controller_under_test.yaml"), std::string::npos) << broken.to << " -> " << what;
    }
  }
}

TEST_F(ControllerFile, PlacesAreRead) {
  EXPECT_EQ(faults_with("  limits:",
                        "  places:\n    keep_in_m: [[0, 0], [1, 0], [1, 1], [0, 1]]\n"
                        "    obstacles: [{center_m: [0.5, 0.5], radius_m: 0.1}]\n"
                        "    robots: [snap]\n    robot_distance_m: 0.6\n  limits:"),
            "");
}

TEST_F(ControllerFile, SeveralFaultsAreReportedAtOnce) {
  const std::string what = faults_with("{steps: 20, step_s: 0.1}", "{steps: -3, step_s: nan, extra: 1}");
  for (const char* key : {"steps", "step_s", "extra"}) EXPECT_NE(what.find(key), std::string::npos) << what;
}

TEST_F(ControllerFile, AVehicleWithoutPairsIsRefused) {
  Vehicle broken = vehicle_;
  broken.thrusters.pop_back();
  EXPECT_THROW(load_controller(kFile, broken), ConfigError);
}

}  // namespace
}  // namespace atmos
