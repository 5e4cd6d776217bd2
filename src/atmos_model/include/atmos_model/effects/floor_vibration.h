#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// The floor shakes: a sinusoidal force along one direction of the world; its phase belongs to one recording.
struct FloorVibration : EffectHooks {
  static constexpr const char* kKind = "floor_vibration";
  static constexpr const char* kEquation =
      "amplitude_n sin(2 pi frequency_hz (t - t0) + phase_rad) along direction_rad in the world";

  double amplitude_n = 0.0;
  double frequency_hz = 1.0;
  double phase_rad = 0.0;
  double direction_rad = 0.0;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"amplitude_n", "N", Bounds::between(-20.0, 20.0), ""}, self.amplitude_n);
    visit(ParameterInfo{"frequency_hz", "Hz", Bounds::between(0.0, 50.0), ""}, self.frequency_hz);
    visit(ParameterInfo{"phase_rad", "rad", Bounds::between(-10.0, 10.0), "at t0"}, self.phase_rad);
    visit(ParameterInfo{"direction_rad", "rad", Bounds::between(-10.0, 10.0), "from world x"},
          self.direction_rad);
  }

  template <class S>
  void force(const Instant<S>& now, const S*, PlanarWrench<S>& wrench) const {
    const double push = amplitude_n * std::sin(2.0 * M_PI * frequency_hz * now.since_start_s + phase_rad);
    wrench.force_W += Vec2<S>(S(push * std::cos(direction_rad)), S(push * std::sin(direction_rad)));
  }
};

}  // namespace atmos
