// Bridge and emulated Pixhawk as nodes on a pseudo-terminal: parameters, thruster test, arming by hand,
// set-points of several levels, kill, and telemetry.
#include <atmos_msgs/AutopilotState.h>
#include <atmos_msgs/GetParameter.h>
#include <atmos_msgs/RateCommand.h>
#include <atmos_msgs/SetFlightMode.h>
#include <atmos_msgs/SetParameter.h>
#include <atmos_msgs/SupervisorStatus.h>
#include <atmos_msgs/TestThruster.h>
#include <atmos_msgs/ThrusterCommand.h>
#include <geometry_msgs/WrenchStamped.h>
#include <gtest/gtest.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <sensor_msgs/Imu.h>
#include <std_srvs/SetBool.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

namespace {

using atmos_msgs::SupervisorStatus;

constexpr double kLimit_s = 15.0;

class Px4BridgeNode : public ::testing::Test {
 protected:
  Px4BridgeNode() : node_("/atmos") {
    odometry_ = node_.advertise<nav_msgs::Odometry>("odometry", 10);
    truth_ = node_.advertise<nav_msgs::Odometry>("sim/truth", 10);
    wrench_ = node_.advertise<geometry_msgs::WrenchStamped>("nmpc/wrench", 10);
    thrusters_ = node_.advertise<atmos_msgs::ThrusterCommand>("nmpc/thrusters", 10);
    subscribe("px4/state", state_);
    subscribe("px4/supervisor", supervisor_);
    subscribe("valves", valves_);
    subscribe("thruster_command", reported_);
    subscribe("imu", imu_);
    EXPECT_TRUE(until([&] { return state_.connected; })) << "no link";
  }

  template <class Message>
  void subscribe(const std::string& topic, Message& newest) {
    const boost::function<void(const Message&)> take = [&newest](const Message& m) { newest = m; };
    subscribers_.push_back(node_.subscribe<Message>(topic, 100, take));
  }

  // Odometry at 100 Hz, and what `command` sends, until `done`.
  bool until(
      const std::function<bool()>& done, const std::function<void()>& command = [] {}) {
    const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(kLimit_s);
    for (int k = 0; !done() && ros::ok() && ros::WallTime::now() < end; ++k) {
      nav_msgs::Odometry odometry;
      odometry.header.stamp = ros::Time::now();
      odometry.header.frame_id = "world";
      odometry.child_frame_id = "atmos/base_link";
      odometry.pose.pose.orientation.w = 1.0;
      odometry_.publish(odometry);
      truth_.publish(odometry);
      if (k % 10 == 0) command();
      ros::spinOnce();
      ros::WallDuration(0.01).sleep();
    }
    return done();
  }

  template <class Service>
  typename Service::Response call(const std::string& name, const typename Service::Request& request) {
    typename Service::Response response;
    EXPECT_TRUE(ros::service::waitForService("/atmos/" + name, 5000));
    EXPECT_TRUE(
        ros::service::call("/atmos/" + name, const_cast<typename Service::Request&>(request), response))
        << name;
    return response;
  }
  void call_bool(const std::string& name, bool value) {
    std_srvs::SetBool::Request request;
    request.data = value;
    call<std_srvs::SetBool>(name, request);
  }

  void push() {
    geometry_msgs::WrenchStamped message;
    message.header.stamp = ros::Time::now();
    message.wrench.force.x = 1.7;
    wrench_.publish(message);
  }
  void open_fifth() {
    atmos_msgs::ThrusterCommand message;
    message.header.stamp = ros::Time::now();
    message.period = 0.1;
    message.duty.assign(8, 0.0);
    message.duty[4] = 0.3;
    thrusters_.publish(message);
  }
  double valve(std::size_t number) const {
    return valves_.duty.size() == 8 ? valves_.duty[number - 1] : -1.0;
  }
  double widest() const {
    return valves_.duty.empty() ? -1.0 : *std::max_element(valves_.duty.begin(), valves_.duty.end());
  }

