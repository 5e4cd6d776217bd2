// The law of every kind against closed forms or an integrator of its own, written from docs/effects.md. One
// test per kind, named after it.
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "atmos_model/predictor.h"
#include "nominal.h"

namespace atmos {
namespace {

constexpr double kMass = 16.8, kInertia = 0.297, kForce = 1.7, kLever = 0.12;

VecX<double> open(std::initializer_list<int> numbers) {
  VecX<double> openings = VecX<double>::Zero(8);
  for (const int number : numbers) openings[number - 1] = 1.0;
  return openings;
}

PlanarState<double> moving() { return {{1.0, -2.0}, 0.6, {0.3, -0.1}, 0.4}; }

// A nominal vehicle with effects, at the start of a recording.
class Lab {
 public:
  explicit Lab(std::vector<Effect> effects)
      : plant(nominal_vehicle(), std::move(effects), kStart),
        hidden(plant.initial_hidden()),
        valves(plant.thruster_count(), plant.properties().timing) {}

  PlanarWrench<double> wrench(const VecX<double>& openings, const PlanarState<double>& state = {},
                              double since_start = 0.0) const {
    return plant.wrench<double>(kStart + since_start, state, hidden, openings);
  }
  double thrust(int number, const VecX<double>& openings) const {
    return plant.thrust<double>(kStart, {}, hidden, openings)[number - 1];
  }
  // Holds valves open from the start for so long.
  void command(const VecX<double>& duty, double period_s) {
    ASSERT_EQ(valves.add({kStart, period_s, {duty.data(), duty.data() + duty.size()}}),
              ValveSchedule::Taken::kInTime);
  }
  PlantState fly(double duration_s, const PlanarState<double>& from = {}) const {
    PlantState state{kStart, from, hidden};
    advance(plant, valves, kStart + duration_s, state);
    return state;
  }

