// What the mocap bridge costs: a frame inside the filter, and many bodies of one QTM stream.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <memory>
#include <vector>

#include "../test/qtm_link.h"
#include "../test/sensor_simulator.h"
#include "atmos_model/benchmark_row.h"
#include "atmos_model/steady_clock.h"

namespace {

using namespace atmos;

// Processor time of this process: what others do on the machine does not count.
double cpu_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

// Time from a frame to its odometry inside the filter: prediction between valve edges, update, conversion.
void bench_filter() {
  test::FlightOptions options;
  options.duration_s = 300.0;
  options.thrust_error = 0.05;
  test::SensorSimulator simulator(test::nominal_vehicle(), options);
  PoseFilter filter(test::nominal_config(), test::nominal_vehicle());
  std::vector<double> ms;
  double checksum = 0.0;
  for (const test::Sample& sample : simulator.samples) {
    const double begin = steady_seconds();
    simulator.feed_commands(filter, sample.frame.stamp_s);
    filter.take_frame(sample.frame);
    checksum += to_odometry(filter.estimate()).twist_covariance.trace();
    ms.push_back(1e3 * (steady_seconds() - begin));
  }
  std::fprintf(stderr, "bench_mocap: %zu frames, checksum %g\n", ms.size(), checksum);
  print_row("mocap/filter_update", "ms", ms);
}

// 50 bodies at 300 Hz: packets cut, decoded, every body through a filter of its own and converted to
// odometry.
void bench_bodies() {
  constexpr std::size_t kBodies = 50;
  constexpr double kRate_hz = 300.0;
  constexpr int kFrames = 9000;
  std::vector<std::unique_ptr<PoseFilter>> filters;
  for (std::size_t i = 0; i < kBodies; ++i)
    filters.push_back(std::make_unique<PoseFilter>(test::nominal_config(), test::nominal_vehicle()));
  qtm::PacketParser parser;
  qtm::Frame frame;
  std::vector<double> ms;
  double checksum = 0.0;
  std::vector<std::string> packets;
  for (int k = 0; k < kFrames; ++k) {
    const auto us = static_cast<std::uint64_t>(1e6 * k / kRate_hz);
    packets.push_back(qtm::encode_frame(qtm::test::frame_of(kBodies, static_cast<std::uint32_t>(k), us),
                                        qtm::kComponent6dRes));
  }
  const double cpu_begin = cpu_s();
  for (const std::string& bytes : packets) {
    const double begin = steady_seconds();
    parser.add(bytes.data(), bytes.size());
    if (!qtm::decode_frame(parser.next()->body, frame)) std::abort();
    for (std::size_t i = 0; i < kBodies; ++i) {
      filters[i]->take_frame(
          qtm::to_pose_frame(frame.bodies[i], test::kStart + 1e-6 * static_cast<double>(frame.timestamp_us)));
      checksum += to_odometry(filters[i]->estimate()).pose_covariance.trace();
    }
    ms.push_back(1e3 * (steady_seconds() - begin));
  }
  const double share = (cpu_s() - cpu_begin) * kRate_hz / kFrames;
  std::fprintf(stderr, "bench_mocap: %zu bodies, checksum %g\n", kBodies, checksum);
  print_row("mocap/qtm_50_bodies/frame", "ms", ms);
  print_row("mocap/qtm_50_bodies_300hz/core_share", "1", share);
}

}  // namespace

int main() {
  bench_filter();
  bench_bodies();
  return 0;
}
