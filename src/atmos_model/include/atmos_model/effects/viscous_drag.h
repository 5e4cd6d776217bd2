#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// Resistance proportional to speed and spin.
struct ViscousDrag : EffectHooks {
  static constexpr const char* kKind = "viscous_drag";
  static constexpr const char* kEquation = "-linear_n_s_m v; torque -angular_n_m_s w";

  double linear_n_s_m = 0.0;
  double angular_n_m_s = 0.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"linear_n_s_m", "N s/m", Bounds::between(0.0, 100.0), ""}, self.linear_n_s_m);
    visit(ParameterInfo{"angular_n_m_s", "N m s", Bounds::between(0.0, 10.0), ""}, self.angular_n_m_s);
  }

  template <class S>
  void force(const Instant<S>& now, const S*, PlanarWrench<S>& wrench) const {
    wrench.force_W -= linear_n_s_m * now.state.v_WC;
    wrench.torque -= angular_n_m_s * now.state.yaw_rate;
  }
};

}  // namespace atmos
