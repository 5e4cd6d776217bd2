// The node's own way from an odometry message to the bytes of its command, without the network: what its
// callback does before the command is on the wire. Beside `nmpc/feedback_latency`, which is the core's share
// of it.
#include <nav_msgs/Odometry.h>
#include <ros/serialization.h>
#include <time.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "atmos_model/benchmark_row.h"
#include "atmos_model_ros/messages.h"
#include "atmos_nmpc/config.h"
#include "atmos_nmpc/controller.h"
#include "closed_loop.h"
#include "nmpc_messages.h"

namespace {

using namespace atmos;

double thread_cpu_seconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

nav_msgs::Odometry odometry_message(const OdometrySample& sample) {
  using namespace state13;
  nav_msgs::Odometry message;
  message.header.stamp = ros::Time(sample.stamp_s);
  message.header.frame_id = kWorldFrame;
  message.child_frame_id = base_frame("atmos");
  const Quaternion4<double> q = sample.x.segment<4>(kQuaternion);
  const Vec3<double> v_B = rotate<double>({q[0], -q[1], -q[2], -q[3]}, sample.x.segment<3>(kVelocity));
  message.pose.pose.position.x = sample.x[0];
  message.pose.pose.position.y = sample.x[1];
  message.pose.pose.orientation.w = q[0];
  message.pose.pose.orientation.z = q[3];
  message.twist.twist.linear.x = v_B[0];
  message.twist.twist.linear.y = v_B[1];
  message.twist.twist.angular.z = sample.x[kAngularVelocity + 2];
  return message;
}

void bench(const std::string& controller_file, const std::string& suffix) {
  const std::string folder = ATMOS_CONFIG_DIR;
  const Vehicle vehicle = load_vehicle(folder + "/vehicle/atmos.yaml");
  Controller controller(vehicle, load_controller(folder + "/controller/" + controller_file, vehicle), true,
                        thread_cpu_seconds);
  testing::Flight robot(vehicle, controller, 1234.5, {}, {3e-4, 2e-3, 9e-4, 2e-3}, 1);
  const std::string frame = base_frame("atmos");
  std::vector<double> ms;
  std::uint32_t bytes = 0;
  for (int k = 0; k < 800; ++k) {
    if (k % 200 == 0)
      controller.add_goal(testing::planar_goal(robot.now(), k % 400 == 0 ? 1.0 : 0.0, 0.3, 0.5));
    const nav_msgs::Odometry message = odometry_message(robot.measure());
    const double begin = thread_cpu_seconds();
    OdometrySample sample;
    sample.stamp_s = message.header.stamp.toSec();
    sample.x = state13_from(message);
    sample.frames_match = message.header.frame_id == kWorldFrame && message.child_frame_id == frame;
    const ControlDecision* decision = controller.on_odometry(sample, robot.now());
    bytes += static_cast<std::uint32_t>(
        ros::serialization::serializeMessage(thruster_message(*decision, frame)).num_bytes);
    const double end = thread_cpu_seconds();
    if (decision->feedback) ms.push_back(1e3 * (end - begin));
    robot.carry_out(*decision);
  }
  print_row("nmpc/feedback_latency/node" + suffix, "ms", ms);
  std::fprintf(stderr, "%u bytes of commands\n", bytes);
}

}  // namespace

// An argument is a prefix of the rows wanted.
int main(int argc, char** argv) {
  const std::string prefix = argc > 1 ? argv[1] : "", name = "nmpc/feedback_latency/node";
  if (name.compare(0, std::min(prefix.size(), name.size()), prefix, 0, name.size()) != 0) return 0;
  bench("offset_free_direct_allocation.yaml", "");
  bench("direct_allocation_harsh.yaml", "/with_model");
}
