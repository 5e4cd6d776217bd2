// What a physical effect is: parameters with units and bounds, an equation in words, and the hooks through
// which it changes forces, hidden states, command timing or the measurement. One effect is one file in
// effects/, registered once in effects.h; docs/effects.md has every equation. Hooks are templated on the
// scalar so that simulator, predictor and controller run the very same law.
#pragma once

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "atmos_model/planar.h"
#include "atmos_model/strict_yaml.h"
#include "atmos_model/valve_schedule.h"
#include "atmos_model/vehicle.h"

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
  double bearing_flow_kg_s = 0.0;          // of all bearings, from the same bottles
  Actuation actuation = Actuation::kOnOff;
  std::vector<PlanarThruster> thrusters;
  std::vector<Eigen::Vector2d> bearings_m;  // from the geometric centre, body
  ValveTiming timing;

  // Thruster `number` as commands count them, from 1.
  const PlanarThruster& thruster(int number) const {
    return thrusters.at(static_cast<std::size_t>(number - 1));
  }
  PlanarThruster& thruster(int number) { return thrusters.at(static_cast<std::size_t>(number - 1)); }
};

// One parameter of an effect, as model.yaml spells it.
struct ParameterInfo {
  std::string name;
  std::string unit;
  Bounds bounds;
  std::string meaning;
};

// Parameters that several effects share.
inline ParameterInfo thruster_number() {
  return {"thruster", "1", Bounds::between(1, kMaxThrusters), "number in the vehicle file, from 1"};
}
inline ParameterInfo since() {
  return {"since_s", "s", Bounds::between(0.0, 1e10), "ROS time of the failure; 0: always"};
}
inline Bounds ros_time() { return Bounds::between(0.0, 1e10); }
inline ParameterInfo grid_origin() {
  return {"origin_m", "m", Bounds::between(-50.0, 50.0), "world place of node (0, 0)"};
}
inline ParameterInfo grid_spacing() {
  return {"spacing_m", "m", Bounds::between(0.01, 50.0), "between nodes"};
}

// A push from outside at one time; impulses in the world at the centre of mass, and about it.
struct ImpulseEvent {
  double time_s = 0.0;  // ROS time
  Eigen::Vector2d impulse_n_s = Eigen::Vector2d::Zero();
  double impulse_yaw_n_m_s = 0.0;
};

// Everything known at one instant when forces are worked out. Openings already contain thrust_rise.
template <class S>
struct Instant {
  double time_s;         // ROS time
  double since_start_s;  // t - t0
  const PlantProperties& plant;
  const PlanarState<S>& state;
  Eigen::Matrix<S, 2, 2> R_WB;  // body to world, of the state's yaw
  const S* openings;            // one per thruster, in [0, 1] (propellers: [-1, 1])
  S open_count;                 // n
  S mass;                       // kg, what the wrench accelerates: M less gas used and what sloshes
  S weight_mass;                // kg, what rests on the bearings: the same with what sloshes
  S gas_used;                   // g, kg
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
  // What has left, or moves by itself. Only the latter still rests on the bearings.
  template <class S>
  void mass(const Instant<S>&, S& /*mass*/, S& /*weight_mass*/) const {}
  template <class S>
  void thrust(const Instant<S>&, const S* /*hidden*/, ThrustStage<S>&) const {}
  // Adds external forces.
  template <class S>
  void force(const Instant<S>&, const S* /*hidden*/, PlanarWrench<S>&) const {}
  // Adds to the slope of the floor [m/m, world axes] at a place; the plant turns slopes into forces at the
  // bearings.
  template <class S>
  void slope(const Vec2<S>& /*p_W*/, Vec2<S>& /*slope_W*/) const {}
  // Time derivatives of the hidden states, given the body's acceleration. `commanded`: openings before
  // thrust_rise; `slope_at(p_W)`: slope of the floor at a place.
  template <class S, class SlopeAt>
  void hidden_rate(const Instant<S>&, const S* /*commanded*/, const PlanarAcceleration<S>&,
                   const SlopeAt& /*slope_at*/, const S* /*hidden*/, S* /*rate*/) const {}
  // The shortest time in which this effect changes a state much, s: integrators step no further.
  double time_scale() const { return std::numeric_limits<double>::infinity(); }
  // Instants at which this effect's force jumps (start and end of a pulse), so that integrators stop there.
  void edges(std::vector<double>& /*times*/) const {}
};

// Below this speed the friction of a bearing falls smoothly to 0, m/s.
inline constexpr double kSmoothSpeed = 2e-3;

// Time in which friction of all bearings stops a robot slower than kSmoothSpeed, s; twice as fast about yaw.
inline double friction_time_scale(double coefficient) {
  return 0.5 * kSmoothSpeed / (std::max(coefficient, 1e-6) * kGravity);
}

// Friction of one bearing, and of all, where rubs(p_W) is true: `coefficient` times its share of the weight,
// against its own velocity.
template <class S, class Rubs>
void add_bearing_friction(const Instant<S>& now, const Eigen::Vector2d& bearing, double coefficient,
                          const Rubs& rubs, PlanarWrench<S>& wrench) {
  using std::sqrt;
  const S normal = now.weight_mass * (kGravity / static_cast<double>(now.plant.bearings_m.size()));
  const Eigen::Vector2d from_com_B = bearing - now.plant.com_B;
  const Vec2<S> r_W = now.R_WB * from_com_B.cast<S>();
  if (!rubs(Vec2<S>(now.state.p_WC + r_W))) return;
  const Vec2<S> v_W = point_velocity<S>(now.state.v_WC, now.state.yaw_rate, r_W);
  const S speed = sqrt(v_W.squaredNorm() + kSmoothSpeed * kSmoothSpeed);
  wrench.add_force_at(Vec2<S>(-(coefficient * normal / speed) * v_W), r_W);
}

template <class S, class Rubs>
void add_bearing_friction(const Instant<S>& now, double coefficient, const Rubs& rubs,
                          PlanarWrench<S>& wrench) {
  for (const Eigen::Vector2d& bearing : now.plant.bearings_m)
    add_bearing_friction(now, bearing, coefficient, rubs, wrench);
}

}  // namespace atmos
