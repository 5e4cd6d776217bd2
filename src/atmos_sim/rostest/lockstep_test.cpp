// The simulator node in lockstep: what it does when answers come, and how it ends when they do not.
#include <atmos_msgs/ThrusterCommand.h>
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Clock.h>
#include <sys/wait.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace {

constexpr double kFlight = 2.0;  // s

struct Ended {
  int exit_code;
  std::string output;
  double wall_s;
};

std::string write_scenario(const std::string& duration) {
  const std::string path = testing::TempDir() + "/sim_lockstep_scenario.yaml";
  std::ofstream(path) << "name: lockstep\nvehicle: " ATMOS_CONFIG_DIR "/vehicle/atmos.yaml\n"
                      << "controller: none.yaml\nduration_s: " << duration << "\nseed: 1\n"
                      << "start: {x_m: 0.0, y_m: 0.0, yaw_deg: 0.0}\n"
                      << "setpoints:\n  - {time_s: 0.0, x_m: 0.0, y_m: 0.0, yaw_deg: 0.0}\n"
                      << "mocap: {rate_hz: 100.0, noise_m: 0.0, noise_rad: 0.0}\n";
  return path;
}

Ended run_simulator(const std::string& arguments, const std::string& duration = "2.0") {
  ros::param::del("/atmos/sim");  // what an earlier run was given
  const ros::WallTime start = ros::WallTime::now();
  const std::string command = std::string(SIM_NODE) + " __ns:=/atmos _scenario:=" + write_scenario(duration) +
                              " " + arguments + " 2>&1";
  FILE* pipe = popen(command.c_str(), "r");
  Ended ended{-1, "", 0.0};
  char buffer[512];
  while (std::fgets(buffer, sizeof buffer, pipe) != nullptr) ended.output += buffer;
  const int status = pclose(pipe);
  ended.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  ended.wall_s = (ros::WallTime::now() - start).toSec();
  return ended;
}

TEST(Lockstep, AMissingAnswerEndsTheFlightAndNamesTheTopic) {
  const Ended ended = run_simulator("_answer_limit_s:=2.0");
  EXPECT_EQ(ended.exit_code, 1) << ended.output;
  EXPECT_NE(ended.output.find("/atmos/thruster_command"), std::string::npos) << ended.output;
  EXPECT_NE(ended.output.find("1000.000"), std::string::npos) << ended.output;
  EXPECT_GE(ended.wall_s, 2.0);
  EXPECT_LT(ended.wall_s, 12.0);
}

TEST(Lockstep, AMissingConnectionIsNamedBeforeTimeStarts) {
  const Ended ended = run_simulator("_answer_limit_s:=2.0 _wait_for:='/nobody:/atmos/odometry'");
  EXPECT_EQ(ended.exit_code, 1) << ended.output;
  EXPECT_NE(ended.output.find("node /nobody does not receive topic /atmos/odometry"), std::string::npos)
      << ended.output;
  EXPECT_LT(ended.wall_s, 12.0);
}

TEST(Lockstep, BadParametersAndScenariosEndWithCodeTwo) {
  const Ended clock = run_simulator("_clock:=sundial _speed:=-1.0");
  EXPECT_EQ(clock.exit_code, 2) << clock.output;
  EXPECT_NE(clock.output.find("clock"), std::string::npos);
  EXPECT_NE(clock.output.find("speed"), std::string::npos);
  const Ended type = run_simulator("_speed:=fast");
  EXPECT_EQ(type.exit_code, 2) << type.output;
  EXPECT_NE(type.output.find("speed: is of the wrong type"), std::string::npos) << type.output;
  const Ended wait = run_simulator("_wait_for:=nonsense");
  EXPECT_EQ(wait.exit_code, 2) << wait.output;
  const Ended scenario = run_simulator("", "-3.0");
  EXPECT_EQ(scenario.exit_code, 2) << scenario.output;
  EXPECT_NE(scenario.output.find("duration_s"), std::string::npos) << scenario.output;
}

