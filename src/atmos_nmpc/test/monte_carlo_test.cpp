// Random starts and disturbances up to the thrusters' authority: every run recovers or says why it could not.
// ATMOS_LONG_TESTS=1: 1000 runs instead of 20.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

#include "atmos_nmpc/config.h"
#include "closed_loop.h"

namespace atmos {
namespace {

using testing::kDegree;
using testing::kLabNoise;
using testing::kStart;
using testing::stopped_clock;

constexpr int kPeriods = 300;

int runs() { return std::getenv("ATMOS_LONG_TESTS") != nullptr ? 1000 : 20; }

class MonteCarlo : public ::testing::TestWithParam<std::string> {
 protected:
  const Vehicle vehicle_ = load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml");
  const ControllerConfig config_ =
      load_controller(ATMOS_CONFIG_DIR "/controller/" + GetParam() + ".yaml", vehicle_);
  const double authority_n_ = Allocator(vehicle_).max_wrench()[0];
};

struct Draw {
  PlanarState<double> start;
  std::vector<Effect> effects;
  double force_n;     // of what pushes all the time
  double dropout;     // share of the frames that are lost
  double blackout_s;  // one stretch without frames, from 5 s on
};

Draw draw(std::mt19937& random, double authority_n) {
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  const auto within = [&](double limit) { return limit * (2.0 * unit(random) - 1.0); };
  Draw result;
  result.start.p_WC << within(1.5), within(1.5);
  result.start.yaw = within(M_PI);
  result.start.v_WC << within(0.3), within(0.3);
  result.start.yaw_rate = within(0.5);
  result.force_n = authority_n * unit(random) * unit(random);
  const double direction = within(M_PI);
  Airflow push;
  push.force_x_n = {{result.force_n * std::cos(direction)}};
  push.force_y_n = {{result.force_n * std::sin(direction)}};
  SupplyCoupling coupling;
  coupling.fraction_per_open_thruster = 0.125 * unit(random);
  MassError mass;
  mass.factor = 1.0 + within(0.1);
  ExternalImpulse hit;
  hit.events = {{kStart + 5.0, Eigen::Vector2d(within(1.5), within(1.5)), within(0.05)}};
  result.effects = {push, coupling, mass, hit};
  result.dropout = unit(random) < 0.3 ? 0.2 * unit(random) : 0.0;
  result.blackout_s = unit(random) < 0.2 ? 1.5 * unit(random) : 0.0;
  return result;
}

TEST_P(MonteCarlo, EveryRunRecoversOrSaysWhyItCouldNot) {
  int recovered = 0, explained = 0;
  for (int run = 0; run < runs(); ++run) {
    SCOPED_TRACE("seed " + std::to_string(run));
    std::mt19937 random(static_cast<std::uint32_t>(run));
    const Draw drawn = draw(random, authority_n_);
    Controller controller(vehicle_, config_, true, stopped_clock);
    controller.add_goal(testing::planar_goal(kStart, 0.0, 0.0, 0.0));
    testing::Flight flight(vehicle_, controller, kStart, drawn.start, kLabNoise,
                           static_cast<std::uint32_t>(run), drawn.effects);
    std::bernoulli_distribution lost(drawn.dropout);
    int saturated = 0, closed = 0;
    Eigen::Vector3d most = Eigen::Vector3d::Zero();  // |p|, |v|, |w|, per component
    const auto is_back = [&flight] {
      const PlanarState<double> now = flight.truth();
      return now.p_WC.norm() < 0.05 && std::abs(wrap_angle(now.yaw)) < 5.0 * kDegree;
    };
    // Against a push that leaves the thrusters little, the way back takes longer.
    int periods = kPeriods;
    for (int k = 0; k < periods; ++k) {
      if (k == kPeriods - 1 && !is_back()) periods = 2 * kPeriods;
      const bool blackout = k >= 50 && k < 50 + static_cast<int>(10.0 * drawn.blackout_s);
      const testing::FlightRow row = flight.period(k == 0 || !(blackout || lost(random)));
      const ControlDecision& decision = row.decision;
      for (const double duty : decision.command.duty)
        ASSERT_TRUE(duty >= 0.0 && duty <= 1.0) << "period " << k << ": " << duty;
      ASSERT_TRUE(row.truth.p_WC.allFinite() && std::isfinite(row.truth.yaw_rate)) << k;
      most =
          most.cwiseMax(Eigen::Vector3d(row.truth.p_WC.cwiseAbs().maxCoeff(),
                                        row.truth.v_WC.cwiseAbs().maxCoeff(), std::abs(row.truth.yaw_rate)));
      for (const State13<double>& x : decision.path) ASSERT_TRUE(x.allFinite()) << k;
      if (decision.wrench.norm() > 0.0) {
        ASSERT_LE(decision.wrench.head<2>().cwiseAbs().maxCoeff(), config_.force_n + 1e-6) << k;
        ASSERT_LE(std::abs(decision.wrench[2]), config_.torque_n_m + 1e-6) << k;
      }
      // No fallback is missed: without a solution there is a plan, braking, or closed valves; without
      // odometry closed valves.
      if (decision.odometry == OdometryState::kLost) {
        ASSERT_EQ(decision.mode, ControlMode::kClosed) << k;
      }
      if (decision.mode == ControlMode::kSolved) {
        ASSERT_TRUE(is_success(decision.solve.status)) << k;
      } else {
        ASSERT_TRUE(!is_success(decision.solve.status) || decision.odometry == OdometryState::kLost) << k;
      }
      if (decision.mode == ControlMode::kClosed || decision.mode == ControlMode::kWaiting) {
        for (const double duty : decision.command.duty) ASSERT_EQ(duty, 0.0) << k;
        ++closed;
      }
      if (k >= periods - 50 && decision.active.inputs > 0) ++saturated;
    }
    const PlanarState<double> end = flight.truth();
    const bool back = is_back();
    const bool says_why = saturated > 25 || closed > 0;
    EXPECT_TRUE(back || says_why) << "push " << drawn.force_n << " N, end " << end.p_WC.transpose() << ", "
                                  << end.yaw << ", closed " << closed;
    // The soft bounds; beyond them only what the hit adds (1.5 N s, 0.05 N m s), or what pushes the robot
    // away.
    if (back) {
      const double slack = 0.02;
      EXPECT_LT(most[0], config_.bounds.position[0] + slack);
      EXPECT_LT(most[1], config_.bounds.velocity[0] + slack + 1.5 / (0.9 * vehicle_.mass_kg));
      // With all thrusters open coupling takes so much torque that the filter refuses poses until it starts
      // anew; meanwhile the rate runs on.
      constexpr double kUntilAnew = 0.06;
      EXPECT_LT(most[2], config_.bounds.rate[2] + slack + kUntilAnew + 0.05 / vehicle_.inertia_kg_m2.z());
    }
    // What is well within the bounds is always recovered from.
    if (drawn.force_n < 0.6 && drawn.blackout_s == 0.0) {
      EXPECT_TRUE(back) << "push " << drawn.force_n << " N, end " << end.p_WC.transpose() << ", " << end.yaw;
      EXPECT_LT(end.v_WC.norm(), 0.05);
    }
    recovered += back ? 1 : 0;
    explained += !back && says_why ? 1 : 0;
  }
  std::printf("%s: %d runs, %d recovered, %d said why not\n", GetParam().c_str(), runs(), recovered,
              explained);
  EXPECT_EQ(recovered + explained, runs());
}

INSTANTIATE_TEST_SUITE_P(Controllers, MonteCarlo,
                         ::testing::Values("offset_free_direct_allocation", "offset_free_wrench"));

}  // namespace
}  // namespace atmos
