#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// Part of the vehicle's mass is free to move in both directions on a spring (liquid, a loose payload).
struct Slosh : EffectHooks {
  static constexpr bool kRepeatable = true;
  static constexpr const char* kKind = "slosh";
  static constexpr const char* kEquation =
      "displacement s in world axes: s'' = -w^2 s - 2 z w s' - (acceleration of the point) + (floor's "
      "acceleration), "
      "w = 2 pi frequency_hz; the body, of mass M - mass_kg, gets mass_kg (w^2 s + 2 z w s') at the point";

  // Of the vehicle's mass: more than half of it cannot swing.
  static constexpr double kMostOfVehicle = 0.5;

  double mass_kg = 0.1;
  double frequency_hz = 1.0;
  double damping_ratio = 0.05;
  double x_m = 0.0;
  double y_m = 0.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"mass_kg", "kg", Bounds::between(0.0, 10.0), "free to move"}, self.mass_kg);
    visit(ParameterInfo{"frequency_hz", "Hz", Bounds::between(0.02, 10.0), "with the body held still"},
          self.frequency_hz);
    visit(ParameterInfo{"damping_ratio", "1", Bounds::between(0.0, 2.0), "of critical"}, self.damping_ratio);
    visit(ParameterInfo{"x_m", "m", Bounds::between(-0.5, 0.5),
                        "body x of the point, from the geometric centre"},
          self.x_m);
    visit(ParameterInfo{"y_m", "m", Bounds::between(-0.5, 0.5), "body y of the point"}, self.y_m);
  }

  // Displacement and its velocity, world axes.
  int hidden_size(const PlantProperties&) const { return 4; }

  double time_scale() const { return 1.0 / (2.0 * M_PI * frequency_hz); }

  template <class S>
  void mass(const Instant<S>&, S& mass, S& /*weight_mass*/) const {
    mass -= S(mass_kg);
  }

  template <class S>
  void force(const Instant<S>& now, const S* hidden, PlanarWrench<S>& wrench) const {
    wrench.add_force_at(Vec2<S>(mass_kg * pull(hidden)), arm_W(now));
  }

  template <class S, class SlopeAt>
  void hidden_rate(const Instant<S>& now, const S*, const PlanarAcceleration<S>& body,
                   const SlopeAt& slope_at, const S* hidden, S* rate) const {
    const Vec2<S> r_W = arm_W(now);
    const S w = now.state.yaw_rate;
    const Vec2<S> a_point = body.a_WC + body.yaw_acceleration * Vec2<S>(-r_W.y(), r_W.x()) - w * w * r_W;
    const Vec2<S> a_floor = -kGravity * slope_at(Vec2<S>(now.state.p_WC + r_W));
    const Vec2<S> relative = -pull(hidden) - a_point + a_floor;
    rate[0] = hidden[2];
    rate[1] = hidden[3];
    rate[2] = relative.x();
    rate[3] = relative.y();
  }

 private:
  // Spring and damper per unit of moving mass.
  template <class S>
  Vec2<S> pull(const S* hidden) const {
    const double w = 2.0 * M_PI * frequency_hz;
    return w * w * Vec2<S>(hidden[0], hidden[1]) + 2.0 * damping_ratio * w * Vec2<S>(hidden[2], hidden[3]);
  }
  template <class S>
  Vec2<S> arm_W(const Instant<S>& now) const {
    const Eigen::Vector2d arm_B = Eigen::Vector2d(x_m, y_m) - now.plant.com_B;
    return now.R_WB * arm_B.cast<S>();
  }
};

}  // namespace atmos
