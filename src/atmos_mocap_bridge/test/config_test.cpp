// Every shipped file loads; mutated copies are refused with the key named.
#include "atmos_mocap_bridge/config.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <tuple>

#include "atmos_mocap_bridge/emulator_config.h"
#include "atmos_model/strict_yaml.h"

namespace atmos {
namespace {

const std::string kFolder = std::string(ATMOS_CONFIG_DIR) + "/mocap";

std::string replaced(const std::string& from, const std::string& to, const std::string& name = "topic.yaml") {
  std::ifstream file(kFolder + "/" + name);
  std::stringstream text;
  text << file.rdbuf();
  std::string copy = text.str();
  const std::size_t at = copy.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return copy.replace(at, from.size(), to);
}

std::vector<ConfigFault> faults_of(const std::string& text) {
  const std::string path = ::testing::TempDir() + "mocap_config_test.yaml";
  std::ofstream(path) << text;
  try {
    load_mocap_config(path);
  } catch (const ConfigError& error) {
    return error.faults();
  }
  return {};
}

TEST(MocapConfig, EveryShippedFileLoads) {
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(kFolder)) {
    if (!entry.is_regular_file()) continue;
    EXPECT_NO_THROW(load_mocap_config(entry.path())) << entry.path();
    ++files;
  }
  EXPECT_GE(files, 2);
  EXPECT_NO_THROW(load_qtm_emulator_config(kFolder + "/emulator/qtm.yaml"));
}

TEST(MocapConfig, ReadsEachKeyIntoItsPlace) {
  const MocapConfig config = load_mocap_config(kFolder + "/topic.yaml");
  EXPECT_EQ(config.robot, "");
  EXPECT_EQ(std::get<TopicSourceConfig>(config.source).topic, "mocap/pose");
  EXPECT_FALSE(std::get<TopicSourceConfig>(config.source).transform);
  EXPECT_EQ(config.calibration.delay_s, 0.0);
  EXPECT_TRUE(config.calibration.marker_offset_m.isZero());
  EXPECT_EQ(config.calibration.yaw_misalignment_rad, 0.0);
  EXPECT_EQ(config.position_noise_m, 0.0003);
  EXPECT_EQ(config.attitude_noise_rad, 0.0009);
  EXPECT_EQ(config.correlation_s, 0.1);
  EXPECT_EQ(config.thrust_error, 0.05);
  EXPECT_EQ(config.known_input.linear_m_s2, 0.01);
  EXPECT_EQ(config.known_input.angular_rad_s2, 0.02);
  EXPECT_EQ(config.unknown_input.linear_m_s2, 0.08);
  EXPECT_EQ(config.unknown_input.angular_rad_s2, 0.75);
  EXPECT_EQ(config.initial_velocity_m_s, 0.5);
  EXPECT_EQ(config.initial_angular_velocity_rad_s, 1.0);
  EXPECT_EQ(config.nis_gate, 40.0);
  EXPECT_EQ(config.reinitialise_after, 5);
  EXPECT_EQ(config.coast_s, 0.05);
  EXPECT_EQ(config.forget_s, 0.3);
}

TEST(MocapConfig, MutatedCopiesAreRefused) {
  const std::pair<std::string, std::string> mutations[] = {
      {"position_noise_m: 0.0003", "position_noise_m: 0"},
      {"attitude_noise_rad: 0.0009", "attitude_noise_rad: 0.0009 # ok\n  extra: 1"},
      {"correlation_s: 0.1", "correlation_s: -0.1"},
      {"thrust_error: 0.05", "thrust_error: 5 %"},
      {"reinitialise_after: 5", "reinitialise_after: 0"},
      {"coast_s: 0.05", "coast_s: .nan"},
      {"coast_s: 0.05", ""},
      {"coast_s: 0.05", "coast_s: 0.4"},
      {"forget_s: 0.3", ""},
      {"kind: topic", "kind: vicon"},
      {"message: pose", "message: odometry"},
      {"measurement:", "calibration: {mocap_latency: {delay_s: -0.1}}\nmeasurement:"},
      {"measurement:", "calibration: {marker_offset: {x_m: 0.1}}\nmeasurement:"},
      {"measurement:", "calibration: {thrust_scale: {factor: 1.1}}\nmeasurement:"},
  };
  for (const auto& [from, to] : mutations) EXPECT_EQ(faults_of(replaced(from, to)).size(), 1u) << to;
  EXPECT_TRUE(faults_of(replaced("coast_s: 0.05", "coast_s: 0.3")).empty());
}

TEST(MocapConfig, MutatedSourcesAreRefused) {
  const std::tuple<std::string, std::string, std::string> mutations[] = {
      {"qtm.yaml", "port: 22223", "port: 0"},
      {"qtm.yaml", "silence_s: 2.0", "silence_s: 0"},
      {"qtm.yaml", "host: 127.0.0.1", ""},
      {"camera.yaml", "dictionary: 4X4_50", "dictionary: 3X3"},
      {"camera.yaml", "min_corners: 4 ", "min_corners: 17 "},
      {"camera.yaml", "{id: 3,", "{id: 0,"},
      {"camera.yaml", "corner_noise_px: 0.08", "corner_noise_px: 0"},
  };
  for (const auto& [name, from, to] : mutations)
    EXPECT_EQ(faults_of(replaced(from, to, name)).size(), 1u) << name << ": " << to;
}

TEST(MocapConfig, CalibrationBearsTheNamesOfTheDiagnosis) {
  const std::string path = ::testing::TempDir() + "mocap_calibration_test.yaml";
  std::ofstream(path) << replaced("measurement:",
                                  "calibration:\n"
                                  "  mocap_latency: {delay_s: 0.008}\n"
                                  "  marker_offset: {x_m: 0.002, y_m: -0.001}\n"
                                  "  yaw_misalignment: {angle_rad: 0.004}\n"
                                  "measurement:");
  const MocapCalibration calibration = load_mocap_config(path).calibration;
  EXPECT_EQ(calibration.delay_s, 0.008);
  EXPECT_EQ(calibration.marker_offset_m, Eigen::Vector2d(0.002, -0.001));
  EXPECT_EQ(calibration.yaw_misalignment_rad, 0.004);
}

}  // namespace
}  // namespace atmos
