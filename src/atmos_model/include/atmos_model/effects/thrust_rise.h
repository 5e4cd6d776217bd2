#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// Thrust follows the valve with a first-order lag.
struct ThrustRise : EffectHooks {
  static constexpr const char* kKind = "thrust_rise";
  static constexpr const char* kEquation = "time_constant_s dl_i/dt = o_i - l_i; l_i takes the place of o_i";

  double time_constant_s = 0.01;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"time_constant_s", "s", Bounds::between(1e-3, 0.5), "of the lag"},
          self.time_constant_s);
  }

  int hidden_size(const PlantProperties& plant) const { return static_cast<int>(plant.thrusters.size()); }

  double time_scale() const { return time_constant_s; }

  template <class S>
  void rise(const S* hidden, S* rising, int count) const {
    for (int i = 0; i < count; ++i) rising[i] = hidden[i];
  }

  template <class S, class SlopeAt>
  void hidden_rate(const Instant<S>& now, const S* commanded, const PlanarAcceleration<S>&, const SlopeAt&,
                   const S* hidden, S* rate) const {
    for (std::size_t i = 0; i < now.plant.thrusters.size(); ++i)
      rate[i] = (commanded[i] - hidden[i]) / time_constant_s;
  }
};

}  // namespace atmos
