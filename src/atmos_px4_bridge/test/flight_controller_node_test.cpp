// The flight controller as a node: one order per period on the wall clock, valves closed without odometry,
// recovery, and an answer to every command in lockstep.
#include <atmos_msgs/FlightControllerStatus.h>
#include <atmos_msgs/ThrusterCommand.h>
#include <geometry_msgs/WrenchStamped.h>
#include <gtest/gtest.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

namespace {

using atmos_msgs::FlightControllerStatus;

constexpr double kLimit_s = 10.0;
constexpr double kPeriod_s = 0.1;

bool wait_until(
    const std::function<bool()>& done, const std::function<void()>& meanwhile = [] {}) {
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(kLimit_s);
  while (!done() && ros::ok() && ros::WallTime::now() < end) {
    meanwhile();
    ros::spinOnce();
    ros::WallDuration(0.002).sleep();
  }
  return done();
}

class Robot {
 public:
  explicit Robot(const std::string& name) : node_("/" + name) {
    commands_ = node_.advertise<atmos_msgs::ThrusterCommand>("nmpc/thrusters", 100);
    wrenches_ = node_.advertise<geometry_msgs::WrenchStamped>("nmpc/wrench", 100);
    odometry_ = node_.advertise<nav_msgs::Odometry>("odometry", 100);
    orders_ = node_.subscribe("thruster_command", 1000, &Robot::on_order, this);
    status_ = node_.subscribe("flight_controller/status", 1000, &Robot::on_status, this);
  }

  bool connected() const {
    return commands_.getNumSubscribers() == 1 && wrenches_.getNumSubscribers() == 1 &&
           orders_.getNumPublishers() == 1 && status_.getNumPublishers() == 1;
  }
  bool odometry_connected() const { return odometry_.getNumSubscribers() == 1; }

  void send_command(const ros::Time& stamp, double duty) {
    atmos_msgs::ThrusterCommand command;
    command.header.stamp = stamp;
    command.period = kPeriod_s;
    command.duty.assign(8, duty);
    commands_.publish(command);
  }

  void send_force(const ros::Time& stamp, double force_x) {
    geometry_msgs::WrenchStamped command;
    command.header.stamp = stamp;
    command.wrench.force.x = force_x;
    wrenches_.publish(command);
  }

  void send_odometry() {
    nav_msgs::Odometry odometry;
    odometry.header.stamp = ros::Time::now();
    odometry.pose.pose.orientation.w = 1.0;
    odometry_.publish(odometry);
  }

  // What a controller does: once per period, a command for the next one.
  void control(bool with_odometry) {
    if (with_odometry) send_odometry();
    const double next = (std::floor(ros::Time::now().toSec() / kPeriod_s) + 1.0) * kPeriod_s;
    if (next <= commanded_ + 0.5 * kPeriod_s) return;
    commanded_ = next;
    send_command(ros::Time(next), 0.25);
  }

  bool flies() const { return !status.empty() && status.back().state == FlightControllerStatus::FLYING; }

  std::vector<atmos_msgs::ThrusterCommand> orders;
  std::vector<FlightControllerStatus> status;

 private:
  void on_order(const atmos_msgs::ThrusterCommand& message) { orders.push_back(message); }
  void on_status(const FlightControllerStatus& message) { status.push_back(message); }

  ros::NodeHandle node_;
  ros::Publisher commands_, wrenches_, odometry_;
  ros::Subscriber orders_, status_;
  double commanded_ = 0.0;
};

TEST(FlightControllerNode, OwnsTheClockAndWatchesTheOdometry) {
  Robot robot("atmos");
  ASSERT_TRUE(wait_until([&] { return robot.connected() && robot.odometry_connected(); }));

  // Nobody commands: every period is closed all the same.
  ASSERT_TRUE(wait_until([&] { return robot.orders.size() >= 5; }));
  for (const auto& order : robot.orders) {
    EXPECT_EQ(*std::max_element(order.duty.begin(), order.duty.end()), 0.0);
    EXPECT_NEAR(std::remainder(order.header.stamp.toSec(), kPeriod_s), 0.0, 1e-5);
  }
  EXPECT_EQ(robot.status.back().reason, "no odometry yet");

  ASSERT_TRUE(wait_until([&] { return robot.flies(); }, [&] { robot.control(true); }));
  ASSERT_TRUE(wait_until([&] { return robot.orders.size() >= 15; }, [&] { robot.control(true); }));
  EXPECT_EQ(robot.orders.back().duty, std::vector<double>(8, 0.25));

  // The controller goes on, but odometry stops.
  const ros::Time cut = ros::Time::now();
  ASSERT_TRUE(wait_until([&] { return !robot.flies(); }, [&] { robot.control(false); }));
  EXPECT_LT((robot.status.back().header.stamp - cut).toSec(), 0.5 + 2.0 * kPeriod_s);
  EXPECT_GT((robot.status.back().header.stamp - cut).toSec(), 0.5 - 2.0 * kPeriod_s);
  EXPECT_EQ(robot.status.back().reason.rfind("odometry is ", 0), 0u) << robot.status.back().reason;

  ASSERT_TRUE(wait_until([&] { return robot.flies(); }, [&] { robot.control(true); })) << "no recovery";
}

TEST(FlightControllerNode, AnswersEveryCommandInLockstep) {
  Robot robot("stepped");
  ASSERT_TRUE(wait_until([&] { return robot.connected(); }));
  const ros::Time start(1234, 500000000);
  for (int k = 0; k < 20; ++k) {
    const ros::Time stamp = start + ros::Duration(0, 100000000) * k;
    robot.send_command(stamp, k == 7 ? 1.5 : 0.5);
    const auto answers = static_cast<std::size_t>(k + 1);
    ASSERT_TRUE(wait_until([&] { return robot.orders.size() == answers && robot.status.size() == answers; }))
        << k;
    EXPECT_EQ(robot.orders.back().header.stamp, stamp);
    EXPECT_EQ(robot.orders.back().duty, std::vector<double>(8, k == 7 ? 0.0 : 0.5));
    EXPECT_EQ(robot.flies(), k != 7);
  }
  EXPECT_EQ(robot.status.back().malformed, 1u);

  const std::size_t before = robot.orders.size();
  robot.send_force(start + ros::Duration(2.0), 1.7);
  ASSERT_TRUE(wait_until([&] { return robot.orders.size() == before + 1; }));
  // Thrusters 1 and 3 push forward: half of each.
  EXPECT_NEAR(robot.orders.back().duty[0], 0.5, 1e-9);
  EXPECT_NEAR(robot.orders.back().duty[2], 0.5, 1e-9);
}

}  // namespace

int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "flight_controller_node_test");
  ros::NodeHandle keep_alive;
  return RUN_ALL_TESTS();
}
