// Solve time of the direct-allocation NMPC in closed loop: 80 s, 800 solves, four set-points, seeded
// measurement noise (1 mm, 2 mm/s, 1 mrad, 2 mrad/s). Thread CPU time of a whole solve: warm start, Ipopt,
// solution taken over.
#include <time.h>

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "atmos_nmpc/config.h"
#include "closed_loop.h"

namespace {

double thread_cpu_seconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

void bench(int stages) {
  using namespace atmos;
  const std::string folder = ATMOS_CONFIG_DIR;
  const Vehicle vehicle = load_vehicle(folder + "/vehicle/atmos.yaml");
  ControllerConfig config = load_controller(folder + "/controller/direct_allocation.yaml", vehicle);
  config.stages = stages;
  Controller controller(vehicle, config, true, thread_cpu_seconds);

  constexpr double kStart = 1000.0, kHold = 20.0;
  const double poses[4][3] = {{1, 0, 0}, {1, 1, 0}, {1, 1, M_PI / 4}, {0, 0, 0}};
  for (int i = 0; i < 4; ++i)
    controller.add_goal(testing::planar_goal(kStart + i * kHold, poses[i][0], poses[i][1], poses[i][2]));
  testing::Flight flight(vehicle, controller, kStart, {}, {1e-3, 2e-3, 1e-3, 2e-3}, 1);

  std::vector<double> ms;
  int iterations = 0, most = 0, failures = 0;
  for (int k = 0; k < 800; ++k) {
    const testing::FlightRow row = flight.period();
    ms.push_back(1e3 * row.decision.solve.solve_time_s);
    iterations += row.decision.solve.iterations;
    most = std::max(most, row.decision.solve.iterations);
    failures += is_success(row.decision.solve.status) ? 0 : 1;
  }
  std::sort(ms.begin(), ms.end());
  std::printf(
      "{\"name\": \"nmpc/direct/N%d/solve\", \"unit\": \"ms\", \"median\": %.4f, \"p99\": %.4f, \"max\": "
      "%.4f, \"n\": %zu}\n",
      stages, ms[ms.size() / 2], ms[ms.size() * 99 / 100], ms.back(), ms.size());
  std::fprintf(stderr, "N=%d: iterations mean %.2f, most %d; failures %d\n", stages,
               iterations / static_cast<double>(ms.size()), most, failures);
}

}  // namespace

int main() {
  bench(20);
  bench(50);
}
