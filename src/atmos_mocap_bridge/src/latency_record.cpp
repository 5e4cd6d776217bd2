#include "atmos_mocap_bridge/latency_record.h"

#include <algorithm>

namespace atmos {

void LatencyRecord::add(double seconds) {
  if (values_.size() < kSize)
    values_.push_back(seconds);
  else
    values_[next_] = seconds;
  next_ = (next_ + 1) % kSize;
}

LatencyRecord::Summary LatencyRecord::summary() const {
  if (values_.empty()) return {0.0, 0.0, 0.0, 0};
  std::vector<double> sorted = values_;
  std::sort(sorted.begin(), sorted.end());
  return {sorted[sorted.size() / 2], sorted[sorted.size() * 99 / 100], sorted.back(), sorted.size()};
}

}  // namespace atmos
