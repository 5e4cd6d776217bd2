// From measurement to command nothing is allocated, where a prepared solution answers. This program counts
// every way to the heap; libraries come through here too.
#include <gtest/gtest.h>

#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <string>

#include "atmos_nmpc/config.h"
#include "closed_loop.h"

extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* block, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
}

namespace {
thread_local long allocations = 0;
}

extern "C" {
void* malloc(std::size_t size) {
  ++allocations;
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  ++allocations;
  return __libc_calloc(count, size);
}
void* realloc(void* block, std::size_t size) {
  ++allocations;
  return __libc_realloc(block, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  ++allocations;
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** block, std::size_t alignment, std::size_t size) {
  ++allocations;
  *block = __libc_memalign(alignment, size);
  return *block == nullptr ? ENOMEM : 0;
}
}

namespace atmos {
namespace {

constexpr double kStart = 1234.5;

class NoAllocation : public ::testing::TestWithParam<std::string> {};

TEST_P(NoAllocation, FromMeasurementToCommand) {
  const Vehicle vehicle = load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml");
  const ControllerConfig config =
      load_controller(std::string(ATMOS_CONFIG_DIR) + "/controller/" + GetParam() + ".yaml", vehicle);
  Controller controller(vehicle, config, false, [] { return 0.0; });
  controller.add_goal(testing::planar_goal(kStart, 1.0, -0.5, 0.7));
  testing::Flight robot(vehicle, controller, kStart, {}, {3e-4, 2e-3, 1e-3, 2e-3}, 4);
  int answered = 0;
  for (int k = 0; k < 100; ++k) {
    const OdometrySample sample = robot.measure();
    const long before = allocations;
    const ControlDecision* decision = controller.on_odometry(sample, robot.now());
    const long during = allocations - before;
    ASSERT_TRUE(decision);
    if (decision->feedback) {
      ++answered;
      EXPECT_EQ(during, 0) << "period " << k;
    } else {
      EXPECT_GT(during, 0) << "the count does not count";  // a solve allocates, Ipopt does
    }
    robot.carry_out(*decision);
  }
  EXPECT_GE(answered, 90);
}
INSTANTIATE_TEST_SUITE_P(Formulations, NoAllocation,
                         ::testing::Values("direct_allocation", "wrench", "offset_free_direct_allocation",
                                           "offset_free_wrench"));

}  // namespace
}  // namespace atmos
