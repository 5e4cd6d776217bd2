#pragma once

#include <vector>

#include "atmos_model/effect.h"

namespace atmos {

// A bearing loses its air and rubs on the floor.
struct BearingDown : EffectHooks {
  static constexpr bool kRepeatable = true;
  static constexpr const char* kKind = "bearing_down";
  static constexpr const char* kEquation =
      "for t >= since_s, at that bearing -coefficient (M g / 3) against its own velocity, smooth below 2 "
      "mm/s";

  int bearing = 1;
  double since_s = 0.0;
  double coefficient = 0.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"bearing", "1", Bounds::between(1, 3), "number in the vehicle file, from 1"},
          self.bearing);
    visit(since(), self.since_s);
    visit(ParameterInfo{"coefficient", "1", Bounds::between(0.0, 1.0), "friction over normal force"},
          self.coefficient);
  }

  double time_scale() const { return friction_time_scale(coefficient); }

  template <class S>
  void force(const Instant<S>& now, const S*, PlanarWrench<S>& wrench) const {
    if (now.time_s < since_s) return;
    add_bearing_friction(
        now, now.plant.bearings_m[static_cast<std::size_t>(bearing - 1)], coefficient,
        [](const Vec2<S>&) { return true; }, wrench);
  }

  void edges(std::vector<double>& times) const { times.push_back(since_s); }
};

}  // namespace atmos
