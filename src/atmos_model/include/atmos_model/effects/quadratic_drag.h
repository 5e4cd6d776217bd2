#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// Air resistance.
struct QuadraticDrag : EffectHooks {
  static constexpr const char* kKind = "quadratic_drag";
  static constexpr const char* kEquation = "-coefficient_n_s2_m2 |v| v";

  double coefficient_n_s2_m2 = 0.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"coefficient_n_s2_m2", "N s^2/m^2", Bounds::between(0.0, 100.0), ""},
          self.coefficient_n_s2_m2);
  }

  template <class S>
  void force(const Instant<S>& now, const S*, PlanarWrench<S>& wrench) const {
    using std::sqrt;
    // The added speed keeps the derivative finite at rest.
    const S speed = sqrt(now.state.v_WC.squaredNorm() + 1e-12);
    wrench.force_W -= coefficient_n_s2_m2 * speed * now.state.v_WC;
  }
};

}  // namespace atmos