// A controller that answers every period's first frame: pushes along +x for the first second.
class Answering {
 public:
  Answering() : spinner_(1) {
    command_ = node_.advertise<atmos_msgs::ThrusterCommand>("/atmos/thruster_command", 100);
    pose_ = node_.subscribe("/atmos/mocap/pose", 1000, &Answering::answer, this,
                            ros::TransportHints().tcpNoDelay());
    clock_ = node_.subscribe("/clock", 1000, &Answering::tick, this);
    truth_ = node_.subscribe("/atmos/sim/truth", 1000, &Answering::truth, this);
    spinner_.start();
  }
  void stop() { spinner_.stop(); }

  std::vector<double> frames, ticks;
  nav_msgs::Odometry last_truth;

 private:
  void answer(const geometry_msgs::PoseStamped& pose) {
    const double t = pose.header.stamp.toSec();
    frames.push_back(t);
    const double periods = t / 0.1;
    if (std::abs(periods - std::round(periods)) > 1e-4) return;
    atmos_msgs::ThrusterCommand command;
    command.header.stamp = pose.header.stamp;
    command.period = 0.1;
    command.duty.assign(8, 0.0);
    if (frames.size() <= 100) command.duty[0] = command.duty[2] = 0.5;
    command_.publish(command);
  }
  void tick(const rosgraph_msgs::Clock& clock) { ticks.push_back(clock.clock.toSec()); }
  void truth(const nav_msgs::Odometry& odometry) { last_truth = odometry; }

  ros::NodeHandle node_;
  ros::AsyncSpinner spinner_;
  ros::Publisher command_;
  ros::Subscriber pose_, clock_, truth_;
};

TEST(Lockstep, FliesToTheEndWhenAnswered) {
  Answering controller;
  const std::string summary_path = testing::TempDir() + "/sim_lockstep_summary.json";
  std::remove(summary_path.c_str());
  const std::string self = ros::this_node::getName();
  const Ended ended =
      run_simulator("_summary:=" + summary_path + " _wait_for:='" + self + ":/atmos/mocap/pose " + self +
                    ":/clock " + self + ":/atmos/sim/truth /atmos/sim:/atmos/thruster_command'");
  controller.stop();
  EXPECT_EQ(ended.exit_code, 0) << ended.output;

  // Every frame, in order, none twice; time never runs back.
  ASSERT_EQ(controller.frames.size(), 201U);
  for (std::size_t k = 0; k < controller.frames.size(); ++k)
    EXPECT_NEAR(controller.frames[k], 1000.0 + 0.01 * static_cast<double>(k), 1e-6);
  EXPECT_TRUE(std::is_sorted(controller.ticks.begin(), controller.ticks.end()));
  EXPECT_NEAR(controller.ticks.back(), 1000.0 + kFlight, 1e-6);

  // 3.4 N for ten half periods: v = 0.5 F/m.
  EXPECT_NEAR(controller.last_truth.twist.twist.linear.x, 0.5 * 3.4 / 16.8, 1e-9);
  EXPECT_EQ(controller.last_truth.header.frame_id, "world");
  EXPECT_EQ(controller.last_truth.child_frame_id, "atmos/base_link");

  nlohmann::json summary;
  std::ifstream(summary_path) >> summary;
  EXPECT_NEAR(summary.at("flight_s").get<double>(), kFlight, 1e-9);
  EXPECT_GT(summary.at("realtime_factor").get<double>(), 0.0);
  EXPECT_GE(summary.at("steps").get<int>(), 2000);
  EXPECT_GT(summary.at("wall_s").get<double>(), 0.0);
}

TEST(RealTime, TakesAsLongAsTheSpeedSaysAndNeedsNoAnswer) {
  Answering controller;
  const Ended ended = run_simulator("_clock:=real _speed:=2.0");
  controller.stop();
  EXPECT_EQ(ended.exit_code, 0) << ended.output;
  EXPECT_GE(ended.wall_s, kFlight / 2.0);
  EXPECT_TRUE(std::is_sorted(controller.ticks.begin(), controller.ticks.end()));
  EXPECT_GE(controller.ticks.size(), 0.5 * 250.0 * kFlight);
}

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "sim_lockstep_test");
  ros::NodeHandle keep_alive;
  return RUN_ALL_TESTS();
}
