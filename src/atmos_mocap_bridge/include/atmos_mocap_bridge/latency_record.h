// How long the newest frames took, as median, 99 % quantile and maximum.
#pragma once

#include <cstddef>
#include <vector>

namespace atmos {

// Keeps the newest `kSize` values; adding allocates nothing.
class LatencyRecord {
 public:
  static constexpr std::size_t kSize = 10000;
  struct Summary {
    double median_s, p99_s, max_s;
    std::size_t count;
  };

  LatencyRecord() { values_.reserve(kSize); }
  void add(double seconds);
  Summary summary() const;  // zeros before any value

 private:
  std::vector<double> values_;
  std::size_t next_ = 0;
};

}  // namespace atmos
