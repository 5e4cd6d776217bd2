#pragma once

#include <vector>

#include "atmos_model/effect.h"

namespace atmos {

// A valve begins to leak at a given time; thruster_leak otherwise.
struct ThrusterLeakSince : EffectHooks {
  static constexpr bool kRepeatable = true;
  static constexpr const char* kKind = "thruster_leak_since";
  static constexpr const char* kEquation = "adds fraction F_k d_k at r_k for t >= since_s";

  int thruster = 1;
  double since_s = 0.0;
  double fraction = 0.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(thruster_number(), self.thruster);
    visit(since(), self.since_s);
    visit(ParameterInfo{"fraction", "1", Bounds::between(0.0, 1.0), "of this thruster's force"},
          self.fraction);
  }

  template <class S>
  void thrust(const Instant<S>& now, const S*, ThrustStage<S>& stage) const {
    if (now.time_s >= since_s) stage.leak[thruster - 1] += S(fraction * now.plant.thruster(thruster).force_n);
  }

  void edges(std::vector<double>& times) const { times.push_back(since_s); }
};

}  // namespace atmos
