#include "atmos_sim2real/response.h"

#include <gtest/gtest.h>

#include <array>

#include "synthetic.h"

namespace atmos {
namespace {

constexpr double kStart = 1.7e9;

// Long enough for each group of thrusters to be used a few times.
Recording flown(const std::vector<Effect>& effects = {}, const Vehicle& vehicle = nominal_vehicle()) {
  return clean_recording(fly(vehicle, effects, pulse_commands(kStart, 60.0, 3), 4).recording, 8);
}

std::string refusal_of(const Recording& recording, const Vehicle& vehicle = nominal_vehicle()) {
  return refusal(response(recording, vehicle));
}

bool says(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

TEST(Response, ANominalFlightAnswersAsStated) {
  const Response seen = response(flown(), nominal_vehicle());
  EXPECT_GT(seen.correlation, 0.99);
  EXPECT_NEAR(seen.strength, 1.0, 0.05);
  EXPECT_NEAR(seen.yaw_strength, 1.0, 0.05);
  EXPECT_EQ(seen.best_shift_s, 0.0);
  EXPECT_EQ(refusal(seen), "");
  for (std::size_t k = 0; k < 8; ++k) {
    for (int axis = 0; axis < 3; ++axis)
      EXPECT_LT(std::abs(seen.observed[k][axis] - seen.stated[k][axis]),
                4.0 * seen.deviation[k][axis] + 1e-3);
  }
}

TEST(Response, EffectsOfTheVocabularyAreNoReasonToRefuse) {
  CommandDelay delay;
  delay.delay_s = 0.1;
  MocapLatency latency;
  latency.delay_s = 0.1;
  SupplyCoupling coupling;
  coupling.fraction_per_open_thruster = 0.15;
  ThrusterDead dead;
  dead.thruster = 4;
  FloorTilt tilt;
  tilt.slope_x = 1e-3;
  CoulombFriction friction;
  friction.coefficient = 1e-3;
  YawMisalignment yaw;
  yaw.angle_rad = 0.2;
  MassError mass;
  mass.factor = 1.5;
  for (const Effect& effect : {Effect(delay), Effect(latency), Effect(coupling), Effect(dead), Effect(tilt),
                               Effect(friction), Effect(yaw), Effect(mass)})
    EXPECT_EQ(refusal_of(flown({effect})), "") << kind_of(effect);
}

TEST(Response, ShortPulsesOfValvesThatCloseLateAreNoReasonToRefuse) {
  // Pulses of 2 to 10 ms that become 17 ms longer.
  const std::vector<ThrusterCommand> commands = shortened(pulse_commands(kStart, 60.0, 3), 0.1);
  const ValveDelay late{{}, 0.015, 0.032};
  const Response seen =
      response(clean_recording(fly(nominal_vehicle(), {late}, commands, 4).recording, 8), nominal_vehicle());
  EXPECT_GT(seen.above_noise, 8.0) << "the robot does not move";
  EXPECT_NEAR(seen.strength, 1.0, 0.5);
  EXPECT_NEAR(seen.yaw_strength, 1.0, 0.5);
  EXPECT_EQ(refusal(seen), "");
}

TEST(Response, AThrusterThatFailsHalfWayLeadsNoOtherAstray) {
  ThrusterDead dead;
  dead.thruster = 2;
  dead.since_s = kStart + 50.0;
  // Each thruster by itself, in turn; after the failure 6 and 7 fire with the dead one alone, and half as
  // long.
  const std::array<std::array<std::size_t, 2>, 4> pairs = {{{2, 6}, {1, 5}, {2, 7}, {1, 8}}};
  std::vector<ThrusterCommand> commands = pulse_commands(kStart, 100.0, 3);
  for (std::size_t k = 0; k < commands.size(); ++k) {
    std::vector<double>& duty = commands[k].duty;
    duty.assign(8, 0.0);
    if (k < 500) {
      const std::size_t thruster = (k / 3 * 5) % 8 + 1;
      duty[thruster - 1] = thruster == 6 || thruster == 7 ? 0.3 : 0.9;
    } else {
      duty[pairs[k / 20 % 4][0] - 1] = 1.0;
      duty[pairs[k / 20 % 4][1] - 1] = 0.5;
    }
  }
  EXPECT_EQ(refusal_of(clean_recording(fly(nominal_vehicle(), {dead}, commands, 4).recording, 8)), "");
}

TEST(Response, ClocksSecondsApartAreRefusedWithTheShift) {
  for (const double shift : {-4.0, 0.6, 3.0}) {
    Recording recording = flown();
    for (PoseSample& pose : recording.poses) pose.time_s += shift;
    const std::string why = refusal_of(clean_recording(recording, 8));
    EXPECT_TRUE(says(why, shift > 0 ? "s late against the commands" : "s early against the commands")) << why;
    char number[8];
    std::snprintf(number, sizeof(number), "%.1f s", std::abs(shift));
    EXPECT_TRUE(says(why, number)) << why;
  }
}

TEST(Response, TheFileOfAnotherVehicleIsRefused) {
  const Recording recording = flown();
  EXPECT_TRUE(says(refusal_of(recording, load_vehicle(ATMOS_ROOT "/config/vehicle/astrobee_ground.yaml")),
                   "times as strongly"));
  Vehicle other = nominal_vehicle();
  std::rotate(other.thrusters.begin(), other.thrusters.begin() + 3, other.thrusters.end());
  EXPECT_TRUE(says(refusal_of(recording, other), "is it the file of this robot"));
  Vehicle heavy = nominal_vehicle();
  heavy.mass_kg /= 5.0;
  heavy.inertia_kg_m2 /= 5.0;
  EXPECT_TRUE(says(refusal_of(recording, heavy), "times as strongly"));
}

TEST(Response, ValvesWiredCrosswiseAreNamed) {
  Vehicle crossed = nominal_vehicle();
  std::swap(crossed.thrusters[4], crossed.thrusters[5]);
  // Each thruster by itself, in turn.
  std::vector<ThrusterCommand> commands = pulse_commands(kStart, 60.0, 3);
  for (std::size_t k = 0; k < commands.size(); ++k) {
    commands[k].duty.assign(8, 0.0);
    commands[k].duty[(k / 3 * 5) % 8] = 0.6;
  }
  const std::string why = refusal_of(clean_recording(fly(crossed, {}, commands, 4).recording, 8));
  EXPECT_TRUE(says(why, "thrusters 5, 6 push other ways")) << why;
}

TEST(Response, APoseStreamOfAnotherFlightIsRefused) {
  Recording recording = flown();
  recording.poses = fly(nominal_vehicle(), {}, pulse_commands(kStart, 60.0, 8), 9).recording.poses;
  EXPECT_TRUE(says(refusal_of(clean_recording(recording, 8)), "does not follow the commands"));
}

TEST(Response, ARobotThatDoesNotMoveIsNoReasonToRefuse) {
  Recording recording = flown();
  for (ThrusterCommand& command : recording.commands) command.duty.assign(8, 0.0);
  for (std::size_t i = 0; i < recording.poses.size(); ++i)
    recording.poses[i] = {recording.poses[i].time_s, 1e-4 * std::sin(12.9898 * static_cast<double>(i * i)),
                          0.0, 1e-4 * std::sin(78.233 * static_cast<double>(i * i))};
  EXPECT_EQ(refusal_of(clean_recording(recording, 8)), "");
}

}  // namespace
}  // namespace atmos
