#include "atmos_operator/replay_order.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace atmos {

namespace {

constexpr double kInstantsPerSecond = 1e4;

std::pair<long long, int> place(const ReplayEvent& event) {
  return {std::llround(event.time_s * kInstantsPerSecond), static_cast<int>(event.kind)};
}

}  // namespace

std::vector<ReplayEvent> replay_order(std::vector<ReplayEvent> events) {
  std::stable_sort(events.begin(), events.end(),
                   [](const ReplayEvent& a, const ReplayEvent& b) { return place(a) < place(b); });
  return events;
}

}  // namespace atmos
