// rviz with the shipped configuration, as the operator has it: buttons are clicked, and what arrives at
// bridge, autopilot, set-point player and distance monitor is checked.
#include <atmos_msgs/AutopilotState.h>
#include <atmos_msgs/DistanceMonitorStatus.h>
#include <atmos_msgs/SupervisorStatus.h>
#include <atmos_msgs/ThrusterCommand.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/WrenchStamped.h>
#include <gtest/gtest.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Log.h>
#include <rviz/display.h>
#include <rviz/display_group.h>
#include <rviz/render_panel.h>
#include <rviz/tool.h>
#include <rviz/tool_manager.h>
#include <rviz/visualization_frame.h>
#include <rviz/visualization_manager.h>
#include <std_msgs/String.h>
#include <trajectory_msgs/MultiDOFJointTrajectory.h>

#include <QApplication>
#include <QComboBox>
#include <QElapsedTimer>
#include <QLabel>
#include <QPushButton>
#include <QTemporaryDir>
#include <QtTest/QTest>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace {

using atmos_msgs::SupervisorStatus;

constexpr int kLimit_ms = 20000;
constexpr int kRepeat_ms = 1000;                   // a hold is told again
constexpr double kX = 0.4, kY = -0.2, kYaw = 0.3;  // where the robot stands
constexpr double kOtherX = 1.4;                    // where another one stands, beside it

// One rviz for all tests: it takes seconds to start.
rviz::VisualizationFrame* frame = nullptr;

class Panel : public ::testing::Test {
 protected:
  Panel() : node_("/atmos") {
    odometry_ = node_.advertise<nav_msgs::Odometry>("odometry", 10);
    truth_ = node_.advertise<nav_msgs::Odometry>("sim/truth", 10);
    other_ = node_.advertise<nav_msgs::Odometry>("/other/odometry", 10);
    wrench_ = node_.advertise<geometry_msgs::WrenchStamped>("nmpc/wrench", 10);
    keep("px4/state", state_);
    keep("px4/supervisor", supervisor_);
    keep("valves", valves_);
    keep("setpoint", set_point_);
    keep("setpoint_player/state", mission_);
    keep("/distance_monitor/status", distance_);
    keep("trajectory", trajectory_);
    EXPECT_TRUE(until([&] { return state_.connected; })) << "no link";
    EXPECT_TRUE(until([&] { return widget<QComboBox>("robot")->currentText() == "atmos"; }))
        << "no robot found";
  }

  template <class Message>
  void keep(const std::string& topic, Message& newest) {
    const boost::function<void(const Message&)> take = [&newest](const Message& m) { newest = m; };
    subscribers_.push_back(node_.subscribe<Message>(topic, 100, take));
  }

  // Serves rviz and ROS, with robots that stand still and a controller that pushes, until `done`.
  bool until(const std::function<bool()>& done) {
    QElapsedTimer timer;
    timer.start();
    for (int k = 0; !done() && timer.elapsed() < kLimit_ms; ++k) {
      const nav_msgs::Odometry odometry = odometry_of("atmos", kX);
      odometry_.publish(odometry);
      other_.publish(odometry_of("other", kOtherX));
      truth_.publish(odometry);
      if (k % 8 == 0) {
        geometry_msgs::WrenchStamped wrench;
        wrench.header.stamp = ros::Time::now();
        wrench.wrench.force.x = 1.7;
        wrench_.publish(wrench);
      }
      QTest::qWait(10);
      ros::spinOnce();
    }
    return done();
  }

  // Of a robot at rest.
  static nav_msgs::Odometry odometry_of(const std::string& robot, double x) {
    nav_msgs::Odometry odometry;
    odometry.header.stamp = ros::Time::now();
    odometry.header.frame_id = "world";
    odometry.child_frame_id = robot + "/base_link";
    odometry.pose.pose.position.x = x;
    odometry.pose.pose.position.y = kY;
    odometry.pose.pose.orientation.z = std::sin(0.5 * kYaw);
    odometry.pose.pose.orientation.w = std::cos(0.5 * kYaw);
    return odometry;
  }

