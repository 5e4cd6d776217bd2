// What a physical effect is: parameters with units and bounds, an equation in words, and the hooks through
// which it changes forces, hidden states, command timing or the measurement. One effect is one file in
// effects/, registered once in effects.h; docs/effects.md has every equation. Hooks are templated on the
// scalar so that simulator, predictor and controller run the very same law.
#pragma once

#include <string>
#include <vector>

#include "atmos_model/planar.h"
#include "atmos_model/strict_yaml.h"
#include "atmos_model/valve_schedule.h"

namespace atmos {

// What constant effects may alter before anything moves: the vehicle in the plane.
struct PlanarThruster {
  Eigen::Vector2d position_m;  // from the geometric centre, body
  Eigen::Vector2d direction;   // unit, body
  double force_n;
};

struct PlantProperties {
  double mass_kg;
  double inertia_kg_m2;                // yaw, about the centre of mass
  Eigen::Vector2d com_B{0.0, 0.0};     // c: centre of mass from the geometric centre, m
  Eigen::Vector2d marker_B{0.0, 0.0};  // the point the mocap shows, from the geometric centre, m
  double mocap_yaw_offset_rad = 0.0;
  double mocap_latency_s = 0.0;
  double stamp_skew = 0.0;                 // clock_skew ratio
  double gas_kg_per_open_second = 0.0035;  // consumption of an open thruster (docs/effects.md, "gas")
  std::vector<PlanarThruster> thrusters;
  std::vector<Eigen::Vector2d> bearings_m;  // from the geometric centre, body
  ValveTiming timing;
};

// One parameter of an effect, as model.yaml spells it.
struct ParameterInfo {
  std::string name;
  std::string unit;
  Bounds bounds;
  std::string meaning;
};

// Everything known at one instant when forces are worked out. Openings already contain thrust_rise.
template <class S>
struct Instant {
  double time_s;         // ROS time
  double since_start_s;  // t - t0
  const PlantProperties& plant;
  const PlanarState<S>& state;
  const S* openings;  // one per thruster, in [0, 1] (propellers: [-1, 1])
  S open_count;       // n
  S mass;             // M, kg, with what has flowed out
  S gas_used;         // g, kg
};

// Thrust while it is being worked out: force_i = supply * (own_i + leak_i).
template <class S>
struct ThrustStage {
  S* own;    // N, through the valve
  S* leak;   // N, past a leaking valve
  S supply;  // factor of plenum and bottle pressure, the same for every thruster
};

// The hooks with nothing in them. An effect hides those it needs with its own.
struct EffectHooks {
  // Whether a list may hold it several times: so for effects of one thruster or one place.
  static constexpr bool kRepeatable = false;
  // Changes constants (factors of force, mass, inertia; offsets; delays). Called once per effect, in table
  // order.
  void alter(PlantProperties&) const {}
  // Number of hidden states this effect integrates, and their values at the start of a recording.
  int hidden_size(const PlantProperties&) const { return 0; }
  void start_hidden(double*) const {}
  // thrust_rise: what takes the place of the openings. `rising` holds a copy of the openings on entry.
  template <class S>
  void rise(const S* /*hidden*/, S* /*rising*/, int /*count*/) const {}
  template <class S>
  void mass(const Instant<S>&, S& /*mass*/) const {}
  template <class S>
  void thrust(const Instant<S>&, const S* /*hidden*/, ThrustStage<S>&) const {}
  // Adds external forces.
  template <class S>
  void force(const Instant<S>&, const S* /*hidden*/, PlanarWrench<S>&) const {}
  // Time derivatives of the hidden states, given the body's acceleration. `commanded`: openings before
  // thrust_rise.
  template <class S>
  void hidden_rate(const Instant<S>&, const S* /*commanded*/, const PlanarAcceleration<S>&,
                   const S* /*hidden*/, S* /*rate*/) const {}
  // Instants at which this effect's force jumps (start and end of a pulse), so that integrators stop there.
  void edges(std::vector<double>& /*times*/) const {}
};

}  // namespace atmos
