#include "atmos_sim2real/statement.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

#include "atmos_sim2real/force_field.h"

namespace atmos {

namespace {

std::string percent(double ratio) { return short_number(100.0 * ratio) + " %"; }
std::string millimetres(double metres) { return short_number(1e3 * metres) + " mm"; }
std::string place_in_body(double x_m, double y_m) {
  return millimetres(std::abs(x_m)) + (x_m < 0.0 ? " behind and " : " in front and ") +
         millimetres(std::abs(y_m)) + (y_m < 0.0 ? " to the right" : " to the left") +
         " of the geometric centre";
}
std::string milliseconds(double seconds) { return short_number(1e3 * seconds) + " ms"; }
std::string newtons(double force) {
  return std::abs(force) < 1.0 ? short_number(1e3 * force) + " mN" : short_number(force) + " N";
}
std::string degrees(double radians) { return short_number(180.0 / M_PI * radians) + " deg"; }
std::string thruster(int number) { return "thruster " + std::to_string(number); }
std::string place(double x, double y) { return "(" + short_number(x) + ", " + short_number(y) + ") m"; }

// "3 % more than" or "3 % less than".
std::string compared(double factor) {
  return percent(std::abs(factor - 1.0)) + (factor < 1.0 ? " less than" : " more than");
}

double largest(const GridRows& rows) {
  double value = 0.0;
  for (const auto& row : rows) {
    for (const double v : row) value = std::max(value, std::abs(v));
  }
  return value;
}

double range(const GridRows& rows) {
  double low = rows.front().front(), high = low;
  for (const auto& row : rows) {
    const auto [a, b] = std::minmax_element(row.begin(), row.end());
    low = std::min(low, *a);
    high = std::max(high, *b);
  }
  return high - low;
}

// A formula, or how it begins.
std::string start_of(const std::string& formula) {
  constexpr std::size_t kMost = 160;
  return formula.size() <= kMost ? formula : formula.substr(0, kMost) + " ...";
}

struct Sentence {
  const std::vector<Began>& recordings;
  double onset_deviation_s;

  // The recording that a time lies in: the last that had begun.
  const Began& recording_at(double time_s) const {
    const Began* best = nullptr;
    for (const Began& began : recordings) {
      if (best == nullptr ||
          (began.at_s <= time_s ? best->at_s > time_s || began.at_s > best->at_s : began.at_s < best->at_s))
        best = &began;
    }
    return *best;
  }

  // Before any recording began.
  bool from_the_start(double since_s) const { return since_s <= recording_at(since_s).at_s; }

  std::string time(double time_s, double deviation_s) const {
    const Began& began = recording_at(time_s);
    return short_number(time_s - began.at_s) +
           (deviation_s >= 1.0 ? " +- " + short_number(deviation_s) : "") + " s after the first command" +
           (recordings.size() > 1 ? " of " + began.recording : "");
  }

  // Since when a failure holds; nothing when it has from the start.
  std::string from(double since_s) const {
    return from_the_start(since_s) ? "" : " from " + time(since_s, onset_deviation_s) + " on";
  }

