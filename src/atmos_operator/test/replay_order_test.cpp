#include "atmos_operator/replay_order.h"

#include <gtest/gtest.h>

namespace atmos {
namespace {

std::vector<std::size_t> order(const std::vector<ReplayEvent>& events) {
  std::vector<std::size_t> messages;
  for (const ReplayEvent& event : replay_order(events)) messages.push_back(event.message);
  return messages;
}

constexpr ReplayKind kGoal = ReplayKind::kGoal, kFrame = ReplayKind::kFrame, kCommand = ReplayKind::kCommand;

TEST(ReplayOrder, AtOneInstantGoalsThenFramesThenCommands) {
  const double t = 1234.5;
  EXPECT_EQ(order({{t, kCommand, 0}, {t, kFrame, 1}, {t, kGoal, 2}}), (std::vector<std::size_t>{2, 1, 0}));
  // Stamps of one instant that were summed up differently.
  EXPECT_EQ(order({{t - 1e-9, kCommand, 0}, {t, kFrame, 1}}), (std::vector<std::size_t>{1, 0}));
}

TEST(ReplayOrder, TimeComesFirst) {
  EXPECT_EQ(order({{1000.01, kFrame, 0}, {1000.0, kCommand, 1}, {1000.02, kGoal, 2}}),
            (std::vector<std::size_t>{1, 0, 2}));
}

TEST(ReplayOrder, MessagesOfOneKindKeepTheirOrder) {
  EXPECT_EQ(order({{5.0, kGoal, 3}, {5.0, kGoal, 1}, {5.0, kGoal, 2}}), (std::vector<std::size_t>{3, 1, 2}));
}

}  // namespace
}  // namespace atmos
