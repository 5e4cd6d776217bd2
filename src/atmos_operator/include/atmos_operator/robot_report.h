// What the operator's panel shows of a robot, and which of its buttons make sense.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace atmos {

// A value and when it came. Times are seconds of one clock of the caller's.
template <class T>
struct Seen {
  T value;
  double at_s;
};

struct AutopilotReport {
  bool connected;
  bool armed;
  std::string mode;
  double round_trip_s;
};

struct SupervisorReport {
  // As in atmos_msgs/SupervisorStatus.
  enum class State : std::uint8_t { kIdle, kPreparing, kFlying, kClosed, kStabilised, kStopping, kReleased };
  State state;
  bool killed;
  std::string text, refusal;
};

struct ControllerReport {
  // As in atmos_msgs/NmpcStatus.
  enum class Mode : std::uint8_t { kSolved, kPreviousPlan, kBraking, kClosed, kWaiting };
  Mode mode;
  double solve_time_s;
  std::uint64_t deadline_misses;
};

struct FlightControllerReport {
  bool flying;
  std::string reason;
};

struct BatteryReport {
  double charge;  // share, NaN when not known
  double voltage_v;
};

struct GasReport {
  double remaining_kg;
  double bottle_pressure_pa;
  bool tethered;
};

struct DistanceReport {
  double distance_m;
  bool held;
  std::string reason;
};

// Everything optional: what has not been heard is not there.
struct RobotReport {
  std::optional<Seen<AutopilotReport>> autopilot;
  std::optional<Seen<SupervisorReport>> supervisor;
  std::optional<Seen<ControllerReport>> controller;
  std::optional<Seen<FlightControllerReport>> flight_controller;
  std::optional<Seen<BatteryReport>> battery;
  std::optional<Seen<GasReport>> gas;
  std::optional<Seen<std::string>> mission;  // as in MissionState
  std::optional<Seen<DistanceReport>> distance;
  std::optional<Seen<bool>> tracked;  // odometry came (true), or mocap says that it is lost
};

// Age at which a value says nothing any more.
inline constexpr double kSilence_s = 2.0;

enum class Health { kUnknown, kGood, kWarning, kBad };

struct PanelRow {
  std::string name, text;
  Health health = Health::kUnknown;
};

// Link, supervisor, controller, tracking, mission, battery, gas, distance: always these rows, in this order.
std::vector<PanelRow> panel_rows(const RobotReport& report, double now_s);

struct PanelButtons {
  bool arm = false, disarm = false, kill = false, release_kill = false, mode = false;
  bool start_mission = false, stop_mission = false;
  bool release_hold = false;
};
// Disarming and killing never depend on a link or on fresh values: only on there being an autopilot at all.
PanelButtons panel_buttons(const RobotReport& report, double now_s);

// Namespaces with a thruster_command topic, sorted: (name, type) of every topic in, "/snap" out.
std::vector<std::string> robots_among(const std::vector<std::pair<std::string, std::string>>& topics);

}  // namespace atmos
