#include "atmos_stl_planner/checker.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "atmos_stl_planner/bernstein.h"
#include "brute_force.h"
#include "formulas.h"
#include "motions.h"

namespace atmos::stl {
namespace {

const Vocabulary kOne{{"R"}, {"A"}, 0};

std::vector<Region> unit_box() {
  Region region;
  region.name = "A";
  region.polytope = box({-1, -1}, {1, 1});
  return {region};
}

double value(const std::string& text, const Motion& motion) {
  return Checker(unit_box(), motion).robustness(parse_formula(text, kOne));
}

// x = t - 2 on [0, 10], y = 0: inside from 1 to 3 s, at the centre at 2 s.
Motion through() { return polyline({0.0, 10.0}, {{{-2.0, 0.0}}, {{8.0, 0.0}}}); }

TEST(Checker, KnownRobustness) {
  EXPECT_NEAR(value("F[0,10] in(A)", through()), 1.0, 1e-7);
  EXPECT_NEAR(value("F[0,1.5] in(A)", through()), 0.5, 1e-7);
  EXPECT_NEAR(value("F[4,10] in(A)", through()), -1.0, 1e-7);
  EXPECT_NEAR(value("G[1.5,2.75] in(A)", through()), 0.25, 1e-7);
  EXPECT_NEAR(value("G[0,10] not in(A)", through()), -1.0, 1e-7);
  EXPECT_NEAR(value("G[3.5,10] not in(A)", through()), 0.5, 1e-7);
  EXPECT_NEAR(value("x <= 3 U[4,6] x >= 2.5", through()), 0.25, 1e-7);  // at 4.75 s both hold by 0.25
  EXPECT_NEAR(value("F[0,4] G[0,1] in(A)", through()), 0.5, 1e-7);
  EXPECT_NEAR(value("not (x <= 3 U[4,6] x >= 2.5)", through()), -0.25, 1e-7);
  EXPECT_NEAR(value("x + 2 * y >= 1", through()), -3.0, 1e-7);
}

TEST(Checker, TruthIsASetOfTimes) {
  const Checker checker(unit_box(), through());
  const IntervalSet set = checker.truth(*parse_formula("in(A)", kOne), 0.25);
  ASSERT_EQ(set.parts().size(), 1u);
  EXPECT_NEAR(set.parts()[0].from, 1.25, 1e-12);
  EXPECT_NEAR(set.parts()[0].to, 2.75, 1e-12);
  EXPECT_NEAR(checker.critical_time(parse_formula("F[0,10] in(A)", kOne)), 2.0, 1e-5);
  EXPECT_NEAR(checker.critical_time(parse_formula("G[1.5,2.75] in(A)", kOne)), 2.75, 1e-5);
}

// A touch between two samples is seen: an instant inside a curve that is otherwise outside.
TEST(Checker, MissesNoTouch) {
  Segment segment;
  segment.time = Eigen::Vector2d(0.0, 10.0);
  Eigen::Matrix2Xd r(2, 3);
  r << -4, 0, 4, 3, -1.0, 3;  // y = 3 - 8 s + 8 s^2, least 1 at s = 1/2
  segment.position = {r};
  EXPECT_NEAR(value("F[0,10] in(A)", Motion({segment})), 0.0, 1e-7);
  EXPECT_NEAR(value("G[0,10] not in(A)", Motion({segment})), 0.0, 1e-7);
}

TEST(Bernstein, SetsBoundsAndInverse) {
  Eigen::VectorXd c(4);
  c << 1, -2, 3, -1;
  const IntervalSet set = bernstein::nonnegative(c);
  for (int i = 0; i <= 1000; ++i) {
    const double s = i / 1000.0;
    EXPECT_EQ(set.contains(s), bernstein::value(c, s) >= 0.0) << s;
  }
  double least = 1.0;
  for (int i = 0; i <= 100000; ++i) least = std::min(least, bernstein::value(c, i / 100000.0));
  EXPECT_LE(bernstein::lower_bound(c, 1e-9), least + 1e-9);
  EXPECT_GE(bernstein::lower_bound(c, 1e-9), least - 1e-8);
  const Eigen::Vector4d h(0, 0.2, 2.5, 3);
  EXPECT_NEAR(bernstein::value(h, bernstein::inverse(h, 1.7)), 1.7, 1e-12);
  EXPECT_NEAR(bernstein::value(bernstein::product(c, h), 0.3),
              bernstein::value(c, 0.3) * bernstein::value(h, 0.3), 1e-12);
}

// Both directions: sampling can only miss what happens between samples, and that is bounded by the speed.
void agree(bool free_time) {
  const int horizon_s = 8;
  const double step_s = 0.01;
  const FormulaPtr formula = random_formula(2, 3, 3, horizon_s, 0.5);
  const std::vector<Region> regions = random_regions(horizon_s);
  const Motion motion = random_motion(2, horizon_s, free_time);
  const double exact = Checker(regions, motion).robustness(formula);
  const double sampled = BruteForce(regions, motion, step_s).robustness(*formula);
  const double region_speed = 12.0 / (0.3 * horizon_s);
  const double tolerance = BruteForce::slope(top_speed(motion) + region_speed) * step_s + 1e-6;
  if (std::isfinite(exact) || std::isfinite(sampled)) RC_ASSERT(std::abs(exact - sampled) <= tolerance);
}

RC_GTEST_PROP(Checker, AgreesWithTheDefinition, ()) { agree(false); }
RC_GTEST_PROP(Checker, AgreesWithTheDefinitionInFreeTime, ()) { agree(true); }

const char* const kSpec = R"(
name: test
horizon_s: 10
workspace: {min_m: [-3, -3], max_m: [3, 3]}
regions: [{name: A, center_m: [0, 0], size_m: [1, 1]}]
robots:
  - name: R
    start: {x_m: -1, y_m: 0}
    end: {x_m: 1, y_m: 0}
    radius_m: 0.2
    max_velocity_m_s: 0.4
    max_acceleration_m_s2: 0.13
    formulas:
      - F[0,10] in(A)
)";

Motion rest_to_rest() {
  Segment segment;
  segment.time = Eigen::Vector2d(0.0, 10.0);
  Eigen::Matrix2Xd r(2, 4);
  r << -1, -1, 1, 1, 0, 0, 0, 0;
  segment.position = {r};
  return Motion({segment});
}

TEST(Certify, AcceptsAPlanAndMeasuresIt) {
  const Certificate certificate = certify(parse_specification(kSpec, "test"), rest_to_rest());
  ASSERT_TRUE(certificate.valid()) << certificate.faults[0];
  EXPECT_NEAR(certificate.robustness_m, 0.5, 1e-6);
  EXPECT_NEAR(certificate.clauses[0].time_s, 5.0, 1e-2);
  EXPECT_NEAR(certificate.peak_velocity_share, 0.3 / 0.4, 1e-6);        // 1.5 * 2 m / 10 s
  EXPECT_NEAR(certificate.peak_acceleration_share, 0.12 / 0.13, 1e-6);  // 6 * 2 m / (10 s)^2
  EXPECT_GT(certificate.clauses[0].lateness_s, 5.0);
}

TEST(Certify, EveryFaultIsSeen) {
  const std::string good = kSpec;
  const auto faults = [&](const std::string& from, const std::string& to, const Motion& motion) {
    std::string text = good;
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos);
    text.replace(at, from.size(), to);
    return certify(parse_specification(text, "test"), motion).faults;
  };
  const Motion plan = rest_to_rest();
  EXPECT_EQ(faults("max_velocity_m_s: 0.4", "max_velocity_m_s: 0.299", plan).size(), 1u);
  EXPECT_EQ(faults("max_acceleration_m_s2: 0.13", "max_acceleration_m_s2: 0.119", plan).size(), 1u);
  EXPECT_EQ(faults("x_m: -1", "x_m: -1.001", plan).size(), 1u);
  EXPECT_EQ(faults("x_m: 1,", "x_m: 1.001,", plan).size(), 1u);
  EXPECT_EQ(faults("F[0,10]", "F[0,2]", plan).size(), 1u);
  EXPECT_EQ(faults("F[0,10]", "G[4,10]", plan).size(), 1u);
  EXPECT_EQ(
      faults("regions:", "obstacles: [{name: O, center_m: [0, 0.8], size_m: [0.2, 1.19]}]\nregions:", plan)
          .size(),
      0u);
  EXPECT_EQ(
      faults("regions:", "obstacles: [{name: O, center_m: [0, 0.8], size_m: [0.2, 1.21]}]\nregions:", plan)
          .size(),
      1u);

