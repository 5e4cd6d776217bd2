// Time from a frame to its odometry inside the filter: prediction between valve edges, update, conversion.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <vector>

#include "../test/sensor_simulator.h"

int main() {
  using namespace atmos;
  test::FlightOptions options;
  options.duration_s = 300.0;
  options.thrust_error = 0.05;
  test::SensorSimulator simulator(test::nominal_vehicle(), options);
  PoseFilter filter(test::nominal_config(), test::nominal_vehicle());

  std::vector<double> ms;
  double checksum = 0.0;
  for (const test::Sample& sample : simulator.samples) {
    const auto begin = std::chrono::steady_clock::now();
    simulator.feed_commands(filter, sample.frame.stamp_s);
    filter.take_frame(sample.frame);
    const OdometryEstimate odometry = to_odometry(filter.estimate());
    ms.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
    checksum += odometry.twist_covariance.trace();
  }
  std::sort(ms.begin(), ms.end());
  std::fprintf(stderr, "bench_mocap: %zu frames, checksum %g\n", ms.size(), checksum);
  std::printf(
      "{\"name\": \"mocap/filter_update\", \"unit\": \"ms\", \"median\": %.6g, \"p99\": %.6g, \"max\": %.6g, "
      "\"n\": %zu}\n",
      ms[ms.size() / 2], ms[ms.size() * 99 / 100], ms.back(), ms.size());
  return 0;
}
