// The bridge as a node: one status per frame, odometry unless lost, recovery; frames held in lockstep.
#include <atmos_msgs/MocapStatus.h>
#include <atmos_msgs/ThrusterCommand.h>
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <tf2_msgs/TFMessage.h>

#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace {

using atmos_msgs::MocapStatus;

constexpr double kLimit_s = 10.0;
const ros::Time kStart(1234, 500000000);

ros::Time stamp_of(int frame) { return kStart + ros::Duration(0, 10000000) * frame; }

bool wait_until(const std::function<bool()>& done, double limit_s = kLimit_s) {
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(limit_s);
  while (!done() && ros::ok() && ros::WallTime::now() < end) {
    ros::spinOnce();
    ros::WallDuration(0.002).sleep();
  }
  return done();
}

// Talks to the bridge in one namespace and keeps what it answers.
class Bridge {
 public:
  explicit Bridge(const std::string& robot) : node_("/" + robot) {
    poses_ = node_.advertise<geometry_msgs::PoseStamped>("mocap/pose", 1000);
    commands_ = node_.advertise<atmos_msgs::ThrusterCommand>("thruster_command", 100);
    odometry_ = node_.subscribe("odometry", 1000, &Bridge::on_odometry, this);
    status_ = node_.subscribe("mocap/status", 1000, &Bridge::on_status, this);
    transforms_ = node_.subscribe("/tf", 1000, &Bridge::on_transform, this);
  }

  bool connected() const {
    return poses_.getNumSubscribers() == 1 && commands_.getNumSubscribers() == 1 &&
           odometry_.getNumPublishers() == 1 && status_.getNumPublishers() == 1 &&
           transforms_.getNumPublishers() == 2;
  }

  // The robot moves along world x at 0.5 m/s and looks along world y; x not-a-number: not seen.
  void send_frame(int frame, bool seen = true) {
    geometry_msgs::PoseStamped pose;
    pose.header.stamp = stamp_of(frame);
    pose.header.frame_id = "world";
    const double nan = std::numeric_limits<double>::quiet_NaN();
    pose.pose.position.x = seen ? 0.005 * frame : nan;
    pose.pose.orientation.w = pose.pose.orientation.z = seen ? std::sqrt(0.5) : nan;
    poses_.publish(pose);
  }

  void send_command(const ros::Time& stamp) {
    atmos_msgs::ThrusterCommand command;
    command.header.stamp = stamp;
    command.period = 0.1;
    command.duty.assign(8, 0.0);
    commands_.publish(command);
  }

  std::vector<nav_msgs::Odometry> odometry;
  std::vector<MocapStatus> status;
  int transforms = 0;

 private:
  void on_odometry(const nav_msgs::Odometry& message) { odometry.push_back(message); }
  void on_status(const MocapStatus& message) { status.push_back(message); }
  void on_transform(const tf2_msgs::TFMessage& message) {
    for (const auto& transform : message.transforms) {
      if (transform.child_frame_id != node_.getNamespace().substr(1) + "/base_link") continue;
      ++transforms;
    }
  }

  ros::NodeHandle node_;
  ros::Publisher poses_, commands_;
  ros::Subscriber odometry_, status_, transforms_;
};

TEST(MocapBridge, EveryFrameIsAnsweredAndALostRobotHasNoOdometry) {
  Bridge bridge("atmos");
  ASSERT_TRUE(wait_until([&] { return bridge.connected(); }));

  // 100 good frames, 50 unseen ones (5 lie within the coast time), 20 good ones.
  for (int frame = 0; frame < 170; ++frame) {
    bridge.send_frame(frame, frame < 100 || frame >= 150);
    const auto answered = static_cast<std::size_t>(frame + 1);
    ASSERT_TRUE(wait_until([&] { return bridge.status.size() == answered; }))
        << "no status for frame " << frame;
  }
  ASSERT_TRUE(wait_until([&] { return bridge.odometry.size() == 125 && bridge.transforms == 125; }))
      << bridge.odometry.size() << " odometry messages, " << bridge.transforms << " transforms";

  std::size_t next = 0;
  for (int frame = 0; frame < 170; ++frame) {
    const MocapStatus& status = bridge.status[static_cast<std::size_t>(frame)];
    const bool lost = frame >= 105 && frame < 150;
    const bool coasting = frame >= 100 && frame < 105;
    EXPECT_EQ(status.header.stamp, stamp_of(frame));
    EXPECT_EQ(status.state, lost       ? MocapStatus::LOST
                            : coasting ? MocapStatus::COASTING
                                       : MocapStatus::TRACKING)
        << frame;
    EXPECT_EQ(status.published, !lost) << frame;
    EXPECT_EQ(status.frames, static_cast<std::uint64_t>(frame + 1));
    if (lost) continue;
    EXPECT_EQ(bridge.odometry[next].header.stamp, stamp_of(frame));
    EXPECT_NEAR(bridge.odometry[next].pose.pose.position.x, 0.005 * frame, 2e-3) << frame;
    ++next;
  }
  EXPECT_EQ(bridge.status.back().rejected_not_finite, 50u);
  EXPECT_EQ(bridge.status.back().reinitialisations, 1u);

  const nav_msgs::Odometry& settled = bridge.odometry[99];
  EXPECT_EQ(settled.header.frame_id, "world");
  EXPECT_EQ(settled.child_frame_id, "atmos/base_link");
  EXPECT_NEAR(settled.twist.twist.linear.x, 0.0, 2e-3) << "the twist is in the body";
  EXPECT_NEAR(settled.twist.twist.linear.y, -0.5, 2e-3);
  EXPECT_GT(settled.pose.covariance[0], 0.0);
  EXPECT_GT(settled.twist.covariance[35], 0.0);
}

TEST(MocapBridge, InLockstepFramesWaitForTheirCommand) {
  Bridge bridge("stepped");
  ASSERT_TRUE(wait_until([&] { return bridge.connected(); }));
  bridge.send_frame(0);
  ASSERT_TRUE(wait_until([&] { return bridge.odometry.size() == 1; })) << "the first frame needs no command";
  for (int frame = 1; frame <= 11; ++frame) bridge.send_frame(frame);
  EXPECT_FALSE(wait_until([&] { return bridge.status.size() > 1; }, 0.5))
      << "a frame did not wait for its command";
  bridge.send_command(kStart);
  ASSERT_TRUE(wait_until([&] { return bridge.odometry.size() == 11; }));
  EXPECT_FALSE(wait_until([&] { return bridge.odometry.size() > 11; }, 0.3));
  bridge.send_command(stamp_of(10));
  ASSERT_TRUE(wait_until([&] { return bridge.odometry.size() == 12; }));
  for (int frame = 0; frame <= 11; ++frame)
    EXPECT_EQ(bridge.odometry[static_cast<std::size_t>(frame)].header.stamp, stamp_of(frame));
}

}  // namespace

int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "mocap_bridge_test");
  ros::NodeHandle keep_alive;
  return RUN_ALL_TESTS();
}