  Plant plant;
  VecX<double> hidden;
  ValveSchedule valves;
};

TEST(EffectLaw, thrust_scale) {
  const Lab lab({ThrustScale{{}, 0.9}});
  EXPECT_NEAR(lab.wrench(open({1, 3})).force_W.x(), 2 * 0.9 * kForce, 1e-12);
  EXPECT_NEAR(lab.wrench(open({6, 8})).force_W.y(), 2 * 0.9 * kForce, 1e-12);
}

TEST(EffectLaw, thruster_efficiency) {
  const Lab lab({ThrustScale{{}, 0.9}, ThrusterEfficiency{{}, 3, 0.5}, ThrusterEfficiency{{}, 6, 1.2}});
  EXPECT_NEAR(lab.wrench(open({1, 3})).force_W.x(), 0.9 * kForce * 1.5, 1e-12);
  EXPECT_NEAR(lab.wrench(open({1, 3})).torque, -0.9 * kForce * kLever * 0.5, 1e-12);
  EXPECT_NEAR(lab.thrust(6, open({6})), 0.9 * 1.2 * kForce, 1e-12);
}

TEST(EffectLaw, thruster_dead) {
  Lab lab({SupplyCoupling{{}, 0.125}, ThrusterDead{{}, 3, kStart + 1.0}});
  lab.command(open({1, 3}), 4.0);
  const PlantState end = lab.fly(2.0);
  // Until then the pair, each weakened by the other; afterwards thruster 1 alone and at full force.
  EXPECT_NEAR(end.hidden[0], 0.0035 * (2.0 + 1.0), 1e-9);
  EXPECT_NEAR(end.body.yaw_rate, -kForce * kLever / kInertia * 1.0, 1e-6);
  const PlantState at_failure = lab.fly(1.0);
  EXPECT_NEAR(at_failure.body.v_WC.x(), 2 * 0.875 * kForce / kMass, 1e-9);
  EXPECT_EQ(Lab({ThrusterDead{{}, 3, 0.0}}).plant.properties().timing.dead_since_s[2], 0.0);
}

TEST(EffectLaw, thruster_weak_since) {
  Lab lab({ThrusterWeakSince{{}, 1, kStart + 1.0, 0.4}, ThrusterWeakSince{{}, 3, 0.0, 0.5},
           ThrusterLeak{{}, 2, 0.1}});
  lab.command(open({1, 3}), 4.0);
  const double leak = 0.1 * kForce;
  EXPECT_NEAR(lab.fly(1.0).body.v_WC.x(), 0.0, 0.2);
  EXPECT_NEAR(lab.wrench(open({1, 3}), {}, 0.999).force_W.x(), 1.5 * kForce - leak, 1e-12);
  EXPECT_NEAR(lab.wrench(open({1, 3}), {}, 1.0).force_W.x(), 0.9 * kForce - leak, 1e-12);
  // Torque (1 at +y pushes clockwise, 3 the other way, the leak of 2 too) gives the exact spin over the
  // failure.
  const double before = (-1.0 + 0.5 + 0.1) * kForce * kLever, after = (-0.4 + 0.5 + 0.1) * kForce * kLever;
  EXPECT_NEAR(lab.fly(2.0).body.yaw_rate, (before + after) / kInertia, 1e-6);
}

TEST(EffectLaw, thruster_stuck_open) {
  Lab lab({SupplyCoupling{{}, 0.125}, ThrusterStuckOpen{{}, 3, kStart + 1.0}});
  lab.command(open({1}), 4.0);
  const PlantState end = lab.fly(2.0);
  EXPECT_NEAR(end.hidden[0], 0.0035 * (2.0 + 1.0), 1e-9);
  EXPECT_NEAR(end.body.yaw_rate, -kForce * kLever / kInertia * 1.0, 1e-6);
  // Without any command too; a dead valve stays shut.
  EXPECT_NEAR(Lab({ThrusterStuckOpen{{}, 3, 0.0}}).fly(1.0).hidden[0], 0.0035, 1e-9);
  EXPECT_EQ(Lab({ThrusterStuckOpen{{}, 3, 0.0}, ThrusterDead{{}, 3, 0.0}}).fly(1.0).hidden[0], 0.0);
}

TEST(EffectLaw, command_delay) {
  Lab lab({CommandDelay{{}, 0.25}});
  lab.command(open({1, 3}), 1.0);
  EXPECT_EQ(lab.fly(0.24).body.v_WC.norm(), 0.0);
  EXPECT_NEAR(lab.fly(0.75).body.v_WC.x(), 2 * kForce / kMass * 0.5, 1e-6);
  EXPECT_NEAR(lab.fly(2.0).body.v_WC.x(), 2 * kForce / kMass, 1e-6);
}

TEST(EffectLaw, valve_delay) {
  Lab lab({ValveDelay{{}, 0.1, 0.05}});
  lab.command(open({1, 3}), 1.0);
  EXPECT_NEAR(lab.fly(0.6).body.v_WC.x(), 2 * kForce / kMass * 0.5, 1e-6);
  EXPECT_NEAR(lab.fly(2.0).body.v_WC.x(), 2 * kForce / kMass * 0.95, 1e-6);
  Lab short_pulse({ValveDelay{{}, 0.1, 0.05}});
  short_pulse.command(open({1, 3}), 0.04);
  EXPECT_EQ(short_pulse.fly(2.0).body.v_WC.norm(), 0.0);
}

TEST(EffectLaw, thrust_rise) {
  constexpr double kTau = 0.05, kOpen = 0.2;
  Lab lab({ThrustRise{{}, kTau}});
  lab.command(open({1, 3}), kOpen);
  const double a = 2 * kForce / kMass;
  const double risen = 1.0 - std::exp(-kOpen / kTau);
  const PlantState closing = lab.fly(kOpen);
  EXPECT_NEAR(closing.hidden[1], risen, 1e-6);
  EXPECT_NEAR(closing.hidden[2], 0.0, 1e-12);
  EXPECT_NEAR(closing.body.v_WC.x(), a * (kOpen - kTau * risen), 1e-7);
  // What is missing at first comes later: the impulse is that of the pulse, and so is the gas.
  const PlantState end = lab.fly(2.0);
  EXPECT_NEAR(end.body.v_WC.x(), a * kOpen, 1e-7);
  EXPECT_NEAR(end.hidden[0], 2 * 0.0035 * kOpen, 1e-9);
  // The share that is open enters the coupling.
  Lab coupled({ThrustRise{{}, kTau}, SupplyCoupling{{}, 0.125}});
  coupled.hidden[1] = 0.5;
  coupled.hidden[3] = 0.8;
  EXPECT_NEAR(coupled.thrust(1, open({})), kForce * 0.5 * (1 - 0.125 * 0.8), 1e-12);
}

TEST(EffectLaw, supply_coupling) {
  const Lab lab({SupplyCoupling{{}, 0.125}});
  EXPECT_NEAR(lab.thrust(1, open({1})), 1.7, 1e-12);
  EXPECT_NEAR(lab.thrust(1, open({1, 3})), 1.4875, 1e-12);
  EXPECT_NEAR(lab.thrust(1, open({1, 3, 5})), 1.275, 1e-12);
  EXPECT_NEAR(lab.thrust(1, open({1, 3, 5, 7})), 1.0625, 1e-12);
  EXPECT_EQ(lab.thrust(2, open({1, 3, 5, 7})), 0.0);
}

TEST(EffectLaw, supply_droop) {
  constexpr double kLoss = 0.4, kRecovery = 0.5;
  Lab lab({SupplyDroop{{}, kLoss, kRecovery}});
  lab.command(open({1, 3}), 1.0);
  // Linear while n stays: s settles at (1/T) / (1/T + loss n) with the rate in brackets.
  const double rate = 1.0 / kRecovery + 2 * kLoss, settled = (1.0 / kRecovery) / rate;
  const double s1 = settled + (1.0 - settled) * std::exp(-rate * 1.0);
  EXPECT_NEAR(lab.fly(1.0).hidden[1], s1, 1e-8);
  const double impulse = settled + (1.0 - settled) * (1.0 - std::exp(-rate)) / rate;
  EXPECT_NEAR(lab.fly(1.0).body.v_WC.x(), 2 * kForce / kMass * impulse, 1e-8);
  EXPECT_NEAR(lab.fly(1.7).hidden[1], 1.0 - (1.0 - s1) * std::exp(-0.7 / kRecovery), 1e-8);
}

TEST(EffectLaw, pressure_decay) {
  Lab lab({PressureDecay{{}, 0.2}});
  lab.command(open({1, 3}), 100.0);
  const double used = 100.0 * 2 * 0.0035;
  const PlantState end = lab.fly(100.0);
  EXPECT_NEAR(end.hidden[0], used, 1e-9);
  EXPECT_NEAR(end.body.v_WC.x(), 2 * kForce / kMass * 100.0 * (1.0 - 0.2 * 0.5 * used), 1e-6);
  lab.hidden = end.hidden;
  EXPECT_NEAR(lab.thrust(1, open({1})), kForce * (1.0 - 0.2 * used), 1e-9);
}

TEST(EffectLaw, thruster_leak) {
  Lab lab({SupplyCoupling{{}, 0.125}, SupplyDroop{{}, 0.4, 0.5}, PressureDecay{{}, 0.2},
           ThrusterLeak{{}, 2, 0.1}, ThrusterEfficiency{{}, 2, 0.5}});
  const double leak = 0.1 * 0.5 * kForce;
  EXPECT_NEAR(lab.thrust(2, open({})), leak, 1e-12);
  EXPECT_NEAR(lab.thrust(2, open({1, 3, 5})), leak, 1e-12);  // not coupled
  EXPECT_NEAR(lab.thrust(2, open({2, 3})), 0.5 * kForce * 0.875 + leak, 1e-12);
  EXPECT_NEAR(lab.thrust(3, open({3})), kForce, 1e-12);  // not counted among the open ones
  lab.hidden << 0.3, 0.7;                                // gas, plenum
  EXPECT_NEAR(lab.thrust(2, open({})), leak * 0.7 * (1 - 0.2 * 0.3), 1e-12);
  EXPECT_EQ(lab.plant.rate<double>(kStart, {}, lab.hidden, open({})).hidden[0], 0.0);
  EXPECT_NEAR(lab.wrench(open({})).torque, leak * 0.7 * (1 - 0.2 * 0.3) * kLever, 1e-12);
}

TEST(EffectLaw, thruster_leak_since) {
  const Lab lab({ThrusterLeakSince{{}, 2, kStart + 1.0, 0.1}});
  EXPECT_EQ(lab.fly(1.0).body.v_WC.norm(), 0.0);
  EXPECT_NEAR(lab.fly(1.5).body.yaw_rate, 0.1 * kForce * kLever / kInertia * 0.5, 1e-9);
  EXPECT_NEAR(lab.wrench(open({}), {}, 1.0).force_W.x(), -0.1 * kForce, 1e-12);
  EXPECT_EQ(lab.fly(1.5).hidden[0], 0.0);
}

TEST(EffectLaw, thruster_misalignment) {
  const Lab lab({ThrusterMisalignment{{}, 1, 0.3}});
  const PlanarWrench<double> push = lab.wrench(open({1}));
  EXPECT_NEAR(push.force_W.x(), kForce * std::cos(0.3), 1e-12);
  EXPECT_NEAR(push.force_W.y(), kForce * std::sin(0.3), 1e-12);  // positive about z: to the left
  // Thruster 1 sits at (-0.12, 0.12).
  EXPECT_NEAR(push.torque, kForce * (-0.12 * std::sin(0.3) - 0.12 * std::cos(0.3)), 1e-12);
}

TEST(EffectLaw, mass_error) {
  const Lab lab({MassError{{}, 1.25}, FloorTilt{{}, 0.002, 0.0}});
  const PlantRate<double> rate = lab.plant.rate<double>(kStart, {}, lab.hidden, open({1}));
  EXPECT_NEAR(rate.body.a_WC.x(), kForce / (1.25 * kMass) - 9.81 * 0.002, 1e-12);  // weight grows as well
  EXPECT_NEAR(rate.body.yaw_acceleration, -kForce * kLever / kInertia, 1e-12);
}

TEST(EffectLaw, inertia_error) {
  const Lab lab({InertiaError{{}, 0.8}});
  const PlantRate<double> rate = lab.plant.rate<double>(kStart, {}, lab.hidden, open({1}));
  EXPECT_NEAR(rate.body.a_WC.x(), kForce / kMass, 1e-12);
  EXPECT_NEAR(rate.body.yaw_acceleration, -kForce * kLever / (0.8 * kInertia), 1e-12);
}

TEST(EffectLaw, mass_depletion) {
  constexpr double kRate = 0.02;
  Lab lab({MassDepletion{{}, kRate}});
  lab.command(open({1, 3}), 60.0);
  const PlantState end = lab.fly(60.0);
  const double gone = 60.0 * 2 * kRate;
  EXPECT_NEAR(end.hidden[0], gone, 1e-9);
  EXPECT_NEAR(lab.plant.mass<double>(kStart, {}, end.hidden), kMass - gone, 1e-9);
  // dv/dt = F / (M - 2 r t)
  EXPECT_NEAR(end.body.v_WC.x(), 2 * kForce / (2 * kRate) * std::log(kMass / (kMass - gone)), 1e-7);
}

TEST(EffectLaw, com_offset) {
  const Lab lab({ComOffset{{}, 0.03, -0.02}});
  EXPECT_NEAR(lab.wrench(open({1})).torque, -kForce * (0.12 + 0.02), 1e-12);
  EXPECT_NEAR(lab.wrench(open({8})).torque, kForce * (-0.12 - 0.03), 1e-12);
  // The mocap goes on showing the geometric centre: p - R c.
  PlanarState<double> state = moving();
  state.yaw = M_PI / 2;
  const PlanarState<double> shown = lab.plant.measured(state);
  EXPECT_TRUE(shown.p_WC.isApprox(Eigen::Vector2d(1.0 - 0.02, -2.0 - 0.03), 1e-12));
  EXPECT_TRUE(shown.v_WC.isApprox(Eigen::Vector2d(0.3 + 0.4 * 0.03, -0.1 - 0.4 * 0.02), 1e-12));
}

// Body and moving mass written as two bodies, in absolute places.
TEST(EffectLaw, slosh) {
  constexpr double kMoving = 1.5, kFrequency = 0.8, kDamping = 0.1, kX = 0.1, kY = -0.05, kSlope = 0.001;
  Lab lab({Slosh{{}, kMoving, kFrequency, kDamping, kX, kY}, FloorTilt{{}, kSlope, 0.0}});
  lab.command(open({1, 3, 6}), 1.0);
  PlanarState<double> start;
  start.yaw_rate = 0.5;
  const PlantState end = lab.fly(3.0, start);

  const double w = 2 * M_PI * kFrequency, h = 2e-5, body_mass = kMass - kMoving;
  double px = 0, py = 0, yaw = 0, vx = 0, vy = 0, rate = 0.5;
  double qx = kX, qy = kY, ux = -0.5 * kY, uy = 0.5 * kX;  // the moving mass, at rest in its socket
  for (int k = 0; k < 150000; ++k) {
    const double c = std::cos(yaw), s = std::sin(yaw), rx = c * kX - s * kY, ry = s * kX + c * kY;
    const double dx = qx - px - rx, dy = qy - py - ry;
    const double ddx = ux - (vx - rate * ry), ddy = uy - (vy + rate * rx);
    const double sx = kMoving * (w * w * dx + 2 * kDamping * w * ddx);
    const double sy = kMoving * (w * w * dy + 2 * kDamping * w * ddy);
    const bool on = k < 50000;
    const double fx = on ? 2 * kForce * c - kForce * s : 0, fy = on ? 2 * kForce * s + kForce * c : 0;
    const double torque = on ? kForce * kLever : 0;
    vx += h * ((fx + sx) / body_mass - 9.81 * kSlope);
    vy += h * (fy + sy) / body_mass;
    rate += h * (torque + rx * sy - ry * sx) / kInertia;
    ux += h * (-sx / kMoving - 9.81 * kSlope);
    uy += h * (-sy / kMoving);
    px += h * vx, py += h * vy, yaw += h * rate, qx += h * ux, qy += h * uy;
  }
  EXPECT_NEAR(end.body.p_WC.x(), px, 2e-5);
  EXPECT_NEAR(end.body.p_WC.y(), py, 2e-5);
  EXPECT_NEAR(end.body.yaw, yaw, 1e-4);
  EXPECT_NEAR(end.hidden[1], qx - px - (std::cos(yaw) * kX - std::sin(yaw) * kY), 2e-5);
  EXPECT_NEAR(end.hidden[2], qy - py - (std::sin(yaw) * kX + std::cos(yaw) * kY), 2e-5);
  EXPECT_GT(std::hypot(end.hidden[1], end.hidden[2]), 5e-4);

  // What sloshes still rests on the bearings.
  const Lab rubbing({Slosh{{}, kMoving, kFrequency, kDamping, 0.0, 0.0}, CoulombFriction{{}, 0.01}});
  PlanarState<double> fast;
  fast.v_WC.x() = 1.0;
  EXPECT_NEAR(rubbing.wrench(open({}), fast).force_W.x(), -0.01 * kMass * 9.81, 1e-5);
}

TEST(EffectLaw, floor_tilt) {
  const Lab lab({FloorTilt{{}, 0.002, -0.001}});
  const PlanarWrench<double> pull = lab.wrench(open({}), moving());
  EXPECT_NEAR(pull.force_W.x(), -kMass * 9.81 * 0.002, 1e-12);
  EXPECT_NEAR(pull.force_W.y(), kMass * 9.81 * 0.001, 1e-12);
  EXPECT_NEAR(pull.torque, 0.0, 1e-12);
  EXPECT_NEAR(lab.fly(2.0).body.p_WC.x(), -0.5 * 9.81 * 0.002 * 4.0, 1e-9);
}

TEST(EffectLaw, floor_unevenness) {
  // Heights that are a quadratic in x and linear in y: the interpolating cubic reproduces both inside.
  FloorUnevenness floor;
  floor.grid.origin_m = {-1.5, -1.2};
  floor.grid.spacing_m = 0.3;
  for (int j = 0; j < 9; ++j) {
    floor.height_m.emplace_back();
    for (int i = 0; i < 11; ++i) {
      const double x = -1.5 + 0.3 * i, y = -1.2 + 0.3 * j;
      floor.height_m.back().push_back(0.002 * x * x + 0.001 * y + 0.0005 * x * y);
    }
  }
  // With the bearings' centroid beside the centre of mass, at (-0.03, -0.01) in the body.
  const Lab lab({ComOffset{{}, 0.03, 0.01}, floor});
  const PlanarState<double> state{{0.31, 0.17}, 0.6, {0.0, 0.0}, 0.0};
  double fx = 0, fy = 0, torque = 0;
  for (const double degrees : {90.0, 210.0, 330.0}) {
    const double angle = degrees * M_PI / 180.0;
    const double bx = 0.15 * std::cos(angle) - 0.03, by = 0.15 * std::sin(angle) - 0.01;
    const double rx = std::cos(0.6) * bx - std::sin(0.6) * by, ry = std::sin(0.6) * bx + std::cos(0.6) * by;
    const double x = 0.31 + rx, y = 0.17 + ry;
    const double push_x = -kMass * 9.81 / 3 * (0.004 * x + 0.0005 * y);
    const double push_y = -kMass * 9.81 / 3 * (0.001 + 0.0005 * x);
    fx += push_x, fy += push_y, torque += rx * push_y - ry * push_x;
  }
  const PlanarWrench<double> pull = lab.wrench(open({}), state);
  EXPECT_NEAR(pull.force_W.x(), fx, 1e-9);
  EXPECT_NEAR(pull.force_W.y(), fy, 1e-9);
  EXPECT_NEAR(pull.torque, torque, 1e-9);
  EXPECT_GT(std::abs(torque), 1e-4);
  // Outside, the nearest edge goes on: flat across it.
  EXPECT_EQ(lab.wrench(open({}), {{40.0, 30.0}, 0.0, {0.0, 0.0}, 0.0}).force_W.norm(), 0.0);
  const Vec2<double> beside = lab.plant.floor_slope<double>({40.0, 0.15});
  EXPECT_EQ(beside.x(), 0.0);
  EXPECT_NEAR(beside.y(), 0.001 + 0.0005 * 1.5, 1e-9);
}

TEST(EffectLaw, airflow) {
  Airflow wind;
  wind.grid.origin_m = {-1.0, -1.0};
  wind.grid.spacing_m = 2.0;
  wind.force_x_n = {{0.0, 0.4}, {0.2, 1.0}};
  wind.force_y_n = {{0.1, 0.1}, {-0.3, -0.3}};
  const Lab lab({wind, ComOffset{{}, 0.05, 0.05}});
  const PlanarWrench<double> push = lab.wrench(open({}), {{0.5, -0.5}, 1.0, {0.0, 0.0}, 0.0});
  EXPECT_NEAR(push.force_W.x(), 0.75 * (0.75 * 0.4) + 0.25 * (0.25 * 0.2 + 0.75 * 1.0), 1e-12);
  EXPECT_NEAR(push.force_W.y(), 0.75 * 0.1 - 0.25 * 0.3, 1e-12);
  EXPECT_EQ(push.torque, 0.0);
  EXPECT_NEAR(lab.wrench(open({}), {{9.0, 9.0}, 0.0, {0.0, 0.0}, 0.0}).force_W.x(), 1.0, 1e-12);
  Airflow uniform;
  uniform.force_x_n = {{0.3}};
  uniform.force_y_n = {{-0.2}};
  EXPECT_TRUE(Lab({uniform}).wrench(open({}), moving()).force_W.isApprox(Eigen::Vector2d(0.3, -0.2)));
}

TEST(EffectLaw, tether) {
  const Lab lab({Tether{{}, 1.0, 2.0, 0.5, 3.0, 0.4}});
  EXPECT_EQ(lab.wrench(open({}), {{1.3, 2.39}, 0.0, {1.0, 1.0}, 0.0}).force_W.norm(), 0.0);  // slack
  // 2 m along +x from the anchor, moving away at 0.5 m/s.
  const PlanarWrench<double> pull = lab.wrench(open({}), {{3.0, 2.0}, 0.7, {0.5, 0.3}, 0.2});
  EXPECT_NEAR(pull.force_W.x(), -(3.0 * 1.5 + 0.4 * 0.5), 1e-12);
  EXPECT_NEAR(pull.force_W.y(), 0.0, 1e-12);
  EXPECT_EQ(pull.torque, 0.0);
  EXPECT_EQ(Lab({Tether{{}, 0.0, 0.0, 0.0, 3.0, 0.4}}).wrench(open({})).force_W.norm(),
            0.0);  // at the anchor
}

TEST(EffectLaw, viscous_drag) {
  const Lab lab({ViscousDrag{{}, 1.5, 0.05}});
  const PlantState end = lab.fly(4.0, moving());
  EXPECT_NEAR(end.body.v_WC.x(), 0.3 * std::exp(-1.5 / kMass * 4.0), 1e-9);
  EXPECT_NEAR(end.body.v_WC.y(), -0.1 * std::exp(-1.5 / kMass * 4.0), 1e-9);
  EXPECT_NEAR(end.body.yaw_rate, 0.4 * std::exp(-0.05 / kInertia * 4.0), 1e-9);
}

TEST(EffectLaw, quadratic_drag) {
  constexpr double kDrag = 5.0;
  const PlantState end = Lab({QuadraticDrag{{}, kDrag}}).fly(4.0, moving());
  const double v0 = std::hypot(0.3, 0.1), v = v0 / (1.0 + kDrag / kMass * v0 * 4.0);
  EXPECT_NEAR(end.body.v_WC.norm(), v, 1e-9);
  EXPECT_NEAR(end.body.v_WC.x() / end.body.v_WC.y(), -3.0, 1e-9);  // the direction stays
  EXPECT_NEAR(end.body.yaw_rate, 0.4, 1e-12);
}

TEST(EffectLaw, coulomb_friction) {
  const Lab lab({CoulombFriction{{}, 0.01}});
  PlanarState<double> straight;
  straight.v_WC = {0.3, 0.4};
  const PlantState end = lab.fly(2.0, straight);
  EXPECT_NEAR(end.body.v_WC.norm(), 0.5 - 0.01 * 9.81 * 2.0, 1e-4);
  EXPECT_NEAR(end.body.v_WC.y() / end.body.v_WC.x(), 4.0 / 3.0, 1e-9);
  // Spinning on the spot, each bearing rubs against its own motion.
  PlanarState<double> spinning;
  spinning.yaw_rate = 1.0;
  EXPECT_NEAR(lab.wrench(open({}), spinning).torque, -0.01 * kMass * 9.81 * 0.15, 1e-4);
  EXPECT_LT(lab.wrench(open({}), spinning).force_W.norm(), 1e-9);
  // It stops and stays.
  EXPECT_LT(lab.fly(8.0, straight).body.v_WC.norm(), 1e-6);
}

TEST(EffectLaw, bearing_down) {
  const Lab lab({BearingDown{{}, 1, kStart + 1.0, 0.01}});
  PlanarState<double> state;
  state.v_WC = {1.0, 0.0};
  EXPECT_EQ(lab.wrench(open({}), state, 0.999).force_W.norm(), 0.0);
  // Bearing 1 stands at 90 degrees.
  const double rub = 0.01 * kMass * 9.81 / 3;
  EXPECT_NEAR(lab.wrench(open({}), state, 1.0).force_W.x(), -rub, 1e-5);
  EXPECT_NEAR(lab.wrench(open({}), state, 1.0).torque, 0.15 * rub, 1e-6);
  // All three stop it as friction does.
  const Lab down(
      {BearingDown{{}, 1, 0.0, 0.01}, BearingDown{{}, 2, 0.0, 0.01}, BearingDown{{}, 3, 0.0, 0.01}});
  EXPECT_NEAR(down.fly(2.0, state).body.v_WC.x(), 1.0 - 0.01 * 9.81 * 2.0, 1e-4);
}

TEST(EffectLaw, friction_patch) {
  PlanarState<double> state;
  state.v_WC = {1.0, 0.0};
  // Only the bearing at 90 degrees, (0, 0.15), lies inside.
  const Lab lab({FrictionPatch{{}, 0.01, 0.0, 0.2, 0.1}});
  const double rub = 0.01 * kMass * 9.81 / 3;
  EXPECT_NEAR(lab.wrench(open({}), state).force_W.x(), -rub, 1e-5);
  EXPECT_NEAR(lab.wrench(open({}), state).torque, 0.15 * rub, 1e-5);
  state.p_WC.y() = -0.2;
  EXPECT_EQ(lab.wrench(open({}), state).force_W.norm(), 0.0);
}

TEST(EffectLaw, external_impulse) {
  const Lab lab({ExternalImpulse{{}, {{kStart + 1.0, {2.0, -1.0}, 0.1}, {kStart + 1.02, {0.5, 0.0}, 0.0}}}});
  EXPECT_EQ(lab.fly(1.0).body.v_WC.norm(), 0.0);
  EXPECT_NEAR(lab.fly(1.01).body.v_WC.y(), -0.2 * 1.0 / kMass, 1e-6);
  const PlantState end = lab.fly(1.1);
  EXPECT_NEAR(end.body.v_WC.x(), 2.5 / kMass, 1e-6);
  EXPECT_NEAR(end.body.v_WC.y(), -1.0 / kMass, 1e-6);
  EXPECT_NEAR(end.body.yaw_rate, 0.1 / kInertia, 1e-5);
}

TEST(EffectLaw, floor_vibration) {
  constexpr double kAmplitude = 0.5, kFrequency = 2.0, kPhase = 0.4, kDirection = 2.0;
  const Lab lab({FloorVibration{{}, kAmplitude, kFrequency, kPhase, kDirection}});
  const double w = 2 * M_PI * kFrequency;
  const double v = kAmplitude / (kMass * w) * (std::cos(kPhase) - std::cos(w * 1.3 + kPhase));
  const PlantState end = lab.fly(1.3, {{0.0, 0.0}, 0.9, {0.0, 0.0}, 0.0});
  EXPECT_NEAR(end.body.v_WC.x(), v * std::cos(kDirection), 1e-8);
  EXPECT_NEAR(end.body.v_WC.y(), v * std::sin(kDirection), 1e-8);
  EXPECT_EQ(end.body.yaw_rate, 0.0);
}

TEST(EffectLaw, mocap_latency) {
  EXPECT_EQ(Lab({MocapLatency{{}, 0.03}}).plant.properties().mocap_latency_s, 0.03);
}

TEST(EffectLaw, marker_offset) {
  const Lab lab({ComOffset{{}, 0.03, -0.02}, MarkerOffset{{}, 0.01, 0.05}});
  PlanarState<double> state = moving();
  state.yaw = M_PI / 2;
  // (0.01, 0.05) - c = (-0.02, 0.07), turned by 90 degrees.
  EXPECT_TRUE(lab.plant.measured(state).p_WC.isApprox(Eigen::Vector2d(1.0 - 0.07, -2.0 - 0.02), 1e-12));
  EXPECT_TRUE(lab.plant.from_measured(lab.plant.measured(state)).p_WC.isApprox(state.p_WC, 1e-12));
}

TEST(EffectLaw, yaw_misalignment) {
  const Lab lab({YawMisalignment{{}, 0.2}, MarkerOffset{{}, 0.1, 0.0}});
  const PlanarState<double> shown = lab.plant.measured(moving());
  EXPECT_NEAR(shown.yaw, 0.8, 1e-12);
  EXPECT_NEAR(shown.p_WC.x(), 1.0 + 0.1 * std::cos(0.6), 1e-12);  // places turn with the robot itself
  EXPECT_NEAR(lab.plant.from_measured(shown).yaw, 0.6, 1e-12);
}

TEST(EffectLaw, clock_skew) { EXPECT_EQ(Lab({ClockSkew{{}, 1e-4}}).plant.properties().stamp_skew, 1e-4); }

TEST(EffectLaw, unmodelled) {
  Unmodelled law;
  law.force_x_n = "k * sin(2 * yaw) - vx^2 / 4";
  law.force_y_n = "-2^2 + abs(vy) * exp(-t) + u1 * u3";
  law.torque_n_m = "tanh(yaw_rate / w0) * sqrt(x - y)";
  law.coefficients = {{"k", {0.3, "N"}}, {"w0", {0.1, "rad/s"}}};
  const Lab lab({law});
  const PlanarWrench<double> nominal = Lab({}).wrench(open({1, 3}), moving(), 2.0);
  const PlanarWrench<double> push = lab.wrench(open({1, 3}), moving(), 2.0);
  EXPECT_NEAR(push.force_W.x() - nominal.force_W.x(), 0.3 * std::sin(1.2) - 0.09 / 4, 1e-12);
  EXPECT_NEAR(push.force_W.y() - nominal.force_W.y(), -4.0 + 0.1 * std::exp(-2.0) + 1.0, 1e-12);
  EXPECT_NEAR(push.torque, std::tanh(4.0) * std::sqrt(3.0), 1e-12);
}

TEST(EffectLaws, EveryRegisteredKindHasOne) {
  std::set<std::string> tested, registered;
  const auto& suites = *testing::UnitTest::GetInstance();
  for (int s = 0; s < suites.total_test_suite_count(); ++s) {
    const auto& suite = *suites.GetTestSuite(s);
    if (std::string(suite.name()) != "EffectLaw") continue;
    for (int t = 0; t < suite.total_test_count(); ++t) tested.insert(suite.GetTestInfo(t)->name());
  }
  for (const EffectInfo& info : registered_effects()) registered.insert(info.kind);
  EXPECT_EQ(tested, registered);
}

}  // namespace
}  // namespace atmos
