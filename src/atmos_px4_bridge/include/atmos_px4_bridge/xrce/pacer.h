// When the line may take the next frame: at most kBurst bytes back to back, and kShare of the line's rate on
// average, so that the flight controller's receive buffer (256 bytes) never overflows.
#pragma once

#include <algorithm>
#include <cstddef>

namespace atmos::xrce {

class Pacer {
 public:
  static constexpr double kBurst = 200.0;  // bytes
  static constexpr double kShare = 0.5;

  explicit Pacer(double bytes_per_s) : bytes_per_s_(kShare * bytes_per_s) {}

  void advance(double now_s) {
    if (now_s > last_s_) room_ = std::min(kBurst, room_ + (now_s - last_s_) * bytes_per_s_);
    last_s_ = now_s;
  }
  // A frame larger than a burst goes when the line has been silent for long enough.
  bool takes(std::size_t size) const { return room_ >= std::min(static_cast<double>(size), kBurst); }
  // What is urgent may overdraw the room.
  void spend(std::size_t size) { room_ -= static_cast<double>(size); }

 private:
  double bytes_per_s_, room_ = kBurst, last_s_ = 0.0;
};

}  // namespace atmos::xrce
