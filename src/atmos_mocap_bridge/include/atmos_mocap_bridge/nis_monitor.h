// Whether the configured measurement noise is that of the frames.
#pragma once

namespace atmos {

// The normalised innovation squared (NIS) of a filter whose noise settings are right averages to its degrees
// of freedom (Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and Navigation",
// 2001, 5.4). Averages over about the last `kWindow` frames; a single outlier counts at most like the gate.
class NisMonitor {
 public:
  enum class Verdict {
    kTooFew,       // frames to tell
    kConsistent,   // within a factor of about 1.5 in standard deviation
    kUnderstated,  // frames scatter more than configured: the covariance promises too much
    kOverstated,   // frames scatter less than configured: the filter is slower than it could be
  };
  static constexpr int kWindow = 200;

  NisMonitor(int degrees_of_freedom, double gate) : degrees_(degrees_of_freedom), gate_(gate) {}

  void add(double nis);
  // Mean NIS over its expectation; 0 before any frame.
  double ratio() const { return mean_ / degrees_; }
  Verdict verdict() const;

 private:
  int degrees_;
  double gate_;
  double mean_ = 0.0;
  int count_ = 0;  // up to kWindow
};

}  // namespace atmos
