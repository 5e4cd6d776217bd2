#include "atmos_mocap_bridge/nis_monitor.h"

#include <algorithm>

namespace atmos {

namespace {

constexpr int kEnough = 100;  // frames: the mean of 6 degrees of freedom then scatters by 6 %
constexpr double kUpper = 2.0, kLower = 0.45;

}  // namespace

void NisMonitor::add(double nis) {
  // An innovation that is not a number is beyond every gate.
  const double bounded = nis <= gate_ ? nis : gate_;
  count_ = std::min(count_ + 1, kWindow);
  mean_ += (bounded - mean_) / count_;
}

NisMonitor::Verdict NisMonitor::verdict() const {
  if (count_ < kEnough) return Verdict::kTooFew;
  if (ratio() > kUpper) return Verdict::kUnderstated;
  if (ratio() < kLower) return Verdict::kOverstated;
  return Verdict::kConsistent;
}

}  // namespace atmos