  template <class Widget>
  static Widget* widget(const char* name) {
    auto* found = frame->findChild<Widget*>(name);
    if (found == nullptr) throw std::runtime_error(std::string("the panel has no ") + name);
    return found;
  }
  // A click counts only on a button that is enabled; waits for that.
  void click(const char* name) {
    auto* button = widget<QPushButton>(name);
    ASSERT_TRUE(until([&] { return button->isEnabled(); })) << name << " stays disabled";
    QTest::mouseClick(button, Qt::LeftButton);
  }
  bool shows(const std::string& text) {
    return until([&] {
      const auto labels = frame->findChildren<QLabel*>();
      return std::any_of(labels.begin(), labels.end(), [&](const QLabel* label) {
        return label->text().toStdString().find(text) != std::string::npos;
      });
    });
  }
  double widest() const {
    return valves_.duty.empty() ? -1.0 : *std::max_element(valves_.duty.begin(), valves_.duty.end());
  }
  // Whether the distance monitor sees both robots, and holds both or none.
  bool both(bool held) const {
    return distance_.held.size() == 2 && distance_.held[0] == held && distance_.held[1] == held &&
           std::isfinite(distance_.distance[0]);
  }
  bool flying() const { return supervisor_.state == SupervisorStatus::FLYING && state_.armed; }

  // A press, a move (if any) and a release on the map, in pixels from the middle of the view.
  void drag(int dx, int dy) {
    rviz::ToolManager* tools = frame->getManager()->getToolManager();
    for (int i = 0; i < tools->numTools(); ++i) {
      if (tools->getTool(i)->getClassId() == "atmos_operator/SetPoint")
        tools->setCurrentTool(tools->getTool(i));
    }
    rviz::RenderPanel* map = frame->getManager()->getRenderPanel();
    const QPoint from(map->width() / 2, map->height() / 2), to = from + QPoint(dx, dy);
    const auto send = [map](QEvent::Type type, const QPoint& at, Qt::MouseButton button,
                            Qt::MouseButtons held) {
      QMouseEvent event(type, at, map->mapToGlobal(at), button, held, Qt::NoModifier);
      QApplication::sendEvent(map, &event);
    };
    send(QEvent::MouseButtonPress, from, Qt::LeftButton, Qt::LeftButton);
    for (int k = 1; from != to && k <= 5; ++k)
      send(QEvent::MouseMove, from + (to - from) * k / 5, Qt::NoButton, Qt::LeftButton);
    send(QEvent::MouseButtonRelease, to, Qt::LeftButton, Qt::NoButton);
  }
  double set_yaw() const {
    return 2.0 * std::atan2(set_point_.pose.orientation.z, set_point_.pose.orientation.w);
  }

  ros::NodeHandle node_;
  ros::Publisher odometry_, truth_, other_, wrench_;
  std::vector<ros::Subscriber> subscribers_;
  atmos_msgs::AutopilotState state_;
  SupervisorStatus supervisor_;
  atmos_msgs::ThrusterCommand valves_;
  geometry_msgs::PoseStamped set_point_;
  std_msgs::String mission_;
  atmos_msgs::DistanceMonitorStatus distance_;
  trajectory_msgs::MultiDOFJointTrajectory trajectory_;
};

TEST_F(Panel, EveryPluginOfTheConfigurationIsLoaded) {
  for (const QObject* object : frame->findChildren<QObject*>())
    EXPECT_EQ(std::string(object->metaObject()->className()).find("Failed"), std::string::npos);
  rviz::DisplayGroup* displays = frame->getManager()->getRootDisplayGroup();
  EXPECT_GE(displays->numDisplays(), 3);
  for (int i = 0; i < displays->numDisplays(); ++i)
    EXPECT_EQ(std::string(displays->getDisplayAt(i)->metaObject()->className()).find("Failed"),
              std::string::npos);
  rviz::ToolManager* tools = frame->getManager()->getToolManager();
  bool has_tool = false;
  for (int i = 0; i < tools->numTools(); ++i) {
    EXPECT_EQ(std::string(tools->getTool(i)->metaObject()->className()).find("Failed"), std::string::npos);
    has_tool = has_tool || std::string(tools->getTool(i)->metaObject()->className()) == "atmos::SetPointTool";
  }
  EXPECT_TRUE(has_tool);
}

