// The executables on bad input: exit code 2 and one sentence that says what is wrong.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

namespace {

namespace fs = std::filesystem;

struct Outcome {
  int code;
  std::string text;
};

Outcome run(const std::string& command) {
  FILE* pipe = popen((command + " 2>&1").c_str(), "r");
  Outcome outcome{-1, ""};
  char buffer[512];
  while (pipe != nullptr && std::fgets(buffer, sizeof(buffer), pipe) != nullptr) outcome.text += buffer;
  const int status = pipe != nullptr ? pclose(pipe) : -1;
  if (WIFEXITED(status)) outcome.code = WEXITSTATUS(status);
  return outcome;
}

class Tools : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = fs::temp_directory_path() / ("atmos_sim2real_tools_" + std::to_string(getpid()));
    fs::create_directories(folder_);
    const Outcome made = run(std::string("/usr/bin/python3 ") + MAKE_BAGS + " " + folder_.string());
    ASSERT_EQ(made.code, 0) << made.text;
  }
  static void TearDownTestSuite() { fs::remove_all(folder_); }

  static std::string bag(const std::string& name) { return (folder_ / (name + ".bag")).string(); }
  static std::string vehicle() { return std::string(ATMOS_ROOT) + "/config/vehicle/atmos.yaml"; }
  static Outcome diagnose(const std::string& arguments, const std::string& with_vehicle = vehicle()) {
    return run(std::string(DIAGNOSE) + " --vehicle " + with_vehicle + " --out " + (folder_ / "out").string() +
               " " + arguments);
  }
  static Outcome predict(const std::string& arguments) {
    return run(std::string(PREDICT) + " --vehicle " + vehicle() + " --out " + (folder_ / "p.csv").string() +
               " " + arguments);
  }
  static void expect_refused(const Outcome& outcome, const std::string& because) {
    EXPECT_EQ(outcome.code, 2) << outcome.text;
    EXPECT_NE(outcome.text.find(because), std::string::npos) << outcome.text;
  }

  static fs::path folder_;
};
fs::path Tools::folder_;

TEST_F(Tools, RefuseBadRecordings) {
  for (const auto& [name, because] : {std::pair<std::string, std::string>{"missing", "no such file"},
                                      {"no_commands", "no atmos_msgs/ThrusterCommand"},
                                      {"no_poses", "no pose"},
                                      {"one_pose", "fewer than two usable poses"},
                                      {"four_valves", "not for the 8 thrusters"},
                                      {"clocks_apart", "clocks apart"},
                                      {"all_nan", "fewer than two usable poses"},
                                      {"no_messages", "no atmos_msgs/ThrusterCommand"},
                                      {"truncated", "cannot be read as a ROS 1 bag"},
                                      {"text", "cannot be read as a ROS 1 bag"},
                                      {"empty", "cannot be read as a ROS 1 bag"}}) {
    SCOPED_TRACE(name);
    expect_refused(diagnose(bag(name)), because);
    expect_refused(diagnose(bag("good") + " --holdout " + bag(name)), because);
    expect_refused(predict(bag(name)), because);
  }
  EXPECT_FALSE(fs::exists(folder_ / "out" / "report.json"));
}

// Nothing is claimed of a motion that does not answer these commands as this vehicle's would.
TEST_F(Tools, RefuseAnotherVehicleAndClocksSecondsApart) {
  const std::string other = std::string(ATMOS_ROOT) + "/config/vehicle/astrobee_ground.yaml";
  expect_refused(diagnose(bag("flown"), other), "times as strongly as the vehicle file says");
  expect_refused(diagnose(bag("seconds_apart")), "stamped about 3.0 s late against the commands");
  EXPECT_EQ(predict("--horizon 2 " + bag("flown")).code, 0);
}

// One bad recording among good ones: nothing is concluded from the rest behind the user's back.
TEST_F(Tools, RefuseAListWithOneBadRecording) {
  const Outcome outcome = diagnose(bag("good") + " " + bag("truncated") + " " + bag("half_nan"));
  expect_refused(outcome, bag("truncated") + ": cannot be read as a ROS 1 bag");
}

