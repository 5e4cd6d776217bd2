#pragma once

#include <vector>

#include "atmos_model/effect.h"

namespace atmos {

// One thruster becomes weak at a given time.
struct ThrusterWeakSince : EffectHooks {
  static constexpr bool kRepeatable = true;
  static constexpr const char* kKind = "thruster_weak_since";
  static constexpr const char* kEquation = "f_k <- factor f_k for k = thruster and t >= since_s";

  int thruster = 1;
  double since_s = 0.0;
  double factor = 1.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(thruster_number(), self.thruster);
    visit(since(), self.since_s);
    visit(ParameterInfo{"factor", "1", Bounds::between(0.0, 2.0), "of this thruster's force"}, self.factor);
  }

  template <class S>
  void thrust(const Instant<S>& now, const S*, ThrustStage<S>& stage) const {
    if (now.time_s >= since_s) stage.own[thruster - 1] *= S(factor);
  }

  void edges(std::vector<double>& times) const { times.push_back(since_s); }
};

}  // namespace atmos
