#pragma once

#include <map>

#include "atmos_model/effect.h"
#include "atmos_model/formulas.h"

namespace atmos {

// A law outside the vocabulary, as formulas with coefficients that bear units.
struct Unmodelled : EffectHooks {
  static constexpr const char* kKind = "unmodelled";
  static constexpr const char* kEquation =
      "force_x_n, force_y_n (world), torque_n_m: formulas of x, y, yaw, vx, vy, yaw_rate, t, u1..uN and the "
      "coefficients";

  struct Coefficient {
    double value = 0.0;
    std::string unit;
  };

  std::string force_x_n = "0";
  std::string force_y_n = "0";
  std::string torque_n_m = "0";
  std::map<std::string, Coefficient> coefficients;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"force_x_n", "N", Bounds::any(), "formula, along world x"}, self.force_x_n);
    visit(ParameterInfo{"force_y_n", "N", Bounds::any(), "formula, along world y"}, self.force_y_n);
    visit(ParameterInfo{"torque_n_m", "N m", Bounds::any(), "formula"}, self.torque_n_m);
    visit(ParameterInfo{"coefficients", "as stated", Bounds::between(-1e6, 1e6), "name: {value, unit}"},
          self.coefficients);
  }

  // Compiles formulas for a vehicle with so many thrusters. Throws std::invalid_argument with the place and
  // what was expected there.
  Formulas compile(const std::vector<std::string>& formulas, std::size_t thrusters) const {
    std::vector<std::string> variables = {"x", "y", "yaw", "vx", "vy", "yaw_rate", "t"};
    for (std::size_t i = 1; i <= thrusters; ++i) variables.push_back("u" + std::to_string(i));
    std::map<std::string, double> constants;
    for (const auto& [name, coefficient] : coefficients) constants[name] = coefficient.value;
    return Formulas(formulas, variables, constants);
  }

  // Compiles its own.
  void prepare(std::size_t thrusters) { law_ = compile({force_x_n, force_y_n, torque_n_m}, thrusters); }

  template <class S>
  void force(const Instant<S>& now, const S*, PlanarWrench<S>& wrench) const {
    S values[7 + kMaxThrusters] = {now.state.p_WC.x(),  now.state.p_WC.y(), now.state.yaw,
                                   now.state.v_WC.x(),  now.state.v_WC.y(), now.state.yaw_rate,
                                   S(now.since_start_s)};
    std::copy(now.openings, now.openings + now.plant.thrusters.size(), values + 7);
    S law[3] = {S(0), S(0), S(0)};
    law_.evaluate(values, law);
    wrench.force_W += Vec2<S>(law[0], law[1]);
    wrench.torque += law[2];
  }

 private:
  Formulas law_;
};

}  // namespace atmos