TEST_F(Panel, TheDisplayReceivesTheRobot) {
  rviz::DisplayGroup* displays = frame->getManager()->getRootDisplayGroup();
  rviz::Display* robots = nullptr;
  for (int i = 0; i < displays->numDisplays(); ++i) {
    if (displays->getDisplayAt(i)->getName() == "Robots") robots = displays->getDisplayAt(i);
  }
  ASSERT_NE(robots, nullptr);
  // rviz lists the namespaces of the markers that came.
  const rviz::Property* spaces = robots->subProp("Namespaces");
  EXPECT_TRUE(until([&] {
    for (int k = 0; k < spaces->numChildren(); ++k) {
      if (spaces->childAt(k)->getName() == "atmos body") return true;
    }
    return false;
  })) << "no marker of the robot came into rviz";
}

TEST_F(Panel, ArmsAndDisarms) {
  EXPECT_FALSE(state_.armed);
  EXPECT_TRUE(shows("disarmed"));
  click("arm");
  ASSERT_TRUE(until([&] { return flying() && widest() > 0.0; })) << supervisor_.text << supervisor_.refusal;
  EXPECT_TRUE(shows("armed, offboard"));
  click("disarm");
  EXPECT_TRUE(until([&] { return !state_.armed && state_.mode == "manual"; }));
}

TEST_F(Panel, KillsAndReleases) {
  click("arm");
  ASSERT_TRUE(until([&] { return flying() && widest() > 0.0; }));
  click("kill");
  EXPECT_TRUE(until([&] { return !state_.armed && widest() == 0.0; }));
  EXPECT_EQ(supervisor_.rule, SupervisorStatus::KILL);
  EXPECT_TRUE(until([&] { return !widget<QPushButton>("arm")->isEnabled(); })) << "arming a killed robot";
  click("release_kill");
  EXPECT_TRUE(until([&] { return supervisor_.rule != SupervisorStatus::KILL; }));
  click("kill_all");
  EXPECT_TRUE(until([&] { return supervisor_.rule == SupervisorStatus::KILL; }));
  click("release_kill");
  EXPECT_TRUE(until([&] { return supervisor_.rule != SupervisorStatus::KILL; }));
}

TEST_F(Panel, SetsTheMode) {
  for (const char* mode : {"acro", "manual"}) {
    widget<QComboBox>("mode")->setCurrentText(mode);
    click("set_mode");
    EXPECT_TRUE(until([&] { return state_.mode == mode; })) << mode;
  }
}

TEST_F(Panel, StartsAndStopsTheMission) {
  ASSERT_TRUE(until([&] { return mission_.data == "idle" || mission_.data == "stopped"; }));
  click("start_mission");
  ASSERT_TRUE(until([&] { return mission_.data == "running"; }));
  EXPECT_TRUE(until([&] { return set_point_.header.frame_id == "world"; })) << "no set-point";
  EXPECT_TRUE(shows("running"));
  click("stop_mission");
  ASSERT_TRUE(until([&] { return mission_.data == "stopped"; }));
  EXPECT_TRUE(until([&] { return std::abs(set_point_.pose.position.x - kX) < 1e-6; }))
      << "it holds its place";
  EXPECT_NEAR(set_point_.pose.position.y, kY, 1e-6);
  EXPECT_NEAR(set_yaw(), kYaw, 1e-6);
}

