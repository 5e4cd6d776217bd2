#pragma once

#include "atmos_model/effect.h"

namespace atmos {

// Pushes from outside: a hand, a cable that snags.
struct ExternalImpulse : EffectHooks {
  static constexpr const char* kKind = "external_impulse";
  static constexpr const char* kEquation =
      "each event's impulse at the centre of mass and about it, spread evenly over the 50 ms after time_s";
  static constexpr double kDuration = 0.05;  // s

  std::vector<ImpulseEvent> events;

  template <class Self, class Visitor>
  static void parameters(Self& self, Visitor&& visit) {
    visit(ParameterInfo{"events", "N s, N m s", Bounds::between(-1000.0, 1000.0),
                        "time_s (ROS time), impulse_x_n_s, impulse_y_n_s (world), impulse_yaw_n_m_s"},
          self.events);
  }

  template <class S>
  void force(const Instant<S>& now, const S*, PlanarWrench<S>& wrench) const {
    for (const ImpulseEvent& event : events) {
      if (now.time_s < event.time_s || now.time_s >= event.time_s + kDuration) continue;
      wrench.force_W += (event.impulse_n_s / kDuration).template cast<S>();
      wrench.torque += S(event.impulse_yaw_n_m_s / kDuration);
    }
  }

  void edges(std::vector<double>& times) const {
    for (const ImpulseEvent& event : events) {
      times.push_back(event.time_s);
      times.push_back(event.time_s + kDuration);
    }
  }
};

}  // namespace atmos
