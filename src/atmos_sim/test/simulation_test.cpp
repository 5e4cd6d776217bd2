#include "atmos_sim/simulation.h"

#include <gtest/gtest.h>
#include <ode/ode.h>

#include <cmath>
#include <limits>
#include <random>
#include <thread>

#include "test_scenario.h"

namespace atmos {
namespace {

void command_all(Simulation& simulation, const std::vector<ThrusterCommand>& commands) {
  for (const ThrusterCommand& command : commands)
    ASSERT_EQ(simulation.robot().command(command), ValveSchedule::Taken::kInTime);
}

void expect_identical(const PlanarState<double>& a, const PlanarState<double>& b) {
  EXPECT_EQ(a.p_WC, b.p_WC);
  EXPECT_EQ(a.yaw, b.yaw);
  EXPECT_EQ(a.v_WC, b.v_WC);
  EXPECT_EQ(a.yaw_rate, b.yaw_rate);
}

TEST(Simulation, StartsAtRestAtTheStartPose) {
  Scenario scenario = test_scenario();
  scenario.start = {0.0, 1.5, -0.7, 2.0};
  Simulation simulation(scenario, kTestStart);
  simulation.advance_to(kTestStart + 3.0);
  EXPECT_EQ(simulation.robot().truth().p_WC, Vec2<double>(1.5, -0.7));
  EXPECT_EQ(simulation.robot().truth().yaw, 2.0);
  EXPECT_EQ(simulation.robot().truth().v_WC.norm(), 0.0);
  EXPECT_EQ(simulation.robot().truth().yaw_rate, 0.0);
}

TEST(Simulation, ConstantThrustFollowsTheClosedForm) {
  Simulation simulation(test_scenario(), kTestStart);
  command_all(simulation, repeated(open_thrusters(kTestStart, 1.0, {1, 3}), 20));
  const double a = 2.0 * 1.7 / 16.8;
  for (const double t : {0.0123, 0.5, 1.0, 2.0}) {
    simulation.advance_to(kTestStart + t);
    EXPECT_NEAR(simulation.robot().truth().p_WC.x(), 0.5 * a * t * t, 1e-10);
    EXPECT_NEAR(simulation.robot().truth().v_WC.x(), a * t, 1e-11);
    EXPECT_EQ(simulation.robot().truth().p_WC.y(), 0.0);
    EXPECT_EQ(simulation.robot().truth().yaw, 0.0);
  }
  // Then it coasts along a straight line.
  const PlanarState<double> released = simulation.robot().truth();
  simulation.advance_to(kTestStart + 12.0);
  EXPECT_NEAR(simulation.robot().truth().p_WC.x(), released.p_WC.x() + 10.0 * released.v_WC.x(), 1e-9);
  EXPECT_NEAR(simulation.robot().truth().v_WC.x(), released.v_WC.x(), 1e-12);
}

TEST(Simulation, ConstantTorqueFollowsTheClosedForm) {
  Simulation simulation(test_scenario(), kTestStart);
  // 2 and 3 form a pure couple of 2 * 1.7 N * 0.12 m.
  command_all(simulation, repeated(open_thrusters(kTestStart, 1.0, {2, 3}), 20));
  simulation.advance_to(kTestStart + 2.0);
  const double alpha = 2.0 * 1.7 * 0.12 / 0.297;
  EXPECT_NEAR(simulation.robot().truth().yaw, 0.5 * alpha * 4.0, 1e-9);
  EXPECT_NEAR(simulation.robot().truth().yaw_rate, alpha * 2.0, 1e-10);
  EXPECT_LT(simulation.robot().truth().p_WC.norm(), 1e-9);
}

// Work of the thrust against kinetic energy, and impulse against momentum, from the forces the plant itself
// reports.
TEST(Simulation, EnergyAndMomentumBalance) {
  Scenario scenario = test_scenario();
  scenario.duration_s = 10.0;
  Simulation simulation(scenario, kTestStart);
  command_all(simulation, random_commands(scenario, kTestStart, 7));
  const double m = 16.8, inertia = 0.297;
  double work = 0.0, angular_impulse = 0.0;
  Vec2<double> impulse = Vec2<double>::Zero();
  const double dt = 2e-4;  // finer than the valve edges need for the tolerance below
  for (int k = 1; k <= 50000; ++k) {
    const PlanarState<double> before = simulation.robot().center_of_mass();
    const VecX<double> openings = simulation.robot().openings();
    simulation.advance_to(kTestStart + k * dt);
    if (simulation.robot().openings() != openings) {
      // An edge inside: the balance over this slice is taken from the momenta, so that only smooth slices are
      // tested.
      const PlanarState<double>& after = simulation.robot().center_of_mass();
      impulse += m * (after.v_WC - before.v_WC);
      angular_impulse += inertia * (after.yaw_rate - before.yaw_rate);
      work += 0.5 * m * (after.v_WC.squaredNorm() - before.v_WC.squaredNorm()) +
              0.5 * inertia * (after.yaw_rate * after.yaw_rate - before.yaw_rate * before.yaw_rate);
      continue;
    }
    PlanarState<double> middle = before;
    middle.yaw = 0.5 * (before.yaw + simulation.robot().center_of_mass().yaw);
    const PlanarWrench<double> wrench = simulation.robot().plant().wrench<double>(
        kTestStart + (k - 0.5) * dt, middle, simulation.robot().hidden(), openings);
    impulse += dt * wrench.force_W;
    angular_impulse += dt * wrench.torque;
    work += wrench.force_W.dot(simulation.robot().center_of_mass().p_WC - before.p_WC) +
            wrench.torque * (simulation.robot().center_of_mass().yaw - before.yaw);
  }
  const PlanarState<double>& end = simulation.robot().center_of_mass();
  EXPECT_GT(end.v_WC.norm(), 0.05);
  EXPECT_LT((m * end.v_WC - impulse).norm(), 1e-6);
  EXPECT_NEAR(inertia * end.yaw_rate, angular_impulse, 1e-6);
  EXPECT_NEAR(0.5 * m * end.v_WC.squaredNorm() + 0.5 * inertia * end.yaw_rate * end.yaw_rate, work, 1e-6);
}

TEST(Simulation, ImpulseIsExactForDutiesThatAreNotOnTheStepGrid) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> any(0.0, 1.0);
  for (int i = 0; i < 50; ++i) {
    const double duty = i == 0 ? 1.23e-5 : any(random);
    Simulation simulation(test_scenario(), kTestStart);
    ASSERT_EQ(simulation.robot().command(open_thrusters(kTestStart, duty, {1, 3})),
              ValveSchedule::Taken::kInTime);
    simulation.advance_to(kTestStart + 0.2);
    EXPECT_NEAR(16.8 * simulation.robot().truth().v_WC.x(), 2.0 * 1.7 * 0.1 * duty, 1e-9) << "duty " << duty;
  }
}

TEST(Simulation, ALateCommandActsOnlyForTheRestOfItsPeriod) {
  Simulation simulation(test_scenario(), kTestStart);
  simulation.advance_to(kTestStart + 0.0234);
  EXPECT_EQ(simulation.robot().command(open_thrusters(kTestStart, 0.6, {1, 3})), ValveSchedule::Taken::kLate);
  simulation.advance_to(kTestStart + 0.5);
  EXPECT_NEAR(16.8 * simulation.robot().truth().v_WC.x(), 3.4 * (0.06 - 0.0234), 1e-9);
  EXPECT_EQ(simulation.robot().command(open_thrusters(kTestStart, 1.0, {1, 3})),
            ValveSchedule::Taken::kExpired);
}

TEST(Simulation, BadCommandsLeaveTheValvesShut) {
  Simulation simulation(test_scenario(), kTestStart);
  ThrusterCommand command = open_thrusters(kTestStart, 0.5, {1, 3});
  command.duty[4] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(simulation.robot().command(command), ValveSchedule::Taken::kMalformed);
  command.duty.resize(3);
  EXPECT_EQ(simulation.robot().command(command), ValveSchedule::Taken::kMalformed);
  simulation.advance_to(kTestStart + 1.0);
  EXPECT_EQ(simulation.robot().truth().v_WC.norm(), 0.0);
}

TEST(Simulation, WithoutANewCommandTheValvesClose) {
  Simulation simulation(test_scenario(), kTestStart);
  simulation.robot().command(open_thrusters(kTestStart, 1.0, {1, 3}));
  simulation.advance_to(kTestStart + 0.05);
  EXPECT_EQ(simulation.robot().openings()[0], 1.0);
  EXPECT_NEAR(simulation.robot().thrust()[0], 1.7, 1e-12);
  simulation.advance_to(kTestStart + 0.1);
  EXPECT_EQ(simulation.robot().openings().sum(), 0.0);
  EXPECT_EQ(simulation.robot().thrust().sum(), 0.0);
}

TEST(Simulation, ATiltedFloorPullsDownTheSlope) {
  Scenario scenario = test_scenario();
  FloorTilt tilt;
  tilt.slope_x = 0.002;
  scenario.effects = {tilt};
  Simulation simulation(scenario, kTestStart);
  simulation.advance_to(kTestStart + 2.0);
  EXPECT_NEAR(simulation.robot().truth().v_WC.x(), -0.01962 * 2.0, 1e-10);
  EXPECT_NEAR(simulation.robot().truth().p_WC.x(), -0.5 * 0.01962 * 4.0, 1e-10);
  EXPECT_LT(std::abs(simulation.robot().truth().yaw), 1e-12);
}

TEST(Simulation, SupplyCouplingWeakensThrustAsPublished) {
  Scenario scenario = test_scenario();
  SupplyCoupling coupling;
  coupling.fraction_per_open_thruster = 0.125;
  scenario.effects = {coupling};
  Simulation two(scenario, kTestStart);
  two.robot().command(open_thrusters(kTestStart, 1.0, {1, 3}));
  two.advance_to(kTestStart + 0.1);
  EXPECT_NEAR(two.robot().truth().v_WC.x() * 16.8 / 0.1, 2.975, 1e-9);
  Simulation four(scenario, kTestStart);
  four.robot().command(open_thrusters(kTestStart, 1.0, {2, 3, 6, 7}));
  four.advance_to(kTestStart + 0.1);
  EXPECT_NEAR(std::abs(four.robot().truth().yaw_rate) * 0.297 / 0.1, 0.510, 1e-9);
}

TEST(Simulation, IdenticalInputsGiveIdenticalMotionBesideAnotherWorld) {
  const Scenario scenario = all_effects_scenario();
  const auto commands = random_commands(scenario, kTestStart, 11);
  Simulation alone(scenario, kTestStart);
  command_all(alone, commands);
  for (int k = 1; k <= 200; ++k) alone.advance_to(kTestStart + 0.1 * k);

  Simulation accompanied(scenario, kTestStart), other(scenario, kTestStart);
  command_all(accompanied, commands);
  command_all(other, random_commands(scenario, kTestStart, 12));
  for (int k = 1; k <= 200; ++k) {
    other.advance_to(kTestStart + 0.0777 * k);
    accompanied.advance_to(kTestStart + 0.1 * k);
  }
  EXPECT_GT(alone.robot().truth().p_WC.norm(), 0.1);
  expect_identical(alone.robot().truth(), accompanied.robot().truth());
}

TEST(Simulation, CutsBetweenCallsOnlyAddRounding) {
  const Scenario scenario = all_effects_scenario();
  const auto commands = random_commands(scenario, kTestStart, 11);
  Simulation whole(scenario, kTestStart), pieces(scenario, kTestStart);
  command_all(whole, commands);
  command_all(pieces, commands);
  for (int k = 1; k <= 2000; ++k) pieces.advance_to(kTestStart + 0.01 * k);
  whole.advance_to(kTestStart + 20.0);
  EXPECT_LT((whole.robot().truth().p_WC - pieces.robot().truth().p_WC).norm(), 1e-9);
  EXPECT_EQ(whole.steps(), pieces.steps());
}

TEST(Simulation, WorldsInTwoThreadsDoNotDisturbEachOther) {
  const Scenario scenario = all_effects_scenario();
  PlanarState<double> ends[3];
  const auto fly = [&scenario](PlanarState<double>& end) {
    end = run_batch(scenario, random_commands(scenario, kTestStart, 5), kTestStart).rows.back().truth;
  };
  fly(ends[0]);
  std::thread first(fly, std::ref(ends[1])), second(fly, std::ref(ends[2]));
  first.join();
  second.join();
  expect_identical(ends[0], ends[1]);
  expect_identical(ends[0], ends[2]);
}

TEST(Simulation, RemembersThePastForTheMocapLatency) {
  Scenario scenario = test_scenario();
  MocapLatency latency;
  latency.delay_s = 0.0305;
  scenario.effects = {latency};
  Simulation simulation(scenario, kTestStart);
  command_all(simulation, repeated(open_thrusters(kTestStart, 1.0, {1, 3}), 20));
  expect_identical(simulation.robot().center_of_mass_at(kTestStart - 5.0),
                   simulation.robot().center_of_mass());
  simulation.advance_to(kTestStart + 1.0);
  const double a = 3.4 / 16.8;
  for (const double ago : {0.0, 0.0003, 0.001, 0.0305}) {
    const PlanarState<double> past = simulation.robot().center_of_mass_at(kTestStart + 1.0 - ago);
    EXPECT_NEAR(past.p_WC.x(), 0.5 * a * (1.0 - ago) * (1.0 - ago), 1e-10) << ago;
    EXPECT_NEAR(past.v_WC.x(), a * (1.0 - ago), 1e-10) << ago;
  }
  expect_identical(simulation.robot().center_of_mass_at(kTestStart + 1.0),
                   simulation.robot().center_of_mass());
}

TEST(Simulation, MovesToAnotherOwner) {
  Simulation first(test_scenario(), kTestStart);
  first.robot().command(open_thrusters(kTestStart, 1.0, {1, 3}));
  first.advance_to(kTestStart + 0.05);
  Simulation second = std::move(first);
  second.advance_to(kTestStart + 0.1);
  EXPECT_NEAR(second.robot().truth().v_WC.x(), 0.34 / 16.8, 1e-12);
}

TEST(Simulation, AReportOfOdeIsAnErrorAndNotTheEndOfTheProcess) {
  Simulation simulation(test_scenario(), kTestStart);
  const auto report = [](dMessageFunction* handler, const char* format, ...) {
    va_list arguments;
    va_start(arguments, format);
    try {
      handler(3, format, arguments);
    } catch (...) {
      va_end(arguments);
      throw;
    }
    va_end(arguments);
  };
  EXPECT_THROW(report(dGetErrorHandler(), "bad %s", "mass"), std::runtime_error);
  EXPECT_THROW(report(dGetDebugHandler(), "bad %s", "argument"), std::runtime_error);
  EXPECT_NO_THROW(report(dGetMessageHandler(), "LCP %s", "error"));
  // A message outside a step belongs to nobody.
  EXPECT_NO_THROW(simulation.advance_to(kTestStart + 0.01));
}

}  // namespace
}  // namespace atmos
