// Contacts: robots against walls, obstacles and each other.
#include <gtest/gtest.h>

#include <cmath>

#include "test_scenario.h"

namespace atmos {
namespace {

constexpr double kMass = 16.8, kInertia = 0.297, kRadius = 0.2;

// A robot at rest that a push of `impulse` [N s] sets going 10 ms after the start.
Scenario pushed(double x, double y, double impulse_x, double impulse_y, double impulse_yaw = 0.0) {
  Scenario scenario = test_scenario();
  scenario.start = {0.0, x, y, 0.0};
  scenario.effects = {ExternalImpulse{{}, {{kTestStart + 0.01, {impulse_x, impulse_y}, impulse_yaw}}}};
  return scenario;
}

struct Momentum {
  Vec2<double> linear = Vec2<double>::Zero();
  double angular = 0.0;
  double energy = 0.0;
};

Momentum momentum(const Simulation& simulation) {
  Momentum sum;
  for (std::size_t i = 0; i < simulation.size(); ++i) {
    const PlanarState<double>& s = simulation.robot(i).center_of_mass();
    const double m = simulation.robot(i).mass_kg();
    sum.linear += m * s.v_WC;
    sum.angular += kInertia * s.yaw_rate + m * cross2(s.p_WC, s.v_WC);
    sum.energy += 0.5 * m * s.v_WC.squaredNorm() + 0.5 * kInertia * s.yaw_rate * s.yaw_rate;
  }
  return sum;
}

TEST(Contact, AWallTurnsARobotBackWithTheRestitution) {
  for (const double restitution : {0.0, 0.47, 1.0}) {
    Scenario scenario = pushed(0.0, 0.0, 3.36, 1.68);
    scenario.world.walls = Walls{{-1.0, -5.0}, {1.0, 5.0}};
    scenario.world.restitution = restitution;
    Simulation simulation(scenario, kTestStart);
    double farthest = 0.0;
    for (int k = 1; k <= 600; ++k) {
      simulation.advance_to(kTestStart + 0.01 * k);
      farthest = std::max(farthest, simulation.robot().truth().p_WC.x());
    }
    EXPECT_NEAR(farthest, 1.0 - kRadius, 1e-3);
    EXPECT_NEAR(simulation.robot().truth().v_WC.x(), -restitution * 0.2, 0.021) << restitution;
    if (restitution > 0.0) {
      EXPECT_NEAR(simulation.robot().truth().v_WC.x(), -restitution * 0.2, 1e-6);
    }
    EXPECT_NEAR(simulation.robot().truth().v_WC.y(), 0.1, 1e-9);  // smooth
  }
}

TEST(Contact, BoxesAndCylindersAreWhereTheyAreSaidToBe) {
  WorldSettings box, cylinder, none;
  box.boxes = {{{1.0, 0.0}, {0.4, 1.0}, 0.0}};
  cylinder.cylinders = {{{1.0, 0.0}, 0.3}};
  WorldSettings turned = box;
  turned.boxes[0].yaw_rad = M_PI / 2;
  const auto farthest = [](const WorldSettings& world) {
    Scenario scenario = pushed(0.0, 0.0, 3.36, 0.0);
    scenario.world = world;
    Simulation simulation(scenario, kTestStart);
    double x = 0.0;
    for (int k = 1; k <= 600; ++k) {
      simulation.advance_to(kTestStart + 0.01 * k);
      x = std::max(x, simulation.robot().truth().p_WC.x());
    }
    return x;
  };
  EXPECT_NEAR(farthest(box), 0.8 - kRadius, 1e-3);
  EXPECT_NEAR(farthest(turned), 0.5 - kRadius, 1e-3);
  EXPECT_NEAR(farthest(cylinder), 0.7 - kRadius, 1e-3);
  EXPECT_GT(farthest(none), 1.1);
}

TEST(Contact, TwoRobotsKeepTheirMomentumAndLoseWhatTheRestitutionTakes) {
  // Head on and off centre, equal and unequal masses.
  for (const double offset : {0.0, 0.15}) {
    for (const double factor : {1.0, 1.4}) {
      for (const double friction : {0.0, 0.3}) {
        Scenario a = pushed(-0.5, 0.0, 3.36, 0.0), b = pushed(0.5, offset, -1.68, 0.0, 0.05);
        a.world.friction = friction;
        b.effects.push_back(MassError{{}, factor});
        Simulation simulation({a, b}, kTestStart);
        simulation.advance_to(kTestStart + 0.1);
        const Momentum before = momentum(simulation);
        simulation.advance_to(kTestStart + 6.0);
        const Momentum after = momentum(simulation);
        EXPECT_GT(simulation.contacts(), 0u);
        EXPECT_LT((after.linear - before.linear).norm(), 1e-9);
        EXPECT_NEAR(after.angular, before.angular, 2e-3);
        EXPECT_LT(after.energy, before.energy);
        if (offset == 0.0 && friction == 0.0) {
          const double closing = 3.36 / kMass + 1.68 / (factor * kMass);
          const double parting = simulation.robot(1).truth().v_WC.x() - simulation.robot(0).truth().v_WC.x();
          EXPECT_NEAR(parting, 0.47 * closing, 1e-6);
        }
        if (friction == 0.0) {
          EXPECT_NEAR(simulation.robot(0).truth().yaw_rate, 0.0, 1e-9);
        }
      }
    }
  }
}

TEST(Contact, AFleetInABoxKeepsItsMomentumWhileItMeetsNoWall) {
  std::vector<Scenario> fleet;
  for (int i = 0; i < 16; ++i) {
    const double x = 0.45 * (i % 4) - 0.675, y = 0.45 * (i / 4) - 0.675;
    fleet.push_back(pushed(x, y, -2.0 * x + 0.7 * std::sin(i), -2.0 * y + 0.7 * std::cos(3.0 * i)));
  }
  Simulation simulation(fleet, kTestStart);
  simulation.advance_to(kTestStart + 0.1);
  const Momentum before = momentum(simulation);
  simulation.advance_to(kTestStart + 10.0);
  const Momentum after = momentum(simulation);
  EXPECT_GT(simulation.contacts(), 20u);
  EXPECT_LT((after.linear - before.linear).norm(), 1e-9);
  EXPECT_LT(after.energy, before.energy);
  double closest = 1e9;
  for (std::size_t i = 0; i < fleet.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j)
      closest =
          std::min(closest, (simulation.robot(i).truth().p_WC - simulation.robot(j).truth().p_WC).norm());
  }
  EXPECT_GT(closest, 2.0 * kRadius - 2e-3);
}

// Out of reach, robots do not know of each other.
TEST(Contact, ARobotFarAwayChangesNothing) {
  Scenario scenario = test_scenario();
  const auto commands = random_commands(scenario, kTestStart, 4);
  Simulation alone(scenario, kTestStart);
  Scenario other = pushed(50.0, 0.0, 1.0, 0.0);
  Simulation together({scenario, other}, kTestStart);
  for (const ThrusterCommand& command : commands) {
    alone.robot().command(command);
    together.robot(0).command(command);
  }
  alone.advance_to(kTestStart + 20.0);
  together.advance_to(kTestStart + 20.0);
  EXPECT_EQ(alone.robot().truth().p_WC, together.robot(0).truth().p_WC);
  EXPECT_EQ(alone.robot().truth().yaw, together.robot(0).truth().yaw);
}

TEST(Contact, AFleetOfNoneIsRefused) {
  EXPECT_THROW(Simulation(std::vector<Scenario>{}, kTestStart), std::invalid_argument);
}

}  // namespace
}  // namespace atmos
