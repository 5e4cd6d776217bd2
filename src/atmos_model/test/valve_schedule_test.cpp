#include "atmos_model/valve_schedule.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "nominal.h"

namespace atmos {
namespace {

using Taken = ValveSchedule::Taken;
constexpr double kPeriod = 0.1;
constexpr double kBefore = 1e-6;  // a ROS time just before an edge
const double kInfinity = std::numeric_limits<double>::infinity();

ThrusterCommand command(double offset_s, std::vector<double> duty, double period_s = kPeriod) {
  return {kStart + offset_s, period_s, std::move(duty)};
}
double opening(const ValveSchedule& valves, double offset_s) { return valves.openings(kStart + offset_s)[0]; }
// Every edge in [begin, end] as offsets from kStart at which the first valve really changes.
std::vector<double> changes(const ValveSchedule& valves, double begin_s, double end_s) {
  std::vector<double> found;
  double t = kStart + begin_s, before = valves.openings(t)[0];
  while ((t = valves.next_edge(t)) <= kStart + end_s) {
    const double now = valves.openings(t)[0];
    if (now != before) found.push_back(t - kStart);
    before = now;
  }
  return found;
}
void expect_changes(const ValveSchedule& valves, const std::vector<double>& expected) {
  const std::vector<double> found = changes(valves, -10.0, 10.0);
  ASSERT_EQ(found.size(), expected.size()) << ::testing::PrintToString(found);
  for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], expected[i], 5e-7);
}

TEST(ValveSchedule, OpensFromTheStampForTheShareOfThePeriod) {
  ValveSchedule valves(2);
  EXPECT_EQ(valves.next_edge(kStart), kInfinity);
  EXPECT_TRUE(std::isnan(valves.first_stamp()));
  EXPECT_EQ(valves.add(command(0.0, {0.3, 0.0})), Taken::kInTime);
  expect_changes(valves, {0.0, 0.03});
  EXPECT_EQ(valves.openings(kStart), (std::vector<double>{1.0, 0.0}));  // right-continuous
  EXPECT_EQ(opening(valves, 0.03 - kBefore), 1.0);
  EXPECT_EQ(opening(valves, 0.03 + kBefore), 0.0);
  EXPECT_EQ(valves.first_stamp(), kStart);
  EXPECT_EQ(valves.commanded_until(), kStart + kPeriod);
}

TEST(ValveSchedule, JoinsPeriodsWhoseGapOrOverlapIsUnderAMillisecond) {
  for (const double gap : {0.0, 0.0009, -0.0009}) {
    ValveSchedule valves(1);
    valves.add(command(0.0, {1.0}));
    valves.add(command(kPeriod + gap, {0.5}));
    expect_changes(valves, {0.0, kPeriod + gap + 0.05});
  }
  ValveSchedule apart(1);
  apart.add(command(0.0, {1.0}));
  apart.add(command(kPeriod + 0.0011, {0.5}));
  expect_changes(apart, {0.0, 0.1, 0.1011, 0.1511});
}

TEST(ValveSchedule, ANewerCommandReplacesTheRestOfAnOlderOne) {
  ValveSchedule valves(1);
  valves.add(command(0.0, {1.0}));
  EXPECT_EQ(valves.add(command(0.04, {0.0})), Taken::kInTime);
  expect_changes(valves, {0.0, 0.04});
  EXPECT_EQ(valves.add(command(0.02, {1.0})), Taken::kExpired);  // out of order
  EXPECT_EQ(valves.add(command(0.04, {0.5})), Taken::kInTime);  // the same stamp again: the later word counts
  expect_changes(valves, {0.0, 0.09});
}

TEST(ValveSchedule, ALateCommandActsOnlyForTheRestOfItsPeriod) {
  ValveSchedule valves(1);
  valves.add(command(0.0, {1.0}), kStart);
  EXPECT_EQ(valves.add(command(kPeriod, {0.8}), kStart + 0.13), Taken::kLate);
  expect_changes(valves, {0.0, 0.1, 0.13, 0.18});
  EXPECT_EQ(valves.add(command(0.2, {0.3}), kStart + 0.25), Taken::kLate);  // its pulse is over
  expect_changes(valves, {0.0, 0.1, 0.13, 0.18});
  EXPECT_EQ(valves.add(command(0.3, {1.0}), kStart + 0.4), Taken::kExpired);
  expect_changes(valves, {0.0, 0.1, 0.13, 0.18});
}

TEST(ValveSchedule, ClosesWhenNothingNewComes) {
  ValveSchedule valves(1);
  valves.add(command(0.0, {1.0}));
  EXPECT_EQ(opening(valves, 0.1 - kBefore), 1.0);
  EXPECT_EQ(opening(valves, 0.1 + kBefore), 0.0);
  EXPECT_EQ(valves.next_edge(kStart + 0.1 + kBefore), kInfinity);
}

