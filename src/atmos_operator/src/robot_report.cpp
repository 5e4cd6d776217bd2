#include "atmos_operator/robot_report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace atmos {

namespace {

constexpr double kLowBattery = 0.25, kVeryLowBattery = 0.12;  // shares
constexpr double kLowGas_kg = 0.05, kVeryLowGas_kg = 0.01;
constexpr double kCloseBy_m = 0.3;  // between two bodies

template <class... Values>
std::string print(const char* format, Values... values) {
  char text[160];
  std::snprintf(text, sizeof(text), format, values...);
  return text;
}

template <class T>
bool fresh(const std::optional<Seen<T>>& seen, double now_s) {
  return seen && now_s - seen->at_s <= kSilence_s;
}

template <class T, class Describe>
PanelRow row(const std::string& name, const std::optional<Seen<T>>& seen, double now_s,
             const Describe& describe) {
  PanelRow result{name, "–", Health::kUnknown};
  if (!seen) return result;
  if (!fresh(seen, now_s)) {
    result.text = print("silent for %.0f s", now_s - seen->at_s);
    result.health = Health::kBad;
    return result;
  }
  describe(seen->value, result);
  return result;
}

Health below(double value, double warning, double bad) {
  if (!std::isfinite(value)) return Health::kUnknown;
  return value < bad ? Health::kBad : value < warning ? Health::kWarning : Health::kGood;
}

void describe_link(const AutopilotReport& link, PanelRow& out) {
  out.health = link.connected ? Health::kGood : Health::kBad;
  out.text = link.connected ? print("%s, %s, %.1f ms", link.armed ? "armed" : "disarmed", link.mode.c_str(),
                                    1e3 * link.round_trip_s)
                            : "no answer from the autopilot";
}

void describe_supervisor(const SupervisorReport& supervisor, PanelRow& out) {
  using State = SupervisorReport::State;
  static const char* const kNames[] = {"idle",       "preparing", "flying",  "valves closed",
                                       "stabilised", "stopping",  "released"};
  const auto index = static_cast<std::size_t>(supervisor.state);
  out.text = index < std::size(kNames) ? kNames[index] : "unknown";
  if (!supervisor.text.empty()) out.text += ": " + supervisor.text;
  // Flying, it has had what was refused at first.
  if (!supervisor.refusal.empty() && supervisor.state != State::kFlying)
    out.text += "; refused: " + supervisor.refusal;
  out.health = supervisor.killed                       ? Health::kBad
               : supervisor.state == State::kClosed    ? Health::kBad
               : supervisor.state == State::kFlying    ? Health::kGood
               : supervisor.state == State::kPreparing ? Health::kWarning
               : supervisor.state == State::kIdle      ? Health::kUnknown
                                                       : Health::kWarning;
}

void describe_flight_controller(const FlightControllerReport& report, PanelRow& out) {
  out.text = report.flying ? "flying" : "valves closed: " + report.reason;
  out.health = report.flying ? Health::kGood : Health::kWarning;
}

void describe_controller(const ControllerReport& controller, PanelRow& out) {
  static const char* const kNames[] = {"flying", "solver failed: previous plan", "solver failed: braking",
                                       "valves closed", "waiting for set-point and odometry"};
  static const Health kHealth[] = {Health::kGood, Health::kWarning, Health::kBad, Health::kWarning,
                                   Health::kUnknown};
  const auto index = std::min<std::size_t>(static_cast<std::size_t>(controller.mode), std::size(kNames) - 1);
  out.health = kHealth[index];
  out.text = print("%s, solve %.1f ms, %llu late", kNames[index], 1e3 * controller.solve_time_s,
                   static_cast<unsigned long long>(controller.deadline_misses));
}

void describe_gas(const GasReport& gas, PanelRow& out) {
  if (gas.tethered) {
    out = {out.name, "from the hose", Health::kGood};
    return;
  }
  if (!std::isfinite(gas.remaining_kg)) {
    out = {out.name, "no end (not simulated)", Health::kUnknown};
    return;
  }
  out.text = print("%.0f g, bottles at %.0f bar", 1e3 * gas.remaining_kg, 1e-5 * gas.bottle_pressure_pa);
  out.health = below(gas.remaining_kg, kLowGas_kg, kVeryLowGas_kg);
}

void describe_distance(const DistanceReport& report, PanelRow& out) {
  out.text = std::isfinite(report.distance_m) ? print("%.2f m to the nearest", report.distance_m)
                                              : "no other robot seen";
  out.health = below(report.distance_m, kCloseBy_m, 0.0);
  if (!report.held) return;
  out.text = "held: " + report.reason;
  out.health = Health::kBad;
}

}  // namespace

std::vector<PanelRow> panel_rows(const RobotReport& report, double now_s) {
  std::vector<PanelRow> rows;
  rows.push_back(row("Link", report.autopilot, now_s, describe_link));
  // In simulation the flight controller stands in the autopilot's place, and there is no supervisor.
  rows.push_back(report.supervisor
                     ? row("Supervisor", report.supervisor, now_s, describe_supervisor)
                     : row("Flight controller", report.flight_controller, now_s, describe_flight_controller));
  rows.push_back(row("Controller", report.controller, now_s, describe_controller));
  rows.push_back(row("Tracking", report.tracked, now_s, [](bool seen, PanelRow& out) {
    out.text = seen ? "odometry" : "robot not seen";
    out.health = seen ? Health::kGood : Health::kBad;
  }));
  // Said once, when it changes: it does not age.
  rows.push_back({"Mission", report.mission ? report.mission->value : "–",
                  report.mission && report.mission->value == "running" ? Health::kGood : Health::kUnknown});
  rows.push_back(row("Battery", report.battery, now_s, [](const BatteryReport& battery, PanelRow& out) {
    out.text = print("%.0f %%, %.1f V", 100.0 * battery.charge, battery.voltage_v);
    out.health = below(battery.charge, kLowBattery, kVeryLowBattery);
  }));
  rows.push_back(row("Gas", report.gas, now_s, describe_gas));
  rows.push_back(row("Distance", report.distance, now_s, describe_distance));
  return rows;
}

PanelButtons panel_buttons(const RobotReport& report, double now_s) {
  PanelButtons buttons;
  const bool autopilot = report.autopilot.has_value() || report.supervisor.has_value();
  const bool linked = fresh(report.autopilot, now_s) && report.autopilot->value.connected;
  const bool killed = report.supervisor && report.supervisor->value.killed;
  buttons.kill = buttons.disarm = autopilot;
  buttons.release_kill = killed;
  buttons.arm = linked && !killed;
  buttons.mode = linked;
  buttons.start_mission = report.mission.has_value();
  buttons.stop_mission =
      report.mission && (report.mission->value == "running" || report.mission->value == "finished");
  buttons.release_hold = report.distance && report.distance->value.held;
  return buttons;
}

std::vector<std::string> robots_among(const std::vector<std::pair<std::string, std::string>>& topics) {
  static const std::string kName = "/thruster_command";
  std::vector<std::string> robots;
  for (const auto& [name, type] : topics) {
    const bool ends =
        name.size() > kName.size() && name.compare(name.size() - kName.size(), kName.size(), kName) == 0;
    if (ends && type == "atmos_msgs/ThrusterCommand")
      robots.push_back(name.substr(0, name.size() - kName.size()));
  }
  std::sort(robots.begin(), robots.end());
  robots.erase(std::unique(robots.begin(), robots.end()), robots.end());
  return robots;
}

}  // namespace atmos
