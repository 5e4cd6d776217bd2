// Two robots that are sent through each other, with nobody planning: NMPC, distance monitor and ODE simulator
// without nodes in between. ATMOS_LONG_TESTS=1: 100 runs instead of 6.
#include "atmos_operator/distance_monitor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <random>
#include <vector>

#include "atmos_model/scenario.h"
#include "atmos_nmpc/config.h"
#include "atmos_nmpc/controller.h"
#include "atmos_sim/simulation.h"
#include "closed_loop.h"

namespace atmos {
namespace {

using testing::kLabNoise;
using testing::kStart;
using testing::stopped_clock;

constexpr double kDuration_s = 22.0;

int runs() { return std::getenv("ATMOS_LONG_TESTS") != nullptr ? 100 : 6; }

struct Outcome {
  double least_m = std::numeric_limits<double>::infinity();  // between the bodies
  double rest_speed_m_s = 0.0;                               // faster robot, at the end
  bool stopped = false;
};

// Where a robot starts, where to, and when it is sent.
struct Crossing {
  Eigen::Vector2d start_m, goal_m;
  double yaw, delay_s;
};

// Straight ways through one point, which both reach at about the same time.
std::vector<Crossing> crossing(std::mt19937& random) {
  std::uniform_real_distribution<double> turn(0.0, 2.0 * M_PI), between(M_PI / 6.0, 11.0 * M_PI / 6.0),
      half(1.0, 1.5), delay(0.0, 1.0);
  std::vector<Crossing> ways;
  const double first = turn(random), second = first + between(random);
  for (const double angle : {first, second}) {
    const Eigen::Vector2d along(std::cos(angle), std::sin(angle));
    const double length = half(random);
    ways.push_back({-length * along, length * along, turn(random), delay(random)});
  }
  return ways;
}

class TwoRobots {
 public:
  TwoRobots(std::uint32_t seed, bool monitored) : random_(seed), monitored_(monitored) {
    fleet_ = load_fleet(ATMOS_CONFIG_DIR "/scenario/two_robots.yaml");
    ways_ = crossing(random_);
    for (std::size_t i = 0; i < fleet_.size(); ++i) {
      fleet_[i].world = {};
      fleet_[i].start = {0.0, ways_[i].start_m.x(), ways_[i].start_m.y(), ways_[i].yaw};
      const Vehicle& vehicle = fleet_[i].vehicle;
      control_.push_back(std::make_unique<Controller>(
          vehicle, load_controller(fleet_[i].controller_path, vehicle), true, stopped_clock));
      control_[i]->add_goal(
          testing::planar_goal(kStart, ways_[i].start_m.x(), ways_[i].start_m.y(), ways_[i].yaw));
      control_[i]->add_goal(testing::planar_goal(kStart + ways_[i].delay_s, ways_[i].goal_m.x(),
                                                 ways_[i].goal_m.y(), ways_[i].yaw));
      watched_.push_back({fleet_[i].robot, braking_ability(vehicle)});
    }
  }

  Outcome fly() {
    Simulation sim(fleet_, kStart);
    DistanceMonitor monitor(watched_, {});
    Outcome outcome;
    const double period_s = control_.front()->period_s();
    for (int k = 0; k < std::lround(kDuration_s / period_s); ++k) {
      const double now = kStart + k * period_s;
      std::vector<PlanarState<double>> seen;
      for (std::size_t i = 0; i < sim.size(); ++i) {
        seen.push_back(measured(sim.robot(i).truth()));
        sim.robot(i).command(
            control_[i]->on_odometry({now, testing::state13_of(seen[i]), true}, now)->command);
        control_[i]->prepare();
      }
      // What the monitor says reaches the controllers a period later.
      for (std::size_t i = 0; monitored_ && i < sim.size(); ++i) {
        for (const std::size_t stopped :
             monitor.see(i, {now, seen[i].p_WC, seen[i].v_WC, seen[i].yaw, seen[i].yaw_rate}))
          control_[stopped]->add_trajectory(reference(monitor.path(stopped)));
        outcome.stopped = outcome.stopped || monitor.held(i);
      }
      for (int step = 1; step <= 10; ++step) {
        sim.advance_to(now + 0.1 * step * period_s);
        outcome.least_m = std::min(outcome.least_m, body_distance(sim));
      }
    }
    for (std::size_t i = 0; i < sim.size(); ++i)
      outcome.rest_speed_m_s = std::max(outcome.rest_speed_m_s, sim.robot(i).truth().v_WC.norm());
    return outcome;
  }

 private:
  PlanarState<double> measured(PlanarState<double> state) {
    std::normal_distribution<double> normal;
    state.p_WC += kLabNoise.position_m * Eigen::Vector2d(normal(random_), normal(random_));
    state.v_WC += kLabNoise.velocity_m_s * Eigen::Vector2d(normal(random_), normal(random_));
    state.yaw += kLabNoise.yaw_rad * normal(random_);
    state.yaw_rate += kLabNoise.rate_rad_s * normal(random_);
    return state;
  }

  static double body_distance(const Simulation& sim) {
    return (sim.robot(0).truth().p_WC - sim.robot(1).truth().p_WC).norm() - sim.robot(0).vehicle().radius_m -
           sim.robot(1).vehicle().radius_m;
  }

  static std::vector<TrajectoryPoint> reference(const BrakingPath& path) {
    std::vector<TrajectoryPoint> points;
    for (const BrakingPoint& from : path.points_from(path.start_s())) {
      points.push_back({from.time_s,
                        {from.p_W.x(), from.p_W.y(), 0.0},
                        {std::cos(0.5 * from.yaw), 0.0, 0.0, std::sin(0.5 * from.yaw)},
                        {from.v_W.x(), from.v_W.y(), 0.0},
                        {0.0, 0.0, from.yaw_rate},
                        {from.a_W.x(), from.a_W.y(), 0.0}});
    }
    return points;
  }

  std::mt19937 random_;
  bool monitored_;
  std::vector<Scenario> fleet_;
  std::vector<Crossing> ways_;
  std::vector<std::unique_ptr<Controller>> control_;
  std::vector<DistanceMonitor::Robot> watched_;
};

TEST(DistanceMonitorInFlight, KeepsCrossingRobotsApart) {
  int touched_without = 0, apart = 0;
  double least_m = std::numeric_limits<double>::infinity();
  for (int seed = 1; seed <= runs(); ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    touched_without += TwoRobots(static_cast<std::uint32_t>(seed), false).fly().least_m <= 1e-3;
    const Outcome outcome = TwoRobots(static_cast<std::uint32_t>(seed), true).fly();
    EXPECT_GT(outcome.least_m, 0.02);
    EXPECT_LT(outcome.rest_speed_m_s, 0.02) << "both rest at the end";
    apart += outcome.least_m > 0.0;
    least_m = std::min(least_m, outcome.least_m);
  }
  std::printf("kept apart in %d of %d runs, least distance %.3f m; without the monitor %d of them touch\n",
              apart, runs(), least_m, touched_without);
  EXPECT_GE(touched_without, runs() / 2) << "the ways hardly cross: nothing was shown";
}

}  // namespace
}  // namespace atmos
