#include "atmos_sim2real/laws.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <sstream>

namespace atmos {

namespace {

// Nats that a law outside the vocabulary must bring beyond one inside it.
constexpr double kStrangerPrice = 4.0;

struct Coefficient {
  std::string name;
  std::string unit;
  double width;  // what is plausible, in the unit
  double mean = 0.0;
  double least = -std::numeric_limits<double>::infinity();
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
    const Coefficient& coefficient = coefficients[k];
    effect.coefficients[coefficient.name] = {coefficient.mean, coefficient.unit};
    hypothesis.free.push_back(
        {0, "coefficients", k, coefficient.mean, coefficient.width, 1e-2 * coefficient.width});
    hypothesis.free.back().least = coefficient.least;
  }
  hypothesis.starts.push_back({effect, {"coefficients"}});
  return hypothesis;
}

// The law with a coefficient that it is not linear in, from each of these values.
Hypothesis from_each(const Coefficient& coefficient, const std::vector<double>& values, Hypothesis law) {
  const Start first = law.starts.front();
  law.starts.clear();
  for (const double value : values) {
    law.starts.push_back(first);
    std::get<Unmodelled>(law.starts.back().effect).coefficients[coefficient.name].value = value;
  }
  return law;
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

// A pull on a point of the body towards a place, that fades over a length, like a magnet's or an electrode's.
Hypothesis attraction(const Box& floor) {
  const auto [x0, x1, y0, y1] = floor;
  const std::string dx = "(cx - x - ax*cos(yaw) + ay*sin(yaw))", dy = "(cy - y - ax*sin(yaw) - ay*cos(yaw))";
  const std::string pull = "k/(1 + (" + dx + "^2 + " + dy + "^2)/s^2)^p";
  const double middle_x = 0.5 * (x0 + x1), middle_y = 0.5 * (y0 + y1);
  Hypothesis hypothesis =
      law("a pull on a point of the body towards a place", dx + "*" + pull, dy + "*" + pull,
          "((ax*cos(yaw) - ay*sin(yaw))*" + dy + " - (ax*sin(yaw) + ay*cos(yaw))*" + dx + ")*" + pull,
          {{"ax", "m", 0.1},
           {"ay", "m", 0.1},
           {"cx", "m", 0.5 * (x1 - x0) + 0.5, middle_x},
           {"cy", "m", 0.5 * (y1 - y0) + 0.5, middle_y},
           {"k", "N/m", 0.2},
           {"p", "1", 2.0, 2.5, 1.0},
           {"s", "m", 0.5, 0.5, 0.1}});
  hypothesis.sure_of_a_fit = true;
  Unmodelled effect = std::get<Unmodelled>(hypothesis.starts.front().effect);
  hypothesis.starts.clear();
  const double step_x = std::max(0.4, (x1 - x0) / 6.0), step_y = std::max(0.4, (y1 - y0) / 6.0);
  for (double cx = x0 - step_x; cx <= x1 + 1.5 * step_x; cx += step_x) {
    for (double cy = y0 - step_y; cy <= y1 + 1.5 * step_y; cy += step_y) {
      for (const double k : {0.1, -0.1}) {
        effect.coefficients["cx"].value = cx;
        effect.coefficients["cy"].value = cy;
        effect.coefficients["k"].value = k;
        hypothesis.starts.push_back({effect, {}});
      }
    }
  }
  return hypothesis;
}

// A force or torque of which nothing is known but that it changes smoothly with time, as a sum of bells.
Hypothesis wandering(const std::string& name, double duration_s, double spacing, const Coefficient& along_x,
                     const Coefficient& along_y, const Coefficient& about_z) {
  std::string formulas[3];
  std::vector<Coefficient> coefficients;
  const Coefficient* const axes[3] = {&along_x, &along_y, &about_z};
  for (int axis = 0; axis < 3; ++axis) {
    if (axes[axis]->unit.empty()) {
      formulas[axis] = "0";
      continue;
    }
    int bell = 10;  // two digits: coefficients are in alphabetical order
    for (double middle = 0.0; middle < duration_s + 0.5 * spacing; middle += spacing, ++bell) {
      const std::string coefficient = axes[axis]->name + std::to_string(bell);
      coefficients.push_back({coefficient, axes[axis]->unit, axes[axis]->width});
      formulas[axis] += (formulas[axis].empty() ? "" : " + ") + coefficient + "*exp(-((t - " + text(middle) +
                        ")/" + text(spacing) + ")^2)";
    }
  }
  Hypothesis hypothesis = law(name, formulas[0], formulas[1], formulas[2], coefficients);
  hypothesis.map = hypothesis.sure_of_a_fit = true;
  for (FreeParameter& bell : hypothesis.free) bell.linear = true;
  return hypothesis;
}

// What two valves do to the body only while both are open: jets that meet, a shared feed.
std::vector<Hypothesis> valve_pairs(const Vehicle& vehicle) {
  std::vector<Hypothesis> all;
  const int n = static_cast<int>(vehicle.thrusters.size());
  for (int i = 1; i <= n; ++i) {
    for (int j = i + 1; j <= n; ++j) {
      const std::string both = "u" + std::to_string(i) + "*u" + std::to_string(j);
      all.push_back(law("a push that comes while valves " + std::to_string(i) + " and " + std::to_string(j) +
                            " are both open",
                        both + "*(a*cos(yaw) - b*sin(yaw))", both + "*(a*sin(yaw) + b*cos(yaw))", both + "*c",
                        {{"a", "N", 0.2}, {"b", "N", 0.2}, {"c", "N m", 0.03}}));
    }
  }
  for (Hypothesis& pair : all) pair.penalty = kStrangerPrice + std::log(static_cast<double>(all.size()));
  return all;
}

}  // namespace

std::vector<Hypothesis> laws(const Vehicle& vehicle, const std::vector<Flight>& flights) {
  double duration = 1.0;
  for (const Flight& flight : flights) duration = std::max(duration, flight.recording().duration_s());
  const double force = 0.05, torque = 5e-3;  // N, N m: what is plausible of a cause nobody thought of
  const std::string open = sum_of_openings(vehicle, [](const PlanarThruster& t) { return 1.0 / t.force_n; });
  const std::pair<std::string, std::string> body = {"(a*cos(yaw) - b*sin(yaw))", "(a*sin(yaw) + b*cos(yaw))"};
  const std::string speed = "sqrt(vx^2 + vy^2)";
  const std::string along = "(vx*cos(yaw) + vy*sin(yaw))", across = "(vy*cos(yaw) - vx*sin(yaw))";
  const std::string grown = "abs(t/" + text(duration) + ")^p";
  const Coefficient power{"p", "1", 0.5, 1.0, 0.2}, exponent{"p", "1", 0.5, 1.0, 0.1};
  const double brisk = std::max(6.0, duration / 16.0);  // s
  const auto push = [](const std::string& name, const std::pair<std::string, std::string>& forces,
                       const std::vector<Coefficient>& coefficients) {
    return law(name, forces.first, forces.second, "0", coefficients);
  };
  const auto turn = [](const std::string& name, const std::string& formula,
                       const std::vector<Coefficient>& coefficients) {
    return law(name, "0", "0", formula, coefficients);
  };
  std::vector<Hypothesis> all = {
      push("a force that turns with the body", body, {{"a", "N", force}, {"b", "N", force}}),
      push("a force that turns with the body and comes with every open valve",
           {body.first + "*(" + open + ")", body.second + "*(" + open + ")"},
           {{"a", "N", 0.3 * force}, {"b", "N", 0.3 * force}}),
      push("a force that grows with time", {"a*" + grown, "b*" + grown},
           {{"a", "N", 2.0 * force}, {"b", "N", 2.0 * force}, power}),
      push("a force across the velocity", {"-a*vy", "a*vx"}, {{"a", "N s/m", 0.4}}),
      push("a force across the velocity that grows with the spin", {"-a*yaw_rate*vy", "a*yaw_rate*vx"},
           {{"a", "N s^2/m", 1.0}}),
      push("a drag that differs along x and y", {"-a*vx", "-b*vy"},
           {{"a", "N s/m", 1.5}, {"b", "N s/m", 1.5}}),
      push("a drag that differs along and across the body",
           {"-a*" + along + "*cos(yaw) + b*" + across + "*sin(yaw)",
            "-a*" + along + "*sin(yaw) - b*" + across + "*cos(yaw)"},
           {{"a", "N s/m", 1.5}, {"b", "N s/m", 1.5}}),
      from_each(exponent, {0.25, 1.0},
                push("a drag that grows with a power of the speed",
                     {"-a*(vx^2 + vy^2)^p*vx", "-a*(vx^2 + vy^2)^p*vy"},
                     {{"a", "N (s/m)^(1 + 2 p)", 5.0}, exponent})),
      push("a force that changes linearly over the floor", {"a + b*x + c*y", "d + e*x + f*y"},
           {{"a", "N", force},
            {"b", "N/m", force},
            {"c", "N/m", force},
            {"d", "N", force},
            {"e", "N/m", force},
            {"f", "N/m", force}}),
      attraction(visited(flights)),
      turn("a steady torque", "a", {{"a", "N m", torque}}),
      turn("a torque that grows with time", "a*" + grown, {{"a", "N m", 2.0 * torque}, power}),
      turn("a torque that depends on the heading", "a*cos(yaw) + b*sin(yaw)",
           {{"a", "N m", torque}, {"b", "N m", torque}}),
      turn("a torque that depends on twice the heading", "a*cos(2*yaw) + b*sin(2*yaw)",
           {{"a", "N m", torque}, {"b", "N m", torque}}),
      turn("a torque that depends on the place", "a + b*x + c*y",
           {{"a", "N m", torque}, {"b", "N", torque}, {"c", "N", torque}}),
      turn("a torque that comes with motion along and across the body", "a*" + along + " + b*" + across,
           {{"a", "N s", 10.0 * torque}, {"b", "N s", 10.0 * torque}}),
      turn("a torque against a power of the spin", "-a*yaw_rate*abs(yaw_rate)^p",
           {{"a", "N m s^(1 + p)", 0.05}, exponent}),
      turn("a torque that comes with every open valve", "a*(" + open + ")", {{"a", "N m", torque}}),
      thrust_law(vehicle, "a thrust that changes with time", "a*t", {{"a", "1/s", 0.3 / duration}}),
      thrust_law(vehicle, "a thrust that changes with the speed", "a*" + speed, {{"a", "s/m", 1.0}}),
      thrust_law(vehicle, "a thrust that changes with the square of the other open valves",
                 "a*(" + open + " - 1)^2", {{"a", "1", 0.03}}),
      wandering("a force that wanders with time", duration, brisk, {"a", "N", force}, {"b", "N", force}, {}),
      wandering("a force that drifts with time", duration, 3.0 * brisk, {"a", "N", force}, {"b", "N", force},
                {}),
      wandering("a torque that wanders with time", duration, brisk, {}, {}, {"c", "N m", torque}),
      wandering("a torque that drifts with time", duration, 3.0 * brisk, {}, {}, {"c", "N m", torque}),
  };
  const std::string left = "exp(-t/tau)";  // what relaxes does so exponentially
  const Coefficient tau{"tau", "s", 20.0, 15.0, 1.0};
  all.push_back(from_each(tau, {5.0, 15.0, 45.0},
                          push("a force that fades", {"a*" + left, "b*" + left},
                               {{"a", "N", 2.0 * force}, {"b", "N", 2.0 * force}, tau})));
  all.push_back(from_each(tau, {5.0, 15.0, 45.0},
                          turn("a torque that fades", "a*" + left, {{"a", "N m", 2.0 * torque}, tau})));
  const double choices = std::log(static_cast<double>(all.size()));
  for (Hypothesis& hypothesis : all) hypothesis.penalty = kStrangerPrice + choices;
  for (Hypothesis& pair : valve_pairs(vehicle)) all.push_back(std::move(pair));
  return all;
}

namespace {

std::string swing(const std::string& sine, const std::string& cosine) {
  const std::string angle = "(" + text(2.0 * M_PI) + "*f*t)";
  return sine + "*sin" + angle + " + " + cosine + "*cos" + angle;
}

Hypothesis swinging(const std::string& what, const std::array<std::string, 3>& formulas,
                    std::vector<Coefficient> amplitudes, const Line& line) {
  amplitudes.push_back({"f", "Hz", 0.5 / line.duration_s, line.frequency_hz});
  Hypothesis hypothesis =
      law(what + " at " + text(line.frequency_hz) + " Hz", formulas[0], formulas[1], formulas[2], amplitudes);
  hypothesis.local = true;
  hypothesis.penalty = kStrangerPrice + std::log(line.choices);
  return hypothesis;
}

}  // namespace

Hypothesis swinging_torque(const Line& line) {
  return swinging("a torque that swings", {"0", "0", swing("a", "b")},
                  {{"a", "N m", 5e-3}, {"b", "N m", 5e-3}}, line);
}

Hypothesis circling_force(const Line& line) {
  return swinging("a force that goes round", {swing("a", "b"), swing("c", "d"), "0"},
                  {{"a", "N", 0.2}, {"b", "N", 0.2}, {"c", "N", 0.2}, {"d", "N", 0.2}}, line);
}

bool changes_slowly(const Unmodelled& law) {
  if (depends_on_valves(law)) return false;
  // Only an oscillation is fast: its phase is a product with t, in parentheses.
  for (const std::string* formula : {&law.force_x_n, &law.force_y_n, &law.torque_n_m}) {
    if (formula->find("*t)") != std::string::npos) return false;
  }
  return true;
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
