#include "atmos_stl_planner/planner.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cstdio>

namespace atmos::stl {
namespace {

const std::string kFolder = ATMOS_CONFIG_DIR "/stl/";

double seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

Plan plan_of(const Specification& spec, const Past* past = nullptr) {
  const auto solver = make_cbc();
  const Plan plan = Planner(spec, *solver, seconds).plan(past);
  std::fprintf(stderr, "%s: status %d, robustness %.4f of %.4f m, first after %.3f s, total %.3f s, %s\n",
               spec.name.c_str(), static_cast<int>(plan.status), plan.certificate.robustness_m, plan.bound_m,
               plan.first_plan_s, plan.total_s, plan.method.c_str());
  return plan;
}

TEST(Planner, ThePapersScenariosReachTheBoundOfGeometry) {
  for (const char* name : {"single.yaml", "two_robots.yaml"}) {
    SCOPED_TRACE(name);
    const Specification spec = load_specification(kFolder + name);
    const Plan plan = plan_of(spec);
    ASSERT_EQ(plan.status, PlanStatus::kPlanned);
    EXPECT_NEAR(plan.certificate.robustness_m, 0.25, 1e-6);
    EXPECT_NEAR(plan.bound_m, 0.25, 1e-9);
    EXPECT_LE(plan.certificate.peak_acceleration_share, 1.0 + 1e-6);
    EXPECT_LE(plan.certificate.peak_velocity_share, 1.0 + 1e-6);
    EXPECT_GE(plan.certificate.separation_m, -1e-6);
  }
}

}  // namespace
}  // namespace atmos::stl