  std::string operator()(const ThrustScale& e) const {
    return "every thruster pushes " + compared(e.factor) + " the vehicle file says";
  }
  std::string operator()(const ThrusterEfficiency& e) const {
    return thruster(e.thruster) + " pushes " + compared(e.factor) + " the vehicle file says";
  }
  std::string operator()(const ThrusterWeakSince& e) const {
    return thruster(e.thruster) + " pushes " + compared(e.factor) + " the vehicle file says" +
           from(e.since_s);
  }
  std::string operator()(const ThrusterDead& e) const {
    if (from_the_start(e.since_s)) return thruster(e.thruster) + " has been dead from the start (0 s)";
    return thruster(e.thruster) + " is dead" + from(e.since_s);
  }
  std::string operator()(const ThrusterStuckOpen& e) const {
    return thruster(e.thruster) + " is stuck open" + from(e.since_s);
  }
  std::string operator()(const CommandDelay& e) const {
    return "commands act " + milliseconds(e.delay_s) + " later than they are stamped";
  }
  std::string operator()(const ValveDelay& e) const {
    return "valves open " + milliseconds(e.open_s) + " and close " + milliseconds(e.close_s) +
           " after their command";
  }
  std::string operator()(const ThrustRise& e) const {
    return "thrust follows its valve with a time constant of " + milliseconds(e.time_constant_s);
  }
  std::string operator()(const SupplyCoupling& e) const {
    return "each further open valve takes " + percent(e.fraction_per_open_thruster) + " of the thrust";
  }
  std::string operator()(const SupplyDroop& e) const {
    return "each open valve lowers the supply by " + percent(e.loss_per_s) +
           " per second, which returns within " + short_number(e.recovery_s) + " s";
  }
  std::string operator()(const PressureDecay& e) const {
    return "thrust falls by " + percent(e.fraction_per_kg / 10.0) + " per 0.1 kg of gas used";
  }
  std::string operator()(const ThrusterLeak& e) const {
    return thruster(e.thruster) + " leaks " + percent(e.fraction) + " of its thrust, open or shut";
  }
  std::string operator()(const ThrusterLeakSince& e) const {
    return thruster(e.thruster) + " leaks " + percent(e.fraction) + " of its thrust" + from(e.since_s);
  }
  std::string operator()(const ThrusterMisalignment& e) const {
    return thruster(e.thruster) + " points " + degrees(e.angle_rad) +
           " away from where the vehicle file says";
  }
  std::string operator()(const MassError& e) const {
    return "the robot weighs " + compared(e.factor) + " the vehicle file says";
  }
  std::string operator()(const InertiaError& e) const {
    return "the moment of inertia is " + compared(e.factor) + " the vehicle file says";
  }
  std::string operator()(const MassDepletion& e) const {
    return "the robot loses " + short_number(1e3 * e.kg_per_open_second) + " g per second and open valve";
  }
  std::string operator()(const ComOffset& e) const {
    return "the centre of mass lies " + place_in_body(e.x_m, e.y_m);
  }
  std::string operator()(const Slosh& e) const {
    return short_number(e.mass_kg) + " kg inside the robot swing at " + short_number(e.frequency_hz) + " Hz";
  }
  std::string operator()(const FloorTilt& e) const {
    return "the floor rises " + short_number(1e3 * e.slope_x) + " mm/m along x and " +
           short_number(1e3 * e.slope_y) + " mm/m along y";
  }
  std::string operator()(const FloorUnevenness& e) const {
    return "the floor is uneven: its height varies by " + millimetres(range(e.height_m)) + " over the map";
  }
  std::string operator()(const Airflow& e) const {
    return "moving air pushes the robot with up to " +
           newtons(std::hypot(largest(e.force_x_n), largest(e.force_y_n))) + "; " +
           short_number(100.0 * share_with_curl(e)) +
           " % of its variation over the floor has curl, which slopes have not";
  }
  std::string operator()(const Tether& e) const {
    return "a tether pulls towards " + place(e.anchor_x_m, e.anchor_y_m) + " with " +
           short_number(e.stiffness_n_m) + " N/m beyond " + short_number(e.slack_m) + " m";
  }
  std::string operator()(const ViscousDrag& e) const {
    return "drag of " + short_number(e.linear_n_s_m) + " N s/m against the velocity and " +
           short_number(e.angular_n_m_s) + " N m s against the rotation";
  }
  std::string operator()(const QuadraticDrag& e) const {
    return "drag of " + short_number(e.coefficient_n_s2_m2) + " N s2/m2 times the velocity squared";
  }
  std::string operator()(const CoulombFriction& e) const {
    return "the bearings rub with a friction coefficient of " + short_number(e.coefficient);
  }
  std::string operator()(const FrictionPatch& e) const {
    return "the floor rubs with a coefficient of " + short_number(e.coefficient) + " within " +
           short_number(e.radius_m) + " m of " + place(e.center_x_m, e.center_y_m);
  }
  std::string operator()(const BearingDown& e) const {
    return "bearing " + std::to_string(e.bearing) + " rubs with a coefficient of " +
           short_number(e.coefficient) + from(e.since_s);
  }
  std::string operator()(const ExternalImpulse& e) const {
    if (e.events.empty()) return "0 pushes from outside, 0 N s";
    const ImpulseEvent& first = e.events.front();
    const std::string push = short_number(first.impulse_n_s.norm()) + " N s and " +
                             short_number(first.impulse_yaw_n_m_s) + " N m s, " + time(first.time_s, 0.0);
    if (e.events.size() == 1) return "something pushed the robot once: " + push;
    return "something pushed the robot " + std::to_string(e.events.size()) + " times, first " + push;
  }
  std::string operator()(const FloorVibration& e) const {
    return "a force of " + newtons(e.amplitude_n) + " oscillates at " + short_number(e.frequency_hz) +
           " Hz along " + degrees(e.direction_rad) + " from world x";
  }
  std::string operator()(const MocapLatency& e) const {
    return "poses are stamped " + milliseconds(e.delay_s) + " after the robot was there";
  }
  std::string operator()(const MarkerOffset& e) const {
    return "the tracked point lies " + place_in_body(e.x_m, e.y_m);
  }
  std::string operator()(const YawMisalignment& e) const {
    return "the tracked yaw is " + degrees(e.angle_rad) + " ahead of the body's";
  }
  std::string operator()(const ClockSkew& e) const {
    return "the clock of the poses runs " + short_number(1e6 * e.ratio) + " ppm fast";
  }
  std::string operator()(const Unmodelled& e) const {
    constexpr std::size_t kReadable = 8;  // coefficients; model.yaml holds all
    std::string values;
    for (const auto& [name, coefficient] : e.coefficients)
      values += (values.empty() ? " with " : ", ") + name + " = " + short_number(coefficient.value) + " " +
                coefficient.unit;
    const std::string formulas = "force (" + start_of(e.force_x_n) + ", " + start_of(e.force_y_n) +
                                 ") N, torque " + start_of(e.torque_n_m) + " N m";
    return "a law outside the vocabulary: " + formulas +
           (e.coefficients.size() > kReadable
                ? " with " + std::to_string(e.coefficients.size()) + " coefficients"
                : values);
  }
};

// The manoeuvre in which each kind shows most.
const std::map<std::string, std::string>& manoeuvres() {
  static const std::string pulses =
      "from rest, fire each thruster alone for 0.3 s, five times, at two headings 90 deg apart (3 min)";
  static const std::string lattice =
      "coast at 0.05 m/s with shut valves along straight lines 0.4 m apart over the whole floor, there and "
      "back (5 min)";
  static const std::string coast =
      "coast with shut valves from 0.05, 0.15 and 0.3 m/s, three times each on the same line (3 min)";
  static const std::string bursts =
      "fire 1, 2 and 4 thrusters together in bursts of 0.1, 0.5 and 3 s, five times each, with pauses of 5 s "
      "(4 min)";
  static const std::string spin =
      "spin at 0.5 rad/s with shut valves on one place, 30 s in either direction, at four places";
  static const std::string timing =
      "fire one pair of thrusters for 20, 40, 80 and 160 ms, ten times each (2 min)";
  static const std::string bottle =
      "fly the same set-point sequence with a full and with a nearly empty bottle (10 min each)";
  static const std::string rest = "stay at rest with shut valves for 60 s at three places";
  static const std::map<std::string, std::string> all = {{"thrust_scale", pulses},
                                                         {"thruster_efficiency", pulses},
                                                         {"thruster_weak_since", pulses},
                                                         {"thruster_dead", pulses},
                                                         {"thruster_stuck_open", rest},
                                                         {"thruster_leak", rest},
                                                         {"thruster_leak_since", rest},
                                                         {"thruster_misalignment", pulses},
                                                         {"supply_coupling", bursts},
                                                         {"supply_droop", bursts},
                                                         {"pressure_decay", bottle},
                                                         {"mass_depletion", bottle},
                                                         {"valve_delay", timing},
                                                         {"command_delay", timing},
                                                         {"thrust_rise", timing},
                                                         {"mocap_latency", spin},
                                                         {"marker_offset", spin},
                                                         {"com_offset", spin},
                                                         {"yaw_misalignment", coast},
                                                         {"clock_skew", bottle},
                                                         {"mass_error", pulses},
                                                         {"inertia_error", spin},
                                                         {"slosh", timing},
                                                         {"floor_tilt", lattice},
                                                         {"floor_unevenness", lattice},
                                                         {"airflow", lattice},
                                                         {"tether", lattice},
                                                         {"friction_patch", lattice},
                                                         {"bearing_down", spin},
                                                         {"viscous_drag", coast},
                                                         {"quadratic_drag", coast},
                                                         {"coulomb_friction", coast},
                                                         {"external_impulse", rest},
                                                         {"floor_vibration", rest},
                                                         {"unmodelled", lattice}};
  return all;
}

}  // namespace

std::string short_number(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.3g", value == 0.0 ? 0.0 : value);
  return text;
}

std::string statement_of(const Effect& effect, const std::vector<Began>& recordings,
                         double onset_deviation_s) {
  return std::visit(Sentence{recordings, onset_deviation_s}, effect);
}

std::string experiment_against(const std::string& claimed, const std::string& rival) {
  // Pairs that no flight can separate need something that is not a flight of the same robot.
  if (claimed == "thrust_scale")
    return "Weigh the robot, or fly again with 2 kg added: a wrong mass shrinks in proportion, a wrong "
           "thrust does "
           "not; weak thrust in all is seen on a scale with one valve open.";
  if (claimed == "floor_tilt" && rival.rfind("airflow", 0) == 0)
    return "Fly again with 2 kg added: the force of a tilt grows with the weight, that of moving air does "
           "not; or "
           "switch the ventilation off.";
  if (claimed == "thruster_dead" && rival == "lost command bit")
    return "Measure the valve's current while that thruster alone is commanded for 0.5 s.";
  if (claimed == "yaw_misalignment" && rival.rfind("thruster_misalignment", 0) == 0)
    return "Set the robot's edge against a ruler along world x and compare the tracked yaw with 0.";
  if (claimed == "command_delay")
    return "Switch a marker light with a valve's command and note the first frame that shows it; a rotation "
           "with shut "
           "valves past a fixed light gate gives the latency of the poses alone.";
  const auto own = manoeuvres().find(claimed);
  const auto other = manoeuvres().find(rival);
  if (own == manoeuvres().end() || other == manoeuvres().end()) return "";
  const std::string first = "To tell " + claimed + " from " + rival + ": " + own->second;
  return own->second == other->second ? first + "." : first + "; then " + other->second + ".";
}

}  // namespace atmos
