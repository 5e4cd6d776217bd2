#include "atmos_model/scenario.h"

#include <gtest/gtest.h>

#include <unistd.h>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "atmos_model/plant.h"
#include "mutations.h"
#include "nominal.h"

namespace atmos {
namespace {

class ScenarioFile : public ::testing::Test {
 protected:
  ScenarioFile()
      : folder_(std::filesystem::temp_directory_path() / ("atmos_scenario_" + std::to_string(getpid()))) {
    std::filesystem::create_directories(folder_);
  }
  ~ScenarioFile() override { std::filesystem::remove_all(folder_); }
  Scenario load(const YAML::Node& root) const {
    const std::string path = (folder_ / "scenario.yaml").string();
    std::ofstream(path) << emitted(root);
    return load_scenario(path);
  }
  static YAML::Node valid() {
    return YAML::Load("name: test\nvehicle: " + shipped("config/vehicle/atmos.yaml") + R"(
controller: controller.yaml
duration_s: 40.0
seed: 7
step_s: 0.0005
start: {x_m: 0.5, y_m: -0.5, yaw_deg: 90}
setpoints:
  - {time_s: 0.0, x_m: 0.0, y_m: 0.0, yaw_deg: 0.0}
  - {time_s: 20.0, x_m: 1.0, y_m: 2.0, yaw_deg: -45.0}
mocap:
  rate_hz: 100
  noise_m: 0.0003
  noise_rad: 0.001
  publish_delay_s: 0.01
  dropout_probability: 0.1
  dropouts: [{start_s: 3.0, duration_s: 0.4}]
  distortion_m: 0.0002
  stamp_jitter_s: 0.0001
lab: {thrust_scatter: 0.02, slow_force_n: 0.003, slow_torque_n_m: 0.0002, slow_time_s: 5.0}
trajectories:
  - {time_s: 5.0, duration_s: 10.0, shape: figure_eight, center_m: [0.1, 0.2], size_m: [0.5, 0.4], laps: 2, yaw_deg: 180}
effects:
  - {kind: floor_tilt, parameters: {slope_x: 0.001, slope_y: -0.002}}
  - {kind: supply_coupling, parameters: {fraction_per_open_thruster: 0.125}}
)");
  }

