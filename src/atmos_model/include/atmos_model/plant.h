// The plant: a vehicle with effects. The force law that the simulator, the predictor and the controller
// share.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <variant>
#include <vector>

#include "atmos_model/effects.h"
#include "atmos_model/vehicle.h"

namespace atmos {

template <class S>
using VecX = Eigen::Matrix<S, Eigen::Dynamic, 1>;

// Time derivatives of everything that moves.
template <class S>
struct PlantRate {
  PlanarAcceleration<S> body;
  VecX<S> hidden;
};

// Hidden states are laid out as [gas used (kg), then those of each effect in table order].
class Plant {
 public:
  // `start_s` is t0: the first command stamp of the recording, ROS seconds. The lag of a vehicle's motors
  // counts as thrust_rise unless the effects have one.
  // Throws std::invalid_argument for an effect that does not fit the vehicle; read_effects() tells why.
  Plant(const Vehicle& vehicle, std::vector<Effect> effects, double start_s);

  const PlantProperties& properties() const { return properties_; }
  const std::vector<Effect>& effects() const { return effects_; }
  double start_s() const { return start_s_; }
  int thruster_count() const { return static_cast<int>(properties_.thrusters.size()); }
  int hidden_size() const { return hidden_size_; }
  VecX<double> initial_hidden() const;

  // Forces and torque about the centre of mass at ROS time t [N, N m], openings as commanded (one per
  // thruster).
  template <class S>
  PlanarWrench<S> wrench(double t, const PlanarState<S>& state, const VecX<S>& hidden,
                         const VecX<S>& openings) const {
    Scratch<S> scratch;
    return evaluate(t, state, hidden, openings, scratch).wrench;
  }
  // Accelerations of the centre of mass and rates of the hidden states.
  template <class S>
  PlantRate<S> rate(double t, const PlanarState<S>& state, const VecX<S>& hidden,
                    const VecX<S>& openings) const {
    PlantRate<S> rate;
    this->rate(t, state, hidden, openings, rate);
    return rate;
  }
  // The same into storage that is used again: allocates nothing once `rate` has its size.
  template <class S>
  void rate(double t, const PlanarState<S>& state, const VecX<S>& hidden, const VecX<S>& openings,
            PlantRate<S>& rate) const;
  // Thrust along each thruster's direction [N], leaks included.
  template <class S>
  VecX<S> thrust(double t, const PlanarState<S>& state, const VecX<S>& hidden,
                 const VecX<S>& openings) const {
    Scratch<S> scratch;
    evaluate(t, state, hidden, openings, scratch);
    return Eigen::Map<const VecX<S>>(scratch.own, thruster_count());
  }
  // Mass now [kg], without what sloshes.
  template <class S>
  S mass(double t, const PlanarState<S>& state, const VecX<S>& hidden) const {
    Scratch<S> scratch;
    return evaluate<S>(t, state, hidden, VecX<S>::Zero(thruster_count()), scratch).now.mass;
  }

  // What the mocap shows of a centre-of-mass state: the measured point, its velocity, yaw. Latency is not
  // applied here.
  template <class S>
  PlanarState<S> measured(const PlanarState<S>& state) const {
    PlanarState<S> shown = moved_by<S>(state, properties_.marker_B - properties_.com_B);
    shown.yaw += properties_.mocap_yaw_offset_rad;
    return shown;
  }
  // The inverse: the centre-of-mass state behind a measured one.
  template <class S>
  PlanarState<S> from_measured(PlanarState<S> shown) const {
    shown.yaw -= properties_.mocap_yaw_offset_rad;
    return moved_by<S>(shown, properties_.com_B - properties_.marker_B);
  }

  // Slope of the floor [m/m, world axes] at a place.
  template <class S>
  Vec2<S> floor_slope(const Vec2<S>& p_W) const {
    Vec2<S> slope_W = Vec2<S>::Zero();
    for (const Slot& slot : floors_)
      std::visit([&](const auto& e) { e.slope(p_W, slope_W); }, effects_[slot.effect]);
    return slope_W;
  }

  // The longest step an integrator of the hidden states may take, s.
  double max_step_s() const { return max_step_s_; }
  // ROS times at which forces jump for reasons other than valves, ascending.
  const std::vector<double>& edges() const { return edges_; }

 private:
  // Room for one value per thruster, on the stack.
  template <class S>
  struct Scratch {
    S openings[kMaxThrusters], own[kMaxThrusters], leak[kMaxThrusters];
  };
  template <class S>
  struct Evaluation {
    PlanarWrench<S> wrench;
    Instant<S> now;
  };
  // An effect that has a certain hook, and where its hidden states begin.
  struct Slot {
    std::size_t effect;
    int hidden;
  };

