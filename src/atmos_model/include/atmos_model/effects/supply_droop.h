#pragma once

#include <algorithm>

#include "atmos_model/effect.h"

namespace atmos {

// The plenum between regulator and valves empties while valves are open and refills afterwards.
struct SupplyDroop : EffectHooks {
  static constexpr const char* kKind = "supply_droop";
  static constexpr const char* kEquation =
      "plenum s, s(t0) = 1: ds/dt = (1 - s) / recovery_s - loss_per_s n s; f_i <- s f_i";

  double loss_per_s = 0.0;
  double recovery_s = 1.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"loss_per_s", "1/s", Bounds::between(0.0, 20.0), "of the plenum per open valve"},
          self.loss_per_s);
    visit(ParameterInfo{"recovery_s", "s", Bounds::between(0.01, 100.0), "time constant of refilling"},
          self.recovery_s);
  }

  int hidden_size(const PlantProperties&) const { return 1; }
  void start_hidden(double* hidden) const { hidden[0] = 1.0; }

  double time_scale() const { return std::min(recovery_s, 0.1 / std::max(loss_per_s, 1e-3)); }

  template <class S>
  void thrust(const Instant<S>&, const S* hidden, ThrustStage<S>& stage) const {
    stage.supply *= hidden[0];
  }

  template <class S, class SlopeAt>
  void hidden_rate(const Instant<S>& now, const S*, const PlanarAcceleration<S>&, const SlopeAt&,
                   const S* hidden, S* rate) const {
    rate[0] = (S(1) - hidden[0]) / recovery_s - loss_per_s * now.open_count * hidden[0];
  }
};

}  // namespace atmos
