// A joystick of Linux -> joy (sensor_msgs/Joy), 50 Hz, until it is unplugged. Parameter: ~joystick (device).
// Axes are those of the kernel, turned so that forward and left are positive.
#include <fcntl.h>
#include <linux/joystick.h>
#include <ros/ros.h>
#include <sensor_msgs/Joy.h>
#include <unistd.h>

#include <cerrno>

#include "atmos_model_ros/node.h"

namespace {

constexpr double kPeriod_s = 0.02;

template <class T>
void set(std::vector<T>& values, std::size_t index, T value) {
  if (values.size() <= index) values.resize(index + 1);
  values[index] = value;
}

// Takes what has happened since the last call; false when the device is gone.
bool read_events(int device, sensor_msgs::Joy& joy) {
  js_event event;
  ssize_t size;
  while ((size = read(device, &event, sizeof(event))) == sizeof(event)) {
    const int kind = event.type & ~JS_EVENT_INIT;  // the state at the start comes as events too
    if (kind == JS_EVENT_AXIS) set(joy.axes, event.number, -static_cast<float>(event.value) / 32767.0f);
    if (kind == JS_EVENT_BUTTON) set(joy.buttons, event.number, static_cast<int>(event.value));
  }
  return size < 0 && errno == EAGAIN;
}

}  // namespace

int main(int argc, char** argv) {
  return atmos::run_node(argc, argv, "joystick", [] {
    ros::NodeHandle node;
    const auto path = atmos::required_parameter<std::string>(ros::NodeHandle("~"), "joystick");
    const int device = open(path.c_str(), O_RDONLY | O_NONBLOCK);
    if (device < 0) throw std::invalid_argument("joystick " + path + " cannot be opened");
    ros::Publisher publisher = node.advertise<sensor_msgs::Joy>("joy", 1);
    sensor_msgs::Joy joy;
    for (; ros::ok(); ros::WallDuration(kPeriod_s).sleep()) {
      if (!read_events(device, joy)) {
        ROS_ERROR("joystick %s is gone", path.c_str());
        return 1;
      }
      joy.header.stamp = ros::Time::now();
      publisher.publish(joy);
      ros::spinOnce();
    }
    return 0;
  });
}
