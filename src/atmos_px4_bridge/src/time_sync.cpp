#include "atmos_px4_bridge/time_sync.h"

#include <algorithm>
#include <cmath>

namespace atmos {

namespace {

// Gains of a second-order tracking filter at 10 exchanges per second: fast at first, then slow.
constexpr double kOffsetGain = 0.05, kSkewGain = 0.0005;  // 1, 1 per exchange
constexpr double kTripSlack = 3e-3;                       // s above the best trip that still counts
constexpr double kTripGrowth = 1.02;                      // per exchange: the line may have become slower
constexpr double kJump = 0.5;                             // s: a clock was set; the past says nothing
constexpr double kMaxSkew = 1e-3;

}  // namespace

void TimeSync::on_exchange(double sent_s, double remote_s, double received_s) {
  const double trip = received_s - sent_s;
  if (!(trip >= 0.0) || !std::isfinite(remote_s)) return;
  best_trip_ = std::min(trip, best_trip_ * kTripGrowth + 1e-6);
  const double offset = 0.5 * (sent_s + received_s) - remote_s;
  const double dt = remote_s - reference_;
  if (exchanges_ == 0 || dt < 0.0 || std::abs(offset - (offset_ + skew_ * dt)) > kJump) {
    offset_ = offset;
    skew_ = 0.0;
    exchanges_ = 1;
    reference_ = remote_s;
    return;
  }
  if (trip > best_trip_ + kTripSlack) return;
  ++exchanges_;
  const double predicted = offset_ + skew_ * dt, error = offset - predicted;
  const double gain = std::max(kOffsetGain, 1.0 / exchanges_);
  offset_ = predicted + gain * error;
  if (dt > 0.0 && exchanges_ > 20) skew_ = std::clamp(skew_ + kSkewGain * error / dt, -kMaxSkew, kMaxSkew);
  reference_ = remote_s;
}

std::optional<double> TimeSync::to_local(double remote_s) const {
  if (!known()) return std::nullopt;
  return remote_s + offset_ + skew_ * (remote_s - reference_);
}

}  // namespace atmos