  Segment out = plan.segments()[0];
  out.position[0](1, 1) = 9.0;
  EXPECT_GE(faults("name: test", "name: test", Motion({out})).size(), 2u);  // workspace, limits
  Segment moving = plan.segments()[0];
  moving.position[0](0, 2) = 0.9;
  EXPECT_EQ(faults("name: test", "name: test", Motion({moving})).size(), 1u);
  const Motion cut = plan.cut_at({4.0});
  EXPECT_EQ(faults("name: test", "name: test", cut).size(), 0u);
  std::vector<Segment> jump = cut.segments();
  jump[1].position[0](0, 0) += 1e-4;
  EXPECT_GE(faults("name: test", "name: test", Motion(jump)).size(), 1u);
  Segment nan = plan.segments()[0];
  nan.position[0](0, 1) = std::nan("");
  EXPECT_EQ(faults("name: test", "name: test", Motion({nan})).size(), 1u);
  Segment still = plan.segments()[0];
  still.time = Eigen::Vector4d(0, 12, -2, 10);
  EXPECT_EQ(faults("name: test", "name: test", Motion({still})).size(), 1u);
}

TEST(Certify, RobotsKeepApart) {
  const std::string text = R"(
name: test
horizon_s: 10
workspace: {min_m: [-3, -3], max_m: [3, 3]}
robots:
  - {name: R1, start: {x_m: -1, y_m: 0}, radius_m: 0.2, max_velocity_m_s: 1, max_acceleration_m_s2: 1}
  - {name: R2, start: {x_m: -1, y_m: 0.5}, radius_m: 0.2, max_velocity_m_s: 1, max_acceleration_m_s2: 1}
)";
  const Specification spec = parse_specification(text, "test");
  Segment segment = rest_to_rest().segments()[0];
  segment.position.push_back(segment.position[0]);
  segment.position[1].row(1).setConstant(0.5);
  const Certificate apart = certify(spec, Motion({segment}));
  EXPECT_TRUE(apart.valid());
  EXPECT_NEAR(apart.separation_m, 0.1, 1e-6);
  segment.position[1].row(1) << 0.5, 0.5, 0.2, 0.2;
  EXPECT_FALSE(certify(spec, Motion({segment})).valid());
}

}  // namespace
}  // namespace atmos::stl
