#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// A hose or cable pulls towards its anchor once it is taut.
struct Tether : EffectHooks {
  static constexpr bool kRepeatable = true;
  static constexpr const char* kKind = "tether";
  static constexpr const char* kEquation =
      "L = distance from the anchor; where L > slack_m the tension stiffness_n_m (L - slack_m) + "
      "damping_n_s_m dL/dt "
      "pulls the centre of mass towards the anchor";

  double anchor_x_m = 0.0;
  double anchor_y_m = 0.0;
  double slack_m = 0.0;
  double stiffness_n_m = 0.0;
  double damping_n_s_m = 0.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"anchor_x_m", "m", Bounds::between(-50.0, 50.0), "world x"}, self.anchor_x_m);
    visit(ParameterInfo{"anchor_y_m", "m", Bounds::between(-50.0, 50.0), "world y"}, self.anchor_y_m);
    visit(ParameterInfo{"slack_m", "m", Bounds::between(0.0, 50.0), "length at which it is taut"},
          self.slack_m);
    visit(ParameterInfo{"stiffness_n_m", "N/m", Bounds::between(0.0, 50.0), ""}, self.stiffness_n_m);
    visit(ParameterInfo{"damping_n_s_m", "N s/m", Bounds::between(0.0, 50.0), ""}, self.damping_n_s_m);
  }

  template <class S>
  void force(const Instant<S>& now, const S*, PlanarWrench<S>& wrench) const {
    const Vec2<S> from_anchor = now.state.p_WC - Vec2<S>(S(anchor_x_m), S(anchor_y_m));
    using std::sqrt;
    const S length = sqrt(from_anchor.squaredNorm());
    if (length <= slack_m || length <= 1e-9) return;
    const Vec2<S> away = from_anchor / length;
    const S tension = stiffness_n_m * (length - slack_m) + damping_n_s_m * away.dot(now.state.v_WC);
    wrench.force_W -= tension * away;
  }
};

}  // namespace atmos
