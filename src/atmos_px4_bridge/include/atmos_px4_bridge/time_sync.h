// Offset and skew between our clock and the autopilot's, from request-reply exchanges. Times are seconds,
// local ones of ROS.
#pragma once

#include <optional>

namespace atmos {

class TimeSync {
 public:
  // We asked at `sent_s`, the autopilot's clock showed `remote_s`, the reply came at `received_s`. Exchanges
  // that took much longer than the best do not count.
  void on_exchange(double sent_s, double remote_s, double received_s);
  // The autopilot started anew.
  void reset() { *this = TimeSync(); }

  bool known() const { return exchanges_ > 0; }
  // Our time of an instant of the autopilot's clock; nothing before the first exchange.
  std::optional<double> to_local(double remote_s) const;
  double offset_s() const { return offset_; }         // ours minus the autopilot's, at the last exchange
  double skew() const { return skew_; }               // rate of change of the offset, s/s
  double round_trip_s() const { return best_trip_; }  // best of the recent ones

 private:
  double offset_ = 0.0, skew_ = 0.0, best_trip_ = 1.0;
  double reference_ = 0.0;  // remote time of offset_
  int exchanges_ = 0;
};

}  // namespace atmos