TEST_F(Tools, WarnOfWhatWasDropped) {
  const Outcome outcome = predict("--horizon 2 " + bag("half_nan"));
  EXPECT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_NE(outcome.text.find("warning: " + bag("half_nan") + ": 600 poses are not finite"),
            std::string::npos)
      << outcome.text;
}

TEST_F(Tools, RefuseBadArguments) {
  EXPECT_EQ(diagnose("").code, 2);
  EXPECT_EQ(diagnose("--unknown " + bag("good")).code, 2);
  EXPECT_EQ(predict("--horizon -1 " + bag("good")).code, 2);
  expect_refused(diagnose(bag("good") + " --holdout " + bag("good")), "given more than once");
  expect_refused(diagnose(bag("good"), "/nowhere/vehicle.yaml"), "/nowhere/vehicle.yaml");
  expect_refused(predict("--horizon 100 " + bag("good")), "shorter than one horizon");
  expect_refused(predict("--initial-states /nowhere.csv " + bag("good")), "cannot be read");
  const std::string model = (folder_ / "model.yaml").string();
  std::ofstream(model) << "effects: [{kind: thruster_dead, parameters: {thruster: 12, since_s: 0}}]\n";
  expect_refused(predict("--model " + model + " " + bag("good")),
                 "effects[0].parameters.thruster: must not be above 8");
}

// A robot at rest that nothing pushes: nothing is claimed, and the simulator agrees.
TEST_F(Tools, DiagnoseReportsAndReplaysInTheSimulator) {
  const Outcome outcome = diagnose(bag("good"));
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_NE(outcome.text.find("verdict: consistent"), std::string::npos) << outcome.text;
  std::ifstream file(folder_ / "out" / "report.json");
  const nlohmann::json report = nlohmann::json::parse(file);
  EXPECT_TRUE(report["effects"].empty());
  const nlohmann::json& check = report["ode_check"];
  ASSERT_TRUE(check.contains("windows")) << check;
  EXPECT_EQ(check["windows"], 2);
  EXPECT_EQ(check["on"], "fitted recordings");
  EXPECT_LT(check["fitted"]["position_rms_m"].get<double>(), 1e-3);
  EXPECT_LT(check["largest_difference_m"].get<double>(), 1e-6);
  EXPECT_FALSE(fs::exists(folder_ / "out" / "ode_check"));
}

TEST_F(Tools, PredictWritesItsTable) {
  const Outcome outcome = predict("--horizon 5 " + bag("good"));
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  std::ifstream file(folder_ / "p.csv");
  std::string line;
  std::getline(file, line);
  EXPECT_EQ(line, "window_start,stamp,x,y,yaw");
  std::getline(file, line);
  EXPECT_EQ(line.rfind("1700000001.", 0), 0u) << line;
  int rows = 1;
  while (std::getline(file, line)) ++rows;
  EXPECT_EQ(rows, 100);  // two windows of 12 s
}

TEST_F(Tools, PredictWritesWholeRowsOfAModelThatRunsAway) {
  const std::string model = (folder_ / "model.yaml").string();
  std::ofstream(model) << "effects: [{kind: unmodelled, parameters: {force_x_n: 1e5 * (x + 1), force_y_n: 0, "
                          "torque_n_m: 0, coefficients: {}}}]\n";
  const Outcome outcome = predict("--horizon 5 --model " + model + " " + bag("good"));
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  std::ifstream file(folder_ / "p.csv");
  std::string line;
  std::size_t longest = 0;
  int rows = 0;
  for (; std::getline(file, line); ++rows) {
    EXPECT_EQ(std::count(line.begin(), line.end(), ','), 4) << line;
    longest = std::max(longest, line.size());
  }
  EXPECT_EQ(rows, 101);
  EXPECT_GT(longest, 60u);  // it did run away
}

}  // namespace