  template <class S>
  Evaluation<S> evaluate(double t, const PlanarState<S>& state, const VecX<S>& hidden,
                         const VecX<S>& openings, Scratch<S>& scratch) const;

  // Each bearing is pushed down its slope by its share of the weight.
  template <class S>
  void add_floor_forces(const Instant<S>& now, PlanarWrench<S>& wrench) const {
    const S share = now.mass * (kGravity / static_cast<double>(properties_.bearings_m.size()));
    for (const Eigen::Vector2d& bearing : properties_.bearings_m) {
      const Eigen::Vector2d from_com_B = bearing - properties_.com_B;
      const Vec2<S> r_W = now.R_WB * from_com_B.cast<S>();
      wrench.add_force_at(Vec2<S>(-share * floor_slope<S>(now.state.p_WC + r_W)), r_W);
    }
  }

  // Calls visit(effect, pointer to its hidden states) for the effects of one hook, in order.
  template <class T, class Visit>
  void for_each(const std::vector<Slot>& slots, T* hidden, const Visit& visit) const {
    for (const Slot& slot : slots)
      std::visit([&](const auto& e) { visit(e, hidden + slot.hidden); }, effects_[slot.effect]);
  }
  void list_hooks();

  PlantProperties properties_;
  std::vector<Effect> effects_;
  double start_s_;
  int hidden_size_ = 1;
  // Only effects that have a hook are asked: most have one or two.
  std::vector<Slot> rises_, masses_, thrusts_, forces_, floors_, hidden_rates_;
  double max_step_s_ = std::numeric_limits<double>::infinity();
  std::vector<double> edges_;
};

template <class S>
Plant::Evaluation<S> Plant::evaluate(double t, const PlanarState<S>& state, const VecX<S>& hidden,
                                     const VecX<S>& openings, Scratch<S>& scratch) const {
  const int n = thruster_count();
  std::copy(openings.data(), openings.data() + n, scratch.openings);
  for_each(rises_, hidden.data(), [&](const auto& e, const S* own) { e.rise(own, scratch.openings, n); });

  using std::abs;
  S open_count(0);
  for (int i = 0; i < n; ++i) open_count += abs(scratch.openings[i]);
  const S whole(properties_.mass_kg);
  const Instant<S> start{
      t,          t - start_s_, properties_, state,    rotation_WB(state.yaw), scratch.openings,
      open_count, whole,        whole,       hidden[0]};
  Evaluation<S> out{{}, start};
  Instant<S>& now = out.now;
  for_each(masses_, hidden.data(), [&](const auto& e, const S*) {
    e.mass(static_cast<const Instant<S>&>(now), now.mass, now.weight_mass);
  });

  for (int i = 0; i < n; ++i) {
    scratch.own[i] = properties_.thrusters[i].force_n * scratch.openings[i];
    scratch.leak[i] = S(0);
  }
  ThrustStage<S> stage{scratch.own, scratch.leak, S(1)};
  for_each(thrusts_, hidden.data(), [&](const auto& e, const S* own) { e.thrust(now, own, stage); });

  Vec2<S> force_B = Vec2<S>::Zero();
  for (int i = 0; i < n; ++i) {
    const PlanarThruster& thruster = properties_.thrusters[i];
    scratch.own[i] = stage.supply * (scratch.own[i] + scratch.leak[i]);
    force_B += scratch.own[i] * thruster.direction.cast<S>();
    out.wrench.torque += scratch.own[i] * cross2(thruster.position_m - properties_.com_B, thruster.direction);
  }
  out.wrench.force_W = now.R_WB * force_B;
  if (!floors_.empty()) add_floor_forces(now, out.wrench);
  for_each(forces_, hidden.data(), [&](const auto& e, const S* own) { e.force(now, own, out.wrench); });
  return out;
}

template <class S>
void Plant::rate(double t, const PlanarState<S>& state, const VecX<S>& hidden, const VecX<S>& openings,
                 PlantRate<S>& rate) const {
  Scratch<S> scratch;
  const Evaluation<S> at = evaluate(t, state, hidden, openings, scratch);
  rate.body.a_WC = at.wrench.force_W / at.now.mass;
  rate.body.yaw_acceleration = at.wrench.torque / S(properties_.inertia_kg_m2);

  rate.hidden.setZero(hidden_size_);
  rate.hidden[0] = properties_.gas_kg_per_open_second * at.now.open_count + properties_.bearing_flow_kg_s;
  const S* first = hidden.data();
  const auto slope_at = [this](const Vec2<S>& p_W) { return floor_slope<S>(p_W); };
  for_each(hidden_rates_, first, [&](const auto& e, const S* own) {
    e.hidden_rate(at.now, openings.data(), rate.body, slope_at, own, rate.hidden.data() + (own - first));
  });
}

}  // namespace atmos
