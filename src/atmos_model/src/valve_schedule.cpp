#include "atmos_model/valve_schedule.h"

#include <algorithm>
#include <cmath>

namespace atmos {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kJoinTolerance = 1e-3;  // s (docs/conventions.md)
constexpr double kSameInstant = 1e-9;    // s, below the resolution of a stamp
constexpr std::size_t kReserved = 32;    // intervals a valve: who forgets every second never allocates

bool well_formed(const ThrusterCommand& command, std::size_t valves, Actuation actuation) {
  if (command.duty.size() != valves || !std::isfinite(command.stamp_s)) return false;
  if (!std::isfinite(command.period_s) || command.period_s <= 0.0) return false;
  const double least = actuation == Actuation::kOnOff ? 0.0 : -1.0;
  return std::all_of(command.duty.begin(), command.duty.end(),
                     [least](double duty) { return duty >= least && duty <= 1.0; });
}

}  // namespace

ValveSchedule::ValveSchedule(int valve_count, ValveTiming timing, Actuation actuation)
    : timing_(std::move(timing)), actuation_(actuation), commanded_(static_cast<std::size_t>(valve_count)) {
  timing_.dead_since_s.resize(commanded_.size(), kInfinity);
  timing_.stuck_open_since_s.resize(commanded_.size(), kInfinity);
  for (std::vector<Interval>& intervals : commanded_) intervals.reserve(kReserved);
}

ValveSchedule::Taken ValveSchedule::add(const ThrusterCommand& command, double now_s) {
  if (!well_formed(command, commanded_.size(), actuation_)) return Taken::kMalformed;
  const double start = command.stamp_s + timing_.command_delay_s;
  const double end = start + command.period_s;
  if (command.stamp_s < newest_stamp_ || command.stamp_s + command.period_s <= now_s) return Taken::kExpired;

  const bool late = now_s > command.stamp_s + kSameInstant;
  const double from = late ? std::max(start, now_s + timing_.command_delay_s) : start;
  const bool joins_previous = !late && std::abs(start - until_) < kJoinTolerance;
  for (std::size_t i = 0; i < commanded_.size(); ++i) {
    std::vector<Interval>& intervals = commanded_[i];
    const bool was_open_to_the_end =
        !intervals.empty() && std::abs(intervals.back().close_s - until_) < kSameInstant;
    while (!intervals.empty() && intervals.back().open_s >= from) intervals.pop_back();
    if (!intervals.empty()) intervals.back().close_s = std::min(intervals.back().close_s, from);

    const double duty = command.duty[i];
    const double level = actuation_ == Actuation::kOnOff ? 1.0 : duty;
    const double close = actuation_ == Actuation::kOnOff ? start + duty * command.period_s : end;
    if (duty == 0.0 || close <= from) continue;
    const bool goes_on =
        !intervals.empty() && intervals.back().level == level &&
        (from - intervals.back().close_s < kSameInstant || (joins_previous && was_open_to_the_end));
    if (goes_on) {
      intervals.back().close_s = close;
    } else {
      intervals.push_back({from, close, level});
    }
  }
  if (std::isnan(first_stamp_)) first_stamp_ = command.stamp_s;
  newest_stamp_ = command.stamp_s;
  until_ = end;
  return late ? Taken::kLate : Taken::kInTime;
}

std::vector<ValveSchedule::Interval>::const_iterator ValveSchedule::first_opening_after(
    const std::vector<Interval>& intervals, double t) const {
  return std::upper_bound(intervals.begin(), intervals.end(), t,
                          [this](double time, const Interval& interval) { return time < opening(interval); });
}

void ValveSchedule::openings(double t, double* out) const {
  for (std::size_t i = 0; i < commanded_.size(); ++i) {
    out[i] = 0.0;
    if (t >= timing_.dead_since_s[i]) continue;
    if (t >= timing_.stuck_open_since_s[i]) {
      out[i] = 1.0;
      continue;
    }
    const auto& intervals = commanded_[i];
    // Intervals close in the order in which they open, so that the last one opened by t decides.
    const auto next = first_opening_after(intervals, t);
    if (next != intervals.begin() && t < closing(*(next - 1))) out[i] = (next - 1)->level;
  }
}

std::vector<double> ValveSchedule::openings(double t) const {
  std::vector<double> out(commanded_.size());
  openings(t, out.data());
  return out;
}

double ValveSchedule::next_edge(double t) const {
  double edge = kInfinity;
  for (std::size_t i = 0; i < commanded_.size(); ++i) {
    for (const double failure : {timing_.dead_since_s[i], timing_.stuck_open_since_s[i]}) {
      if (failure > t) edge = std::min(edge, failure);
    }
    const auto& intervals = commanded_[i];
    const auto opens = first_opening_after(intervals, t);
    if (opens != intervals.end()) edge = std::min(edge, opening(*opens));
    const auto closes =
        std::upper_bound(intervals.begin(), intervals.end(), t,
                         [this](double time, const Interval& interval) { return time < closing(interval); });
    if (closes != intervals.end()) edge = std::min(edge, closing(*closes));
  }
  return edge;
}

void ValveSchedule::forget_before(double t) {
  for (auto& intervals : commanded_) {
    const auto keep = std::find_if(intervals.begin(), intervals.end(), [&](const Interval& interval) {
      return std::max(closing(interval), opening(interval)) >= t;
    });
    // The newest one may still be joined by the next command.
    if (keep != intervals.begin())
      intervals.erase(intervals.begin(), keep == intervals.end() ? keep - 1 : keep);
  }
}

std::size_t ValveSchedule::stored_intervals() const {
  std::size_t count = 0;
  for (const auto& intervals : commanded_) count += intervals.size();
  return count;
}

}  // namespace atmos
