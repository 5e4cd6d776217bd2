// PWM timing (docs/architecture.md, "The PWM grid"): from commands to the exact instants at which valves open
// and close.
#pragma once

#include <cstddef>
#include <limits>
#include <vector>

namespace atmos {

// Times are ROS seconds. One command: what every valve does over the period that starts at stamp_s.
struct ThrusterCommand {
  double stamp_s = 0.0;
  double period_s = 0.0;
  // On/off valves, [0, 1]: share of the period, from its start, during which the valve is open.
  // Propellers, [-1, 1]: signed share of full thrust, held over the period.
  std::vector<double> duty;
};

// How the actuators carry out a duty.
enum class Actuation { kOnOff, kContinuous };

// Timing faults of commands and valves; the effects set them (docs/effects.md).
struct ValveTiming {
  double command_delay_s = 0.0;
  double open_delay_s =
      0.0;  // a joined open interval [a, b) becomes [a + open, b + close); nothing if that is empty
  double close_delay_s = 0.0;
  // One per valve; +inf, or left out: healthy.
  std::vector<double> dead_since_s;        // shut from then on
  std::vector<double> stuck_open_since_s;  // open from then on, unless dead
};

// Commands in, openings out. Periods whose gap or overlap is under 1 ms are joined; a newer command replaces
// the rest of an older one from its own stamp; a late one acts only for the rest of its period; when a period
// is over and nothing new has come the valves are closed. Works online and for whole recordings.
class ValveSchedule {
 public:
  // How a command was taken.
  enum class Taken { kInTime, kLate, kExpired, kMalformed };

  explicit ValveSchedule(int valve_count, ValveTiming timing = {}, Actuation actuation = Actuation::kOnOff);

  // Takes a command at `now_s`; -inf means it was there in time (recordings). A command whose period is over,
  // or whose stamp lies before the newest one, is kExpired and ignored. kMalformed and ignored: wrong size,
  // non-finite numbers, period <= 0, duty outside its range.
  Taken add(const ThrusterCommand& command, double now_s = -std::numeric_limits<double>::infinity());

  int valve_count() const { return static_cast<int>(commanded_.size()); }
  // Opening of every valve at `t`, right-continuous: 1 open, 0 closed; for propellers the signed share of
  // full thrust.
  void openings(double t, double* out) const;
  std::vector<double> openings(double t) const;
  // The first instant after `t` at which an opening may change, as far as known; +inf if none.
  double next_edge(double t) const;
  // Drops what ended before `t`, so that a long run needs bounded memory.
  void forget_before(double t);
  // Open intervals held, over all valves: what forget_before() bounds.
  std::size_t stored_intervals() const;
  // Stamp of the first command taken: t0 of the effects; NaN before.
  double first_stamp() const { return first_stamp_; }
  // End of the newest period, after command_delay_s; -inf before any command.
  double commanded_until() const { return until_; }

 private:
  struct Interval {
    double open_s;
    double close_s;
    double level;
  };
  // Valve delays move every edge by a constant, so that intervals are stored as commanded and moved when
  // asked for.
  double opening(const Interval& commanded) const { return commanded.open_s + timing_.open_delay_s; }
  double closing(const Interval& commanded) const { return commanded.close_s + timing_.close_delay_s; }
  std::vector<Interval>::const_iterator first_opening_after(const std::vector<Interval>& intervals,
                                                            double t) const;

  ValveTiming timing_;
  Actuation actuation_;
  std::vector<std::vector<Interval>> commanded_;  // per valve, joined, in order, after command_delay_s
  double first_stamp_ = std::numeric_limits<double>::quiet_NaN();
  double newest_stamp_ = -std::numeric_limits<double>::infinity();
  double until_ = -std::numeric_limits<double>::infinity();
};

}  // namespace atmos