 private:
  std::filesystem::path folder_;
};

TEST_F(ScenarioFile, HoldsWhatIsWritten) {
  const Scenario scenario = load(valid());
  EXPECT_EQ(scenario.name, "test");
  EXPECT_EQ(scenario.vehicle.thrusters.size(), 8u);
  EXPECT_EQ(std::filesystem::path(scenario.controller_path).parent_path(),
            std::filesystem::path(scenario.path).parent_path());
  EXPECT_EQ(scenario.duration_s, 40.0);
  EXPECT_EQ(scenario.seed, 7u);
  EXPECT_EQ(scenario.step_s, 0.0005);
  EXPECT_DOUBLE_EQ(scenario.start.yaw_rad, M_PI / 2);
  ASSERT_EQ(scenario.set_points.size(), 2u);
  EXPECT_EQ(scenario.set_points[1].time_s, 20.0);
  EXPECT_EQ(scenario.set_points[1].y_m, 2.0);
  EXPECT_DOUBLE_EQ(scenario.set_points[1].yaw_rad, -M_PI / 4);
  ASSERT_EQ(scenario.trajectories.size(), 1u);
  EXPECT_EQ(scenario.trajectories[0].shape, TrajectorySettings::Shape::kFigureEight);
  EXPECT_EQ(scenario.trajectories[0].center_y_m, 0.2);
  EXPECT_EQ(scenario.trajectories[0].size_x_m, 0.5);
  EXPECT_DOUBLE_EQ(scenario.trajectories[0].yaw_rad, M_PI);
  EXPECT_EQ(scenario.trajectories[0].yaw_turns, 0.0);
  EXPECT_EQ(scenario.mocap.publish_delay_s, 0.01);
  ASSERT_EQ(scenario.mocap.dropouts.size(), 1u);
  EXPECT_EQ(scenario.mocap.dropouts[0].duration_s, 0.4);
  EXPECT_EQ(scenario.mocap.distortion_m, 0.0002);
  EXPECT_EQ(scenario.mocap.stamp_jitter_s, 0.0001);
  EXPECT_EQ(scenario.lab.thrust_scatter, 0.02);
  EXPECT_EQ(scenario.lab.slow_force_n, 0.003);
  EXPECT_EQ(scenario.lab.slow_torque_n_m, 0.0002);
  EXPECT_EQ(scenario.lab.slow_time_s, 5.0);
  ASSERT_EQ(scenario.effects.size(), 2u);
  EXPECT_EQ(kind_of(scenario.effects[0]), "supply_coupling");
}

TEST_F(ScenarioFile, EveryMutatedCopyIsRefusedWithTheRightKey) {
  const std::vector<Mutation> mutations = every_mutation(
      valid(), {"step_s", "effects", "trajectories", "mocap.publish_delay_s", "mocap.dropout_probability",
                "mocap.dropouts", "mocap.distortion_m", "mocap.stamp_jitter_s", "lab", "lab.thrust_scatter",
                "lab.slow_force_n", "lab.slow_torque_n_m", "lab.slow_time_s"});
  EXPECT_GT(mutations.size(), 70u);
  for (const Mutation& mutation : mutations)
    expect_refused(mutation, [this](const YAML::Node& root) { load(root); });
}

TEST_F(ScenarioFile, ValuesOutOfRangeAreRefused) {
  const auto refuses = [this](const std::string& key, const auto& change) {
    YAML::Node root = valid();
    change(root);
    expect_refused({key, "out of range", root}, [this](const YAML::Node& node) { load(node); });
  };
  refuses("duration_s", [](YAML::Node s) { s["duration_s"] = 0; });
  refuses("seed", [](YAML::Node s) { s["seed"] = -1; });
  refuses("step_s", [](YAML::Node s) { s["step_s"] = 0.002; });
  refuses("start.yaw_deg", [](YAML::Node s) { s["start"]["yaw_deg"] = 361; });
  refuses("setpoints[0].time_s", [](YAML::Node s) { s["setpoints"][0]["time_s"] = 1; });
  refuses("setpoints[1].time_s", [](YAML::Node s) { s["setpoints"][1]["time_s"] = 0; });
  refuses("setpoints[1].time_s", [](YAML::Node s) { s["setpoints"][1]["time_s"] = 41; });
  refuses("setpoints", [](YAML::Node s) { s["setpoints"] = YAML::Load("[]"); });
  refuses("mocap.rate_hz", [](YAML::Node s) { s["mocap"]["rate_hz"] = 0; });
  refuses("mocap.noise_m", [](YAML::Node s) { s["mocap"]["noise_m"] = -1; });
  refuses("mocap.dropout_probability", [](YAML::Node s) { s["mocap"]["dropout_probability"] = 1.1; });
  refuses("mocap.dropouts[0].duration_s", [](YAML::Node s) { s["mocap"]["dropouts"][0]["duration_s"] = 0; });
}

TEST_F(ScenarioFile, AFaultHasNoFollowUps) {
  YAML::Node root = valid();
  root["duration_s"] = "long";
  try {
    load(root);
    FAIL();
  } catch (const ConfigError& error) {
    EXPECT_EQ(error.faults().size(), 1u) << error.what();
  }
}

TEST_F(ScenarioFile, FaultsOfTheVehicleAreReportedInTheSameRound) {
  YAML::Node root = valid();
  root["seed"] = -1;
  root["vehicle"] = "absent.yaml";
  try {
    load(root);
    FAIL();
  } catch (const ConfigError& error) {
    ASSERT_EQ(error.faults().size(), 2u) << error.what();
    EXPECT_EQ(error.faults()[0].key, "seed");
    EXPECT_EQ(error.faults()[1].rule, "cannot be read");
  }
}

TEST_F(ScenarioFile, EffectsMustFitTheVehicleAndCausality) {
  const auto refuses = [this](const std::string& key, const std::string& effect) {
    YAML::Node root = valid();
    root["effects"] = YAML::Load("[" + effect + "]");
    expect_refused({key, effect, root}, [this](const YAML::Node& node) { load(node); });
  };
  refuses("effects[0].parameters.thruster",
          "{kind: thruster_leak, parameters: {thruster: 9, fraction: 0.1}}");
  refuses("effects[0].parameters.delay_s", "{kind: mocap_latency, parameters: {delay_s: -0.01}}");
  refuses("effects[0].parameters.delay_s", "{kind: command_delay, parameters: {delay_s: -0.01}}");
  YAML::Node root = valid();
  root["effects"] = YAML::Load("[{kind: thruster_leak, parameters: {thruster: 8, fraction: 0.1}}]");
  EXPECT_EQ(load(root).effects.size(), 1u);
}

// The example floors reach the limit of the paper's floor, 2 mm/m, and stay within it.
TEST(ShippedConfiguration, FloorMapsAreAsSteepAsTheyMayBe) {
  for (const std::string name : {"typical_lab_day", "harsh"}) {
    const Scenario scenario = load_scenario(shipped("config/scenario/" + name + ".yaml"));
    const Plant plant(scenario.vehicle, scenario.effects, kStart);
    double steepest = 0.0;
    for (double x = -1.5; x < 3.0; x += 0.02) {
      for (double y = -1.2; y < 2.4; y += 0.02)
        steepest = std::max(steepest, plant.floor_slope<double>({x, y}).norm());
    }
    EXPECT_LT(steepest, 2.02e-3) << name;
    EXPECT_GT(steepest, 1.95e-3) << name;
  }
}

TEST(ShippedConfiguration, EveryVehicleAndScenarioLoads) {
  int vehicles = 0, scenarios = 0;
  for (const auto& file : std::filesystem::directory_iterator(shipped("config/vehicle"))) {
    EXPECT_NO_THROW(load_vehicle(file.path().string())) << file.path();
    ++vehicles;
  }
  for (const auto& file : std::filesystem::directory_iterator(shipped("config/scenario"))) {
    std::vector<Scenario> fleet;
    EXPECT_NO_THROW(fleet = load_fleet(file.path().string())) << file.path();
    for (const Scenario& scenario : fleet)
      EXPECT_TRUE(std::filesystem::exists(scenario.controller_path)) << file.path();
    ++scenarios;
  }
  EXPECT_GE(vehicles, 1);
  EXPECT_GE(scenarios, 1);
}

}  // namespace
}  // namespace atmos