  ros::NodeHandle node_;
  ros::Publisher odometry_, truth_, wrench_, thrusters_;
  std::vector<ros::Subscriber> subscribers_;
  atmos_msgs::AutopilotState state_;
  SupervisorStatus supervisor_;
  atmos_msgs::ThrusterCommand valves_, reported_;
  sensor_msgs::Imu imu_;
};

TEST_F(Px4BridgeNode, ReadsAndSetsParameters) {
  atmos_msgs::GetParameter::Request get;
  get.name = "SC_YAW_P";
  EXPECT_NEAR(call<atmos_msgs::GetParameter>("px4/get_parameter", get).value, 1.5, 1e-6);
  atmos_msgs::SetParameter::Request set;
  set.name = "SPC_VEL_MANUAL";
  set.value = 0.15;
  EXPECT_TRUE(call<atmos_msgs::SetParameter>("px4/set_parameter", set).success);
  get.name = set.name;
  EXPECT_NEAR(call<atmos_msgs::GetParameter>("px4/get_parameter", get).value, 0.15, 1e-6);
  get.name = "NO_SUCH_NAME";
  EXPECT_FALSE(call<atmos_msgs::GetParameter>("px4/get_parameter", get).success);
}

TEST_F(Px4BridgeNode, TestsOneThruster) {
  atmos_msgs::TestThruster::Request request;
  request.thruster = 9;
  request.duty = 0.2;
  request.duration = 1.0;
  EXPECT_FALSE(call<atmos_msgs::TestThruster>("px4/test_thruster", request).success);
  request.thruster = 3;
  EXPECT_TRUE(call<atmos_msgs::TestThruster>("px4/test_thruster", request).success);
  EXPECT_TRUE(until([&] { return valve(3) == 0.2; }));
  EXPECT_EQ(valve(1), 0.0);
  EXPECT_TRUE(until([&] { return widest() == 0.0; }));
}

TEST_F(Px4BridgeNode, FliesWhenAskedAndIsKilled) {
  EXPECT_EQ(supervisor_.state, SupervisorStatus::IDLE) << "nothing arms by itself";
  call_bool("px4/arm", true);
  const auto flying = [&] { return supervisor_.state == SupervisorStatus::FLYING; };
  ASSERT_TRUE(until(flying, [&] { push(); })) << supervisor_.text << supervisor_.refusal;
  ASSERT_TRUE(until([&] { return valve(1) == 0.5 && valve(3) == 0.5; }, [&] { push(); }));
  EXPECT_TRUE(state_.armed);
  EXPECT_EQ(state_.mode, "offboard");
  EXPECT_TRUE(until([&] { return reported_.duty == valves_.duty; }, [&] { push(); }));
  EXPECT_TRUE(until([&] { return std::abs(imu_.linear_acceleration.z - 9.81) < 0.01; }, [&] { push(); }));
  EXPECT_TRUE(until([&] { return valve(5) == 0.3 && valve(1) == 0.0; }, [&] { open_fifth(); }));

  call_bool("px4/kill", true);
  EXPECT_TRUE(until([&] { return widest() == 0.0 && !state_.armed; }, [&] { push(); }));
  EXPECT_EQ(supervisor_.rule, SupervisorStatus::KILL);
  call_bool("px4/kill", false);
  call_bool("px4/arm", true);
  ASSERT_TRUE(until([&] { return flying() && widest() > 0.0; }, [&] { push(); }));

  // Silence of the controller.
  ASSERT_TRUE(until([&] { return widest() == 0.0 && supervisor_.rule == SupervisorStatus::SETPOINT_OLD; }));
  call_bool("px4/arm", false);
  EXPECT_TRUE(until([&] { return !state_.armed && state_.mode == "manual"; }));

  atmos_msgs::SetFlightMode::Request mode;
  mode.mode = "acro";
  EXPECT_TRUE(call<atmos_msgs::SetFlightMode>("px4/set_mode", mode).success);
  EXPECT_TRUE(until([&] { return state_.mode == "acro"; }));
  mode.mode = "offboard";
  EXPECT_FALSE(call<atmos_msgs::SetFlightMode>("px4/set_mode", mode).success);
}

}  // namespace

int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "px4_bridge_node_test");
  ros::NodeHandle keep_alive;
  return RUN_ALL_TESTS();
}