// What the monitor held when another robot came too fast goes on only after the click.
TEST_F(Panel, ReleasesTheHoldOfTheDistanceMonitor) {
  ASSERT_TRUE(until([&] { return both(false) && other_.getNumSubscribers() > 0; }))
      << "the monitor does not see both";
  EXPECT_FALSE(widget<QPushButton>("release_hold")->isEnabled());

  nav_msgs::Odometry approach = odometry_of("other", kOtherX);
  approach.twist.twist.linear.x = -0.5 * std::cos(kYaw);
  approach.twist.twist.linear.y = 0.5 * std::sin(kYaw);
  other_.publish(approach);
  ASSERT_TRUE(until([&] { return both(true); })) << "they would have touched";
  EXPECT_TRUE(shows("held: "));
  EXPECT_TRUE(until([&] { return !trajectory_.points.empty(); })) << "it is not told to stay";

  click("release_hold");
  EXPECT_TRUE(until([&] { return both(false); })) << distance_.reason;
  EXPECT_TRUE(until([&] { return !widget<QPushButton>("release_hold")->isEnabled(); }));
  trajectory_ = {};
  QElapsedTimer quiet;
  quiet.start();
  EXPECT_TRUE(until([&] { return quiet.elapsed() > 2 * kRepeat_ms; }));
  EXPECT_TRUE(trajectory_.points.empty()) << "released, and yet told to stay";
}

TEST_F(Panel, SetsAPointOnTheMap) {
  ASSERT_TRUE(until([&] { return odometry_.getNumSubscribers() >= 5; }))
      << "bridge, player, monitor, display or tool does not listen";
  QTest::qWait(200);
  set_point_ = {};
  drag(80, 0);
  ASSERT_TRUE(until([&] { return set_point_.header.frame_id == "world"; })) << "no set-point";
  // The configuration's view looks at (0.6, 0.4), with world x to the right.
  EXPECT_NEAR(set_point_.pose.position.x, 0.6, 0.05);
  EXPECT_NEAR(set_point_.pose.position.y, 0.4, 0.05);
  EXPECT_NEAR(set_yaw(), 0.0, 0.1) << "dragged to the right";
  set_point_ = {};
  drag(0, -80);
  ASSERT_TRUE(until([&] { return set_point_.header.frame_id == "world"; }));
  EXPECT_NEAR(set_yaw(), 0.5 * M_PI, 0.1) << "dragged upwards";
  set_point_ = {};
  drag(0, 0);
  ASSERT_TRUE(until([&] { return set_point_.header.frame_id == "world"; }));
  EXPECT_NEAR(set_yaw(), kYaw, 1e-3) << "a click keeps the heading";
}

}  // namespace

int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);
  // Software rendering, and no settings of whoever runs this.
  QTemporaryDir home;
  qputenv("HOME", home.path().toUtf8());
  qputenv("XDG_RUNTIME_DIR", home.path().toUtf8());
  qputenv("LIBGL_ALWAYS_SOFTWARE", "1");
  qputenv("QT_X11_NO_MITSHM", "1");
  ros::init(argc, argv, "panel_test", ros::init_options::NoSigintHandler);
  QApplication app(argc, argv);
  ros::NodeHandle keep_alive;

  std::vector<std::string> errors;
  const boost::function<void(const rosgraph_msgs::Log&)> listen = [&errors](const rosgraph_msgs::Log& log) {
    if (log.name == ros::this_node::getName() && log.level >= rosgraph_msgs::Log::ERROR)
      errors.push_back(log.msg);
  };
  const ros::Subscriber log = keep_alive.subscribe<rosgraph_msgs::Log>("/rosout", 1000, listen);

  int result = 1;
  {
    rviz::VisualizationFrame window;
    window.setApp(&app);
    window.setSplashPath("");
    window.initialize(ATMOS_CONFIG_DIR "/rviz/operator.rviz");
    window.show();
    frame = &window;
    result = RUN_ALL_TESTS();
  }
  for (const std::string& error : errors) {
    std::fprintf(stderr, "rviz reported an error: %s\n", error.c_str());
    result = 1;
  }
  return result;
}
