#include <atmos_msgs/MocapStatus.h>
#include <atmos_msgs/NmpcStatus.h>
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>

#include <vector>

namespace {

const ros::Time kStart(1000);

class NmpcNode : public testing::Test {
 protected:
  void SetUp() override {
    odometry_ = node_.advertise<nav_msgs::Odometry>("/atmos/odometry", 100);
    frames_ = node_.advertise<atmos_msgs::MocapStatus>("/atmos/mocap/status", 100);
    set_points_ = node_.advertise<geometry_msgs::PoseStamped>("/atmos/setpoint", 10);
    status_ = node_.subscribe("/atmos/nmpc/status", 100, &NmpcNode::on_status, this);
    const ros::WallTime limit = ros::WallTime::now() + ros::WallDuration(20.0);
    while (odometry_.getNumSubscribers() == 0 || frames_.getNumSubscribers() == 0 ||
           set_points_.getNumSubscribers() == 0 || status_.getNumPublishers() == 0) {
      ASSERT_LT(ros::WallTime::now(), limit) << "the node does not connect";
      ros::WallDuration(0.01).sleep();
    }
  }

  void on_status(const atmos_msgs::NmpcStatus& status) { answers_.push_back(status); }

  // True once the node has answered so many periods.
  bool answered(std::size_t periods, double limit_s) {
    const ros::WallTime limit = ros::WallTime::now() + ros::WallDuration(limit_s);
    while (answers_.size() < periods && ros::WallTime::now() < limit) {
      ros::spinOnce();
      ros::WallDuration(0.005).sleep();
    }
    return answers_.size() >= periods;
  }

  void send_odometry(double time_s) {
    nav_msgs::Odometry message;
    message.header.stamp = kStart + ros::Duration(time_s);
    message.header.frame_id = "world";
    message.child_frame_id = "atmos/base_link";
    message.pose.pose.orientation.w = 1.0;
    odometry_.publish(message);
  }

  void send_frame(double time_s, bool published) {
    atmos_msgs::MocapStatus message;
    message.header.stamp = kStart + ros::Duration(time_s);
    message.published = published;
    frames_.publish(message);
  }

  ros::NodeHandle node_;
  ros::Publisher odometry_, frames_, set_points_;
  ros::Subscriber status_;
  std::vector<atmos_msgs::NmpcStatus> answers_;
};

TEST_F(NmpcNode, InLockstepALostFrameWaitsForTheOdometryBeforeIt) {
  geometry_msgs::PoseStamped set_point;
  set_point.header.stamp = kStart;
  set_point.header.frame_id = "world";
  set_point.pose.position.x = 0.5;
  set_point.pose.orientation.w = 1.0;
  set_points_.publish(set_point);
  send_frame(0.0, true);
  send_odometry(0.0);
  ASSERT_TRUE(answered(1, 10.0));

  // The frame at 0.09 s was good, the one at 0.1 s lost; the odometry of the former comes last.
  send_frame(0.09, true);
  send_frame(0.1, false);
  EXPECT_FALSE(answered(2, 0.3)) << "decided without the odometry that was promised";
  send_odometry(0.09);
  ASSERT_TRUE(answered(2, 10.0));
  EXPECT_EQ(answers_[1].header.stamp, kStart + ros::Duration(0.1));
  EXPECT_NEAR(answers_[1].odometry_age, 0.01, 1e-6);
}

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "nmpc_node_test");
  return RUN_ALL_TESTS();
}