TEST(ValveSchedule, RefusesMalformedCommandsAndStaysAsItWas) {
  ValveSchedule valves(1);
  valves.add(command(0.0, {0.5}));
  const double nan = std::nan("");
  for (const ThrusterCommand& bad :
       {command(0.1, {1.1}), command(0.1, {-0.1}), command(0.1, {nan}), command(0.1, {}),
        command(0.1, {0.5, 0.5}), command(nan, {0.5}), command(kInfinity, {0.5}), command(0.1, {0.5}, 0.0),
        command(0.1, {0.5}, -0.1), command(0.1, {0.5}, nan)})
    EXPECT_EQ(valves.add(bad), Taken::kMalformed);
  expect_changes(valves, {0.0, 0.05});
}

TEST(ValveSchedule, CommandDelayShiftsEverything) {
  ValveTiming timing;
  timing.command_delay_s = 0.03;
  ValveSchedule valves(1, timing);
  valves.add(command(0.0, {1.0}));
  valves.add(command(0.1, {0.5}));
  expect_changes(valves, {0.03, 0.18});
  EXPECT_EQ(valves.first_stamp(), kStart);
  EXPECT_NEAR(valves.commanded_until(), kStart + 0.23, 5e-7);
}

TEST(ValveSchedule, ValveDelaysMoveJoinedIntervals) {
  ValveTiming timing;
  timing.open_delay_s = 0.02;
  timing.close_delay_s = 0.005;
  ValveSchedule valves(1, timing);
  valves.add(command(0.0, {1.0}));
  valves.add(command(0.1, {0.5}));   // joined: no second opening delay
  valves.add(command(0.3, {0.12}));  // [0.32, 0.317): nothing
  valves.add(command(0.4, {0.3}));
  expect_changes(valves, {0.02, 0.155, 0.42, 0.435});
  timing.open_delay_s = 0.0;
  timing.close_delay_s = 0.08;
  ValveSchedule sticky(1, timing);
  sticky.add(command(0.0, {0.5}));
  sticky.add(command(0.1, {0.5}));
  expect_changes(sticky, {0.0, 0.23});
}

TEST(ValveSchedule, ADeadValveStaysShut) {
  ValveTiming timing;
  timing.dead_since_s = {kStart + 0.04};
  ValveSchedule valves(2, timing);
  valves.add(command(0.0, {1.0, 1.0}));
  expect_changes(valves, {0.0, 0.04});
  EXPECT_EQ(valves.openings(kStart + 0.05), (std::vector<double>{0.0, 1.0}));
}

TEST(ValveSchedule, PropellersHoldASignedLevel) {
  ValveSchedule valves(1, {}, Actuation::kContinuous);
  valves.add(command(0.0, {-0.25}));
  valves.add(command(0.1, {0.5}));
  EXPECT_EQ(opening(valves, 0.05), -0.25);
  EXPECT_EQ(opening(valves, 0.15), 0.5);
  EXPECT_EQ(opening(valves, 0.2 + kBefore), 0.0);
  expect_changes(valves, {0.0, 0.1, 0.2});
  EXPECT_EQ(valves.add(command(0.2, {-1.5})), Taken::kMalformed);
}

TEST(ValveSchedule, OnlineAndOfflineUseAgreeAndADayNeedsBoundedMemory) {
  ValveTiming timing;
  timing.open_delay_s = 0.004;
  timing.close_delay_s = 0.007;
  timing.command_delay_s = 0.01;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-0.3, 1.3);
  ValveSchedule online(1, timing), offline(1, timing);
  std::vector<ThrusterCommand> commands;
  for (int k = 0; k < 500; ++k)
    commands.push_back(command(kPeriod * k, {std::min(1.0, std::max(0.0, uniform(random)))}));
  for (const ThrusterCommand& c : commands) offline.add(c);
  for (const ThrusterCommand& c : commands) {
    online.add(c, c.stamp_s);
    for (double t = c.stamp_s; t < c.stamp_s + kPeriod - 1e-4; t += 0.00037)
      ASSERT_EQ(online.openings(t), offline.openings(t)) << t - kStart;
    online.forget_before(c.stamp_s);
  }
  // 24 h: had nothing been dropped, answering would need the whole day's 432,000 intervals.
  ValveSchedule day(1);
  const int periods = 864000;
  for (int k = 0; k < periods; ++k) {
    day.add(command(kPeriod * k, {k % 2 ? 0.5 : 0.25}));
    day.forget_before(kStart + kPeriod * k);
  }
  EXPECT_LE(day.stored_intervals(), 3u);
  EXPECT_EQ(opening(day, kPeriod * (periods - 1) + 0.02), 1.0);
}

}  // namespace
}  // namespace atmos
