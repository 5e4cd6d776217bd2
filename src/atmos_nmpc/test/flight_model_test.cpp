// What the diagnosis found, in the controller: effects known to it, and thrusters that are dead.
#include "atmos_nmpc/flight_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "atmos_model/allocator.h"
#include "atmos_nmpc/config.h"
#include "closed_loop.h"
#include "curves.h"

namespace atmos {
namespace {

using testing::kDegree;
using testing::kLabNoise;
using testing::kStart;
using testing::stopped_clock;

class KnownEffects : public ::testing::Test {
 protected:
  ControllerConfig config(const std::string& name, const std::vector<Effect>& model) const {
    ControllerConfig config = load_controller(ATMOS_CONFIG_DIR "/controller/" + name + ".yaml", vehicle_);
    config.model = model;
    return config;
  }
  const Vehicle vehicle_ = load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml");
};

std::vector<Effect> dead(const std::vector<int>& thrusters) {
  std::vector<Effect> effects;
  for (const int number : thrusters) {
    ThrusterDead effect;
    effect.thruster = number;
    effects.push_back(effect);
  }
  return effects;
}

TEST_F(KnownEffects, DutiesGiveTheMeanForceAskedForUnderCoupling) {
  SupplyCoupling coupling;
  coupling.fraction_per_open_thruster = 0.125;
  const FlightModel model(vehicle_, {coupling});
  EXPECT_NEAR(model.vehicle().thrusters[0].force_n, 1.7 * 0.875, 1e-12);
  const std::vector<double> wanted = {0.6, 0.0, 0.3, 0.0, 0.0, 0.2, 0.0, 0.0};
  std::vector<double> duty = wanted;
  model.compensate(kStart, duty);
  const Plant plant(vehicle_, {coupling}, kStart);
  VecX<double> mean = VecX<double>::Zero(8);
  for (double t = 0.5e-4; t < 1.0; t += 1e-4) {
    VecX<double> openings(8);
    for (int i = 0; i < 8; ++i) openings[i] = duty[static_cast<std::size_t>(i)] > t ? 1.0 : 0.0;
    mean += 1e-4 * plant.thrust<double>(kStart, {}, plant.initial_hidden(), openings);
  }
  for (int i = 0; i < 8; ++i)
    EXPECT_NEAR(mean[i], wanted[static_cast<std::size_t>(i)] * 1.7 * 0.875, 1e-3) << i;
}

// While thrust rises and falls less is taken from the supply than by valves that are all open.
TEST_F(KnownEffects, DutiesGiveTheImpulseAskedForUnderCouplingWhileThrustRises) {
  SupplyCoupling coupling;
  coupling.fraction_per_open_thruster = 0.125;
  ThrustRise rise;
  rise.time_constant_s = 0.01;
  const std::vector<Effect> effects = {rise, coupling};
  const FlightModel model(vehicle_, effects);
  std::vector<double> duty = {0.3, 0.0, 0.15, 0.0, 0.0, 0.1, 0.0, 0.0};
  const double wanted_n_s = 0.1 * 1.7 * 0.875 * 0.3;  // of thruster 1
  model.compensate(kStart, duty);
  const Plant plant(vehicle_, effects, kStart);
  ValveSchedule valves(8, plant.properties().timing);
  valves.add({kStart, 0.1, duty});
  PlantState state{kStart, {}, plant.initial_hidden()};
  advance(plant, valves, kStart + 0.3, state, 1e-3);
  const Eigen::Vector2d impulse = state.body.v_WC * plant.properties().mass_kg;
  const AllocationMatrices thrusters = thruster_matrices(vehicle_);
  Eigen::Vector2d expected = Eigen::Vector2d::Zero();
  expected += wanted_n_s * thrusters.D.col(0).head<2>();
  expected += 0.5 * wanted_n_s * thrusters.D.col(2).head<2>();
  expected += wanted_n_s / 3.0 * thrusters.D.col(5).head<2>();
  EXPECT_LT((impulse - expected).norm(), 0.01 * wanted_n_s);
}

TEST_F(KnownEffects, PlansTheCentreOfMassButBringsBaseLinkToTheReference) {
  ComOffset offset;
  offset.x_m = 0.02;
  offset.y_m = -0.01;
  MarkerOffset marker;
  marker.x_m = 0.03;
  YawMisalignment yaw;
  yaw.angle_rad = 0.05;
  const std::vector<Effect> effects = {offset, marker, yaw};
  Controller controller(vehicle_, config("direct_allocation", effects), true, stopped_clock);
  controller.add_goal(testing::planar_goal(kStart, 0.3, -0.2, 1.0));
  testing::Flight flight(vehicle_, controller, kStart, {}, {}, 1, effects);
  for (int k = 0; k < 200; ++k) flight.period();
  EXPECT_LT((flight.truth().p_WC - Eigen::Vector2d(0.3, -0.2)).norm(), 1e-3);
  EXPECT_NEAR(flight.truth().yaw, 1.0, 2e-3);
}

TEST_F(KnownEffects, HoldsATiltedFloorWithoutAnObserver) {
  SupplyCoupling coupling;
  coupling.fraction_per_open_thruster = 0.125;
  FloorTilt tilt;
  tilt.slope_x = 0.002;
  for (const bool known : {false, true}) {
    const std::vector<Effect> effects = {coupling, tilt};
    Controller controller(vehicle_, config("direct_allocation", known ? effects : std::vector<Effect>{}),
                          true, stopped_clock);
    controller.add_goal(testing::planar_goal(kStart, 0.0, 0.0, 0.5));
    testing::Flight flight(vehicle_, controller, kStart, {}, {}, 1, effects);
    for (int k = 0; k < 200; ++k) flight.period();
    if (known) {
      EXPECT_LT(flight.truth().p_WC.norm(), 0.003);
    } else {
      EXPECT_GT(flight.truth().p_WC.norm(), 0.03);
    }
  }
}

TEST_F(KnownEffects, TrackingErrorOfTheHarshScenarioFallsByThreeFifths) {
  const std::vector<Effect> effects = load_model(ATMOS_CONFIG_DIR "/model/harsh.yaml", vehicle_);
  double rms[2];
  for (const bool known : {false, true}) {
    Controller controller(vehicle_, config("direct_allocation", known ? effects : std::vector<Effect>{}),
                          true, stopped_clock);
    // The pushes of the scenario come at ROS time 1050 s.
    const double start = 1000.0;
    controller.add_goal(testing::planar_goal(start, 0.5, 0.0, 0.0));
    const auto circle = testing::circle(start + 10.0, 60.0, 0.5);
    controller.add_trajectory(circle);
    PlanarState<double> at;
    at.p_WC.x() = 0.5;
    testing::Flight flight(vehicle_, controller, start, at, {1e-3, 3e-3, 2e-3, 4e-3}, 2, effects);
    const testing::TrackingError error = testing::track(flight, circle, 700);
    rms[known] = error.position_rms_m;
    RecordProperty(known ? "rms_known_mm" : "rms_nominal_mm", std::to_string(1e3 * error.position_rms_m));
    std::printf("%s model: RMS %.1f mm, %.2f deg\n", known ? "true" : "nominal", 1e3 * error.position_rms_m,
                error.yaw_rms_rad / kDegree);
  }
  // With the push of the scenario, which nobody foresees.
  EXPECT_LT(rms[1], 0.4 * rms[0]);
}

// Each thruster alone; ATMOS_LONG_TESTS=1: each pair too.
TEST_F(KnownEffects, EverySetPointIsReachedWithDeadThrusters) {
  const bool pairs = std::getenv("ATMOS_LONG_TESTS") != nullptr;
  int controllable = 0;
  for (int a = 1; a <= 8; ++a) {
    for (int b = a; b <= (pairs ? 8 : a); ++b) {
      const std::vector<int> failed = a == b ? std::vector<int>{a} : std::vector<int>{a, b};
      try {
        Allocator(vehicle_, failed);
      } catch (const std::invalid_argument&) {
        EXPECT_THROW(Controller(vehicle_, config("direct_allocation", dead(failed)), true, stopped_clock),
                     std::invalid_argument);
        continue;
      }
      controllable += a == b ? 0 : 1;
      SCOPED_TRACE("dead: " + std::to_string(a) + ", " + std::to_string(b));
      Controller controller(vehicle_, config("direct_allocation", dead(failed)), true, stopped_clock);
      testing::Flight flight(vehicle_, controller, kStart, {}, kLabNoise, 5, dead(failed));
      const Eigen::Vector3d goals[] = {{1, 0, 0}, {1, 0, 45 * kDegree}, {1, 1, 90 * kDegree}, {0, 0, 0}};
      for (const Eigen::Vector3d& goal : goals) {
        controller.add_goal(testing::planar_goal(flight.now(), goal[0], goal[1], goal[2]));
        for (int k = 0; k < 200; ++k) {
          const testing::FlightRow row = flight.period();
          ASSERT_EQ(row.decision.mode, ControlMode::kSolved) << name_of(row.decision.solve.status);
          for (const int number : failed)
            ASSERT_EQ(row.decision.command.duty[static_cast<std::size_t>(number - 1)], 0.0);
        }
        EXPECT_LT((flight.truth().p_WC - goal.head<2>()).norm(), 0.02);
        EXPECT_NEAR(flight.truth().yaw, goal[2], 2.0 * kDegree);
      }
    }
  }
  EXPECT_EQ(controllable, pairs ? 16 : 0);
}

}  // namespace
}  // namespace atmos
