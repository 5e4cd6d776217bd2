#include "atmos_sim2real/laws.h"

#include <algorithm>
#include <cmath>
#include <sstream>

namespace atmos {

namespace {

// Nats that a law outside the vocabulary must bring beyond one inside it.
constexpr double kStrangerPrice = 4.0;

struct Coefficient {
  std::string name;
  std::string unit;
  double width;  // what is plausible, in the unit
};

Hypothesis law(const std::string& name, const std::string& force_x, const std::string& force_y,
               const std::string& torque, const std::vector<Coefficient>& coefficients) {
  Unmodelled effect;
  effect.force_x_n = force_x;
  effect.force_y_n = force_y;
  effect.torque_n_m = torque;
  Hypothesis hypothesis;
  hypothesis.kind = Unmodelled::kKind;
  hypothesis.law = name;
  for (std::size_t k = 0; k < coefficients.size(); ++k) {
    effect.coefficients[coefficients[k].name] = {0.0, coefficients[k].unit};
    hypothesis.free.push_back(
        {0, "coefficients", k, 0.0, coefficients[k].width, 1e-2 * coefficients[k].width});
  }
  hypothesis.starts.push_back({effect, {"coefficients"}});
  return hypothesis;
}

std::string text(double value) {
  std::ostringstream out;
  out.precision(9);
  out << value;
  return out.str();
}

// "1.7*u1 - 1.7*u3": what the open valves make of `per_newton` of each thruster.
template <class PerNewton>
std::string sum_of_openings(const Vehicle& vehicle, const PerNewton& per_newton) {
  const PlantProperties nominal = Plant(vehicle, {}, 0.0).properties();
  std::string sum;
  for (std::size_t k = 0; k < nominal.thrusters.size(); ++k) {
    const PlanarThruster& thruster = nominal.thrusters[k];
    const double share = thruster.force_n * per_newton(thruster);
    if (std::abs(share) < 1e-9) continue;
    sum += (sum.empty() ? "" : " + ") + ("(" + text(share) + ")*u" + std::to_string(k + 1));
  }
  return sum.empty() ? "0" : sum;
}

// The thrust of the open valves times `factor`.
Hypothesis thrust_law(const Vehicle& vehicle, const std::string& name, const std::string& factor,
                      const std::vector<Coefficient>& coefficients) {
  const std::string along = sum_of_openings(vehicle, [](const PlanarThruster& t) { return t.direction.x(); });
  const std::string left = sum_of_openings(vehicle, [](const PlanarThruster& t) { return t.direction.y(); });
  const std::string turn =
      sum_of_openings(vehicle, [](const PlanarThruster& t) { return cross2(t.position_m, t.direction); });
  return law(name, factor + "*(cos(yaw)*(" + along + ") - sin(yaw)*(" + left + "))",
             factor + "*(sin(yaw)*(" + along + ") + cos(yaw)*(" + left + "))", factor + "*(" + turn + ")",
             coefficients);
}

// A pull towards a point that falls with the square of the distance, like a magnet's or an electrode's.
Hypothesis attraction(const Box& floor) {
  const auto [x0, x1, y0, y1] = floor;
  Unmodelled effect;
  const std::string cubed = "((x - cx)^2 + (y - cy)^2 + 0.01)^1.5";
  effect.force_x_n = "k*(cx - x)/" + cubed;
  effect.force_y_n = "k*(cy - y)/" + cubed;
  Hypothesis hypothesis;
  hypothesis.kind = Unmodelled::kKind;
  hypothesis.law = "a pull towards a point that falls with the square of the distance";
  const double step_x = std::max(0.4, (x1 - x0) / 6.0), step_y = std::max(0.4, (y1 - y0) / 6.0);
  for (double cx = x0 - step_x; cx <= x1 + 1.5 * step_x; cx += step_x) {
    for (double cy = y0 - step_y; cy <= y1 + 1.5 * step_y; cy += step_y) {
      for (const double k : {0.02, -0.02}) {
        effect.coefficients = {{"cx", {cx, "m"}}, {"cy", {cy, "m"}}, {"k", {k, "N m^2"}}};
        hypothesis.starts.push_back({effect, {}});
      }
    }
  }
  const double middle_x = 0.5 * (x0 + x1), middle_y = 0.5 * (y0 + y1);
  hypothesis.free = {{0, "coefficients", 0, middle_x, 0.5 * (x1 - x0) + 0.5, 1e-2},
                     {0, "coefficients", 1, middle_y, 0.5 * (y1 - y0) + 0.5, 1e-2},
                     {0, "coefficients", 2, 0.0, 0.03, 1e-4}};
  return hypothesis;
}

}  // namespace

std::vector<Hypothesis> laws(const Vehicle& vehicle, const std::vector<Flight>& flights) {
  double duration = 1.0;
  for (const Flight& flight : flights) duration = std::max(duration, flight.recording().duration_s());
  const double force = 0.05, torque = 5e-3;  // N, N m: what is plausible of a cause nobody thought of
  std::vector<Hypothesis> all = {
      law("a force that turns with the body", "a*cos(yaw) - b*sin(yaw)", "a*sin(yaw) + b*cos(yaw)", "0",
          {{"a", "N", force}, {"b", "N", force}}),
      law("a force that grows with time", "a*t", "b*t", "0",
          {{"a", "N/s", 2.0 * force / duration}, {"b", "N/s", 2.0 * force / duration}}),
      law("a force across the velocity", "-a*vy", "a*vx", "0", {{"a", "N s/m", 0.4}}),
      law("a force across the velocity that grows with the spin", "-a*yaw_rate*vy", "a*yaw_rate*vx", "0",
          {{"a", "N s^2/m", 1.0}}),
      law("a drag that differs along x and y", "-a*vx", "-b*vy", "0",
          {{"a", "N s/m", 0.4}, {"b", "N s/m", 0.4}}),
      law("a drag that grows with the cube of the speed", "-a*(vx^2 + vy^2)*vx", "-a*(vx^2 + vy^2)*vy", "0",
          {{"a", "N s^3/m^3", 10.0}}),
      law("a force that changes linearly over the floor", "a + b*x + c*y", "d + e*x + f*y", "0",
          {{"a", "N", force},
           {"b", "N/m", force},
           {"c", "N/m", force},
           {"d", "N", force},
           {"e", "N/m", force},
           {"f", "N/m", force}}),
      attraction(visited(flights)),
      law("a steady torque", "0", "0", "a", {{"a", "N m", torque}}),
      law("a torque that grows with time", "0", "0", "a*t", {{"a", "N m/s", 2.0 * torque / duration}}),
      law("a torque that depends on the heading", "0", "0", "a*cos(yaw) + b*sin(yaw)",
          {{"a", "N m", torque}, {"b", "N m", torque}}),
      law("a torque that depends on twice the heading", "0", "0", "a*cos(2*yaw) + b*sin(2*yaw)",
          {{"a", "N m", torque}, {"b", "N m", torque}}),
      law("a torque that depends on the place", "0", "0", "a + b*x + c*y",
          {{"a", "N m", torque}, {"b", "N", torque}, {"c", "N", torque}}),
      law("a torque against the square of the spin", "0", "0", "-a*yaw_rate*abs(yaw_rate)",
          {{"a", "N m s^2", 0.05}}),
      thrust_law(vehicle, "a thrust that changes with time", "a*t", {{"a", "1/s", 0.3 / duration}}),
      thrust_law(vehicle, "a thrust that changes with the speed", "a*sqrt(vx^2 + vy^2)", {{"a", "s/m", 1.0}}),
  };
  const std::string open = sum_of_openings(vehicle, [](const PlanarThruster& t) { return 1.0 / t.force_n; });
  all.push_back(thrust_law(vehicle, "a thrust that changes with the square of the other open valves",
                           "a*(" + open + " - 1)^2", {{"a", "1", 0.03}}));
  for (Hypothesis& hypothesis : all)
    hypothesis.penalty = kStrangerPrice + std::log(static_cast<double>(all.size()));
  return all;
}

Hypothesis swinging_torque(double frequency_hz, double penalty) {
  const std::string angle = "(" + text(2.0 * M_PI * frequency_hz) + "*t)";
  Hypothesis hypothesis = law("a torque that swings at " + text(frequency_hz) + " Hz", "0", "0",
                              "a*cos" + angle + " + b*sin" + angle, {{"a", "N m", 5e-3}, {"b", "N m", 5e-3}});
  hypothesis.local = true;
  hypothesis.penalty = kStrangerPrice + penalty;
  return hypothesis;
}

bool depends_on_valves(const Unmodelled& law) {
  for (const std::string* formula : {&law.force_x_n, &law.force_y_n, &law.torque_n_m}) {
    for (std::size_t i = 0; i + 1 < formula->size(); ++i) {
      if ((*formula)[i] == 'u' && std::isdigit(static_cast<unsigned char>((*formula)[i + 1])) != 0)
        return true;
    }
  }
  return false;
}

namespace {

// A formula in which every coefficient has a new name.
std::string renamed(const std::string& formula, const std::map<std::string, std::string>& names) {
  std::string out;
  for (std::size_t i = 0; i < formula.size();) {
    if (std::isalpha(static_cast<unsigned char>(formula[i])) == 0) {
      out += formula[i++];
      continue;
    }
    std::size_t end = i;
    while (end < formula.size() &&
           (std::isalnum(static_cast<unsigned char>(formula[end])) != 0 || formula[end] == '_'))
      ++end;
    const std::string word = formula.substr(i, end - i);
    const auto found = names.find(word);
    out += found == names.end() ? word : found->second;
    i = end;
  }
  return out;
}

}  // namespace

Unmodelled joined(const Unmodelled& first, const Unmodelled& second) {
  Unmodelled sum = first;
  std::map<std::string, std::string> names;
  // Alphabetical order is the order of a law's parameters: those of the second come after all of the first.
  const std::string prefix = first.coefficients.empty() ? "" : first.coefficients.rbegin()->first + "_";
  for (const auto& [name, coefficient] : second.coefficients) {
    names[name] = prefix + name;
    sum.coefficients[prefix + name] = coefficient;
  }
  const auto add = [&](std::string& to, const std::string& formula) {
    if (formula == "0") return;
    to = to == "0" ? renamed(formula, names) : to + " + " + renamed(formula, names);
  };
  add(sum.force_x_n, second.force_x_n);
  add(sum.force_y_n, second.force_y_n);
  add(sum.torque_n_m, second.torque_n_m);
  return sum;
}

}  // namespace atmos
