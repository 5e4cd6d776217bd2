// Keys of this terminal -> joy (sensor_msgs/Joy), 20 Hz while the dead man is on (keyboard_stick.h).
#include <ros/ros.h>
#include <sensor_msgs/Joy.h>
#include <termios.h>
#include <unistd.h>

#include <stdexcept>

#include "atmos_model_ros/node.h"
#include "atmos_operator/keyboard_stick.h"

namespace {

constexpr double kPoll_s = 0.05;

// Keys at once and unseen; the terminal as it was when this ends. Ctrl-C keeps its meaning.
class RawTerminal {
 public:
  RawTerminal() {
    if (tcgetattr(STDIN_FILENO, &before_) != 0)
      throw std::invalid_argument("stdin is no terminal: keys cannot be read");
    termios raw = before_;
    raw.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
    raw.c_cc[VMIN] = raw.c_cc[VTIME] = 0;
    tcsetattr(STDIN_FILENO, TCSANOW, &raw);
  }
  RawTerminal(const RawTerminal&) = delete;
  RawTerminal& operator=(const RawTerminal&) = delete;
  ~RawTerminal() { tcsetattr(STDIN_FILENO, TCSANOW, &before_); }

 private:
  termios before_;
};

}  // namespace

int main(int argc, char** argv) {
  return atmos::run_node(argc, argv, "teleop_keyboard", [] {
    const RawTerminal terminal;
    ros::NodeHandle node;
    ros::Publisher joy = node.advertise<sensor_msgs::Joy>("joy", 1);
    atmos::KeyboardStick stick;
    bool said = false;
    ROS_INFO("space: dead man on or off; w s a d: forward, back, left, right; q e: turn; any other key: off");
    while (ros::ok()) {
      const double now = ros::SteadyTime::now().toSec();
      for (char key; read(STDIN_FILENO, &key, 1) == 1;) stick.press(key, now);
      if (stick.armed(now) != said) ROS_INFO("dead man %s", (said = !said) ? "on" : "off");
      if (const auto reading = stick.reading(now)) {
        sensor_msgs::Joy message;
        message.header.stamp = ros::Time::now();
        message.axes.assign(reading->axes.begin(), reading->axes.end());
        message.buttons.assign(reading->buttons.begin(), reading->buttons.end());
        joy.publish(message);
      }
      ros::spinOnce();
      ros::WallDuration(kPoll_s).sleep();
    }
    return 0;
  });
}
