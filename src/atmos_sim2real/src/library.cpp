#include "atmos_sim2real/library.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "atmos_sim2real/floor_map.h"
#include "atmos_sim2real/laws.h"

namespace atmos {

namespace {

FreeParameter free_scalar(const std::string& name, double mean, double width, double step) {
  return {0, name, 0, mean, width, step};
}

template <class E>
Hypothesis simple(const E& effect, std::vector<FreeParameter> free) {
  Hypothesis hypothesis;
  hypothesis.kind = E::kKind;
  std::vector<std::string> names;
  for (const FreeParameter& parameter : free) names.push_back(parameter.name);
  hypothesis.starts.push_back({effect, names});
  hypothesis.free = std::move(free);
  return hypothesis;
}

void add_thruster_hypotheses(const Vehicle& vehicle, const std::vector<Flight>& flights,
                             std::vector<Hypothesis>& all) {
  const double which = std::log(static_cast<double>(vehicle.thrusters.size()));
  for (int k = 1; k <= static_cast<int>(vehicle.thrusters.size()); ++k) {
    const auto add = [&](Hypothesis hypothesis) {
      hypothesis.thruster = k;
      hypothesis.penalty = which;
      all.push_back(std::move(hypothesis));
    };
    ThrusterEfficiency weak;
    weak.thruster = k;
    add(simple(weak, {free_scalar("factor", 1.0, 0.25, 1e-3)}));

    ThrusterLeak leak;
    leak.thruster = k;
    add(simple(leak, {free_scalar("fraction", 0.0, 0.05, 1e-4)}));

    ThrusterMisalignment canted;
    canted.thruster = k;
    add(simple(canted, {free_scalar("angle_rad", 0.0, 0.06, 1e-4)}));

    Hypothesis dead;
    dead.kind = ThrusterDead::kKind;
    ThrusterDead from_the_start;
    from_the_start.thruster = k;
    dead.starts.push_back({from_the_start, {}});
    for (const Flight& flight : flights) dead.onsets += flight.recording().duration_s();
    add(std::move(dead));
  }
}

Hypothesis map_hypothesis(Effect map, const Lattice& lattice, const Field& field) {
  lay_out(map, lattice);
  Hypothesis hypothesis;
  hypothesis.kind = kind_of(map);
  hypothesis.map = hypothesis.sure_of_a_fit = true;
  hypothesis.free = free_nodes(map, 0, field);
  hypothesis.starts.push_back({map, components_of(map)});
  return hypothesis;
}

Hypothesis unevenness(const Box& box) {
  // Bearings stand on both sides of the way, and the last cell of a lattice bends wrongly.
  constexpr double kMargin = 0.35;  // m
  return map_hypothesis(FloorUnevenness{},
                        lattice_over(box, kMargin, affordable_spacing(box, kMargin, 0.15, 180)), {6e-4, 0.7});
}

Hypothesis airflow(const Box& box) {
  return map_hypothesis(Airflow{}, lattice_over(box, 0.0, affordable_spacing(box, 0.0, 0.25, 80)),
                        {0.05, 1.2});
}

Hypothesis tether(const Box& box) {
  Hypothesis hypothesis;
  hypothesis.kind = Tether::kKind;
  const double cx = 0.5 * (box.x0 + box.x1), cy = 0.5 * (box.y0 + box.y1);
  const double half_x = 0.5 * (box.x1 - box.x0), half_y = 0.5 * (box.y1 - box.y0);
  for (const double u : {-1.8, -1.0, -0.4, 0.4, 1.0, 1.8}) {
    for (const double v : {-1.8, -1.0, -0.4, 0.4, 1.0, 1.8}) {
      Tether start;
      start.anchor_x_m = cx + u * half_x;
      start.anchor_y_m = cy + v * half_y;
      for (const double slack : {0.0, 0.5, 1.0, 1.5}) {
        start.slack_m = slack;
        hypothesis.starts.push_back({start, {"stiffness_n_m", "damping_n_s_m"}});
      }
    }
  }
  const double reach = 2.0 * std::max(half_x, half_y) + 0.5;
  hypothesis.free = {free_scalar("anchor_x_m", cx, reach, 1e-2), free_scalar("anchor_y_m", cy, reach, 1e-2),
                     free_scalar("slack_m", 0.7, 1.0, 5e-3), free_scalar("stiffness_n_m", 0.0, 0.3, 1e-3),
                     free_scalar("damping_n_s_m", 0.0, 0.2, 1e-3)};
  return hypothesis;
}

// Where bearings stood, a few times a second [m].
std::vector<Eigen::Vector2d> bearing_places(const Vehicle& vehicle, const std::vector<Flight>& flights) {
  constexpr double kEvery = 0.2;  // s
  const std::vector<Eigen::Vector2d> bearings = Plant(vehicle, {}, 0.0).properties().bearings_m;
  std::vector<Eigen::Vector2d> places;
  for (const Flight& flight : flights) {
    double next = flight.times().front();
    for (const PoseSample& pose : flight.poses()) {
      if (pose.time_s < next) continue;
      next = pose.time_s + kEvery;
      for (const Eigen::Vector2d& bearing : bearings)
        places.push_back(Eigen::Vector2d(pose.x_m, pose.y_m) + Eigen::Rotation2Dd(pose.yaw_rad) * bearing);
    }
  }
  return places;
}

// Discs that a bearing touched, over a small floor closer together: one that holds the robot in a hover may
// lie beside all places that its centre visited.
Hypothesis friction_patch(const Vehicle& vehicle, const std::vector<Flight>& flights, const Box& box) {
  constexpr double kRadii[] = {0.3, 0.6}, kBeyond = 0.4, kClosest = 0.15, kFarthest = 0.35;  // m
  constexpr double kCentres = 150.0;
  const double width = box.x1 - box.x0 + 2.0 * kBeyond, height = box.y1 - box.y0 + 2.0 * kBeyond;
  const double spacing = std::clamp(std::sqrt(width * height / kCentres), kClosest, kFarthest);
  const std::vector<Eigen::Vector2d> bearings = bearing_places(vehicle, flights);
  Hypothesis hypothesis;
  hypothesis.kind = FrictionPatch::kKind;
  hypothesis.local = true;
  for (double x = box.x0 - kBeyond; x <= box.x1 + kBeyond; x += spacing) {
    for (double y = box.y0 - kBeyond; y <= box.y1 + kBeyond; y += spacing) {
      for (const double radius : kRadii) {
        const bool touched = std::any_of(bearings.begin(), bearings.end(), [&](const Eigen::Vector2d& at) {
          return (at - Eigen::Vector2d(x, y)).squaredNorm() < radius * radius;
        });
        if (!touched) continue;
        FrictionPatch patch;
        patch.center_x_m = x;
        patch.center_y_m = y;
        patch.radius_m = radius;
        hypothesis.starts.push_back({patch, {"coefficient"}});
      }
    }
  }
  const double cx = 0.5 * (box.x0 + box.x1), cy = 0.5 * (box.y0 + box.y1);
  hypothesis.free = {free_scalar("coefficient", 0.0, 2e-3, 2e-5),
                     free_scalar("center_x_m", cx, 0.5 * (box.x1 - box.x0) + 0.3, 1e-2),
                     free_scalar("center_y_m", cy, 0.5 * (box.y1 - box.y0) + 0.3, 1e-2),
                     free_scalar("radius_m", 0.4, 0.4, 1e-2)};
  return hypothesis;
}

// The flights are far from linear in a delay that is longer than most pulses.
template <class Delay>
Hypothesis late() {
  Hypothesis hypothesis = simple(Delay{}, {free_scalar("delay_s", 0.0, 0.03, 1e-3)});
  for (const double delay : {0.02, 0.05}) {
    Delay start;
    start.delay_s = delay;
    hypothesis.starts.push_back({start, {}});
  }
  return hypothesis;
}

// Pulses that are shorter than the delay of opening vanish, which no slope at zero delay tells.
Hypothesis valve_delay() {
  Hypothesis hypothesis = simple(
      ValveDelay{}, {free_scalar("open_s", 0.0, 0.015, 2e-5), free_scalar("close_s", 0.0, 0.015, 2e-5)});
  for (const double shorter : {0.002, 0.006}) {
    for (const double longer : {0.004, 0.012}) {
      for (const auto& [open, close] : {std::pair(shorter, longer), std::pair(longer, shorter)}) {
        ValveDelay start;
        start.open_s = open;
        start.close_s = close;
        hypothesis.starts.push_back({start, {}});
      }
    }
  }
  return hypothesis;
}

Hypothesis slosh(const Vehicle& vehicle) {
  Hypothesis hypothesis;
  hypothesis.kind = Slosh::kKind;
  const auto start_at = [&](double frequency_hz, double x_m, double y_m) {
    Slosh start;
    start.mass_kg = 0.0;
    start.frequency_hz = frequency_hz;
    start.damping_ratio = 0.1;
    start.x_m = x_m;
    start.y_m = y_m;
    hypothesis.starts.push_back({start, {"mass_kg"}});
  };
  // As far apart as such a resonance is wide, or one that lies between two goes unseen.
  for (double f = 0.15; f < 4.0; f *= 1.1) start_at(f, 0.0, 0.0);
  // The faster it swings, the more it follows the body like an offset of the centre of mass: what it does
  // beyond that is seen where it has a lever.
  constexpr double kLever = 0.06;  // m
  for (double f = 0.7; f < 2.5; f *= 1.2) {
    for (const double lever : {kLever, -kLever}) {
      start_at(f, lever, 0.0);
      start_at(f, 0.0, lever);
    }
  }
  hypothesis.free = {free_scalar("mass_kg", 0.0, 0.7, 1e-2), free_scalar("frequency_hz", 0.8, 0.8, 2e-3),
                     free_scalar("damping_ratio", 0.05, 0.08, 2e-3), free_scalar("x_m", 0.0, 0.08, 2e-3),
                     free_scalar("y_m", 0.0, 0.08, 2e-3)};
  hypothesis.free.front().most = Slosh::kMostOfVehicle * vehicle.mass_kg;
  return hypothesis;
}

}  // namespace

bool same_subject(const Hypothesis& a, const Hypothesis& b) {
  return a.kind == b.kind && a.thruster == b.thruster && a.law == b.law;
}

const std::vector<std::vector<std::string>>& inseparable() {
  static const std::vector<std::vector<std::string>> sets = {
      {"thrust_scale", "mass_error + inertia_error"},
      {"floor_tilt", "airflow (uniform)"},
      {"thruster_dead", "lost command bit"},
      {"yaw_misalignment", "thruster_misalignment (the same of every thruster)"},
      {"command_delay", "mocap_latency", "clock offset"}};
  return sets;
}

std::vector<Hypothesis> hypotheses(const Vehicle& vehicle, const std::vector<Flight>& flights) {
  std::vector<Hypothesis> all;
  all.push_back(simple(ThrustScale{}, {free_scalar("factor", 1.0, 0.15, 1e-3)}));
  add_thruster_hypotheses(vehicle, flights, all);
  all.push_back(late<CommandDelay>());
  all.push_back(valve_delay());
  Hypothesis rise;
  rise.kind = ThrustRise::kKind;
  for (const double tau : {0.005, 0.02}) {
    ThrustRise start;
    start.time_constant_s = tau;
    rise.starts.push_back({start, {}});
  }
  rise.penalty = std::log(2.0);  // the delay that it resembles may be one of commands or of poses
  rise.free = {free_scalar("time_constant_s", 0.0, 0.03, 5e-4)};
  all.push_back(rise);

  // A supply gives no more to many valves than to one, and no more out of an emptier bottle.
  all.push_back(simple(SupplyCoupling{}, {free_scalar("fraction_per_open_thruster", 0.0, 0.08, 1e-4)}));
  all.back().free.front().least = 0.0;
  Hypothesis droop;
  droop.kind = SupplyDroop::kKind;
  for (const double recovery : {0.1, 0.3, 1.0, 3.0, 10.0}) {
    SupplyDroop start;
    start.recovery_s = recovery;
    droop.starts.push_back({start, {"loss_per_s"}});
  }
  droop.free = {free_scalar("loss_per_s", 0.0, 0.4, 1e-3), free_scalar("recovery_s", 1.0, 2.0, 1e-2)};
  all.push_back(droop);
  all.push_back(simple(PressureDecay{}, {free_scalar("fraction_per_kg", 0.0, 0.6, 1e-3)}));
  all.back().free.front().least = 0.0;

  all.push_back(simple(MassError{}, {free_scalar("factor", 1.0, 0.12, 1e-3)}));
  all.push_back(simple(InertiaError{}, {free_scalar("factor", 1.0, 0.15, 1e-3)}));
  MassDepletion depletion;
  depletion.kg_per_open_second = 0.0;
  all.push_back(simple(depletion, {free_scalar("kg_per_open_second", 0.0, 0.015, 1e-4)}));
  all.push_back(
      simple(ComOffset{}, {free_scalar("x_m", 0.0, 0.015, 1e-4), free_scalar("y_m", 0.0, 0.015, 1e-4)}));
  all.push_back(slosh(vehicle));

  all.push_back(simple(FloorTilt{},
                       {free_scalar("slope_x", 0.0, 8e-4, 1e-5), free_scalar("slope_y", 0.0, 8e-4, 1e-5)}));
  const Box box = visited(flights);
  all.push_back(unevenness(box));
  all.push_back(airflow(box));
  all.push_back(tether(box));
  all.push_back(simple(ViscousDrag{}, {free_scalar("linear_n_s_m", 0.0, 1.5, 1e-3),
                                       free_scalar("angular_n_m_s", 0.0, 0.04, 1e-4)}));
  all.push_back(simple(QuadraticDrag{}, {free_scalar("coefficient_n_s2_m2", 0.0, 8.0, 1e-2)}));
  all.push_back(simple(CoulombFriction{}, {free_scalar("coefficient", 0.0, 1e-3, 1e-5)}));
  all.push_back(friction_patch(vehicle, flights, box));

  all.push_back(late<MocapLatency>());
  all.push_back(
      simple(MarkerOffset{}, {free_scalar("x_m", 0.0, 0.02, 1e-4), free_scalar("y_m", 0.0, 0.02, 1e-4)}));
  all.push_back(simple(YawMisalignment{}, {free_scalar("angle_rad", 0.0, 0.04, 1e-4)}));
  all.push_back(simple(ClockSkew{}, {free_scalar("ratio", 0.0, 1e-3, 1e-6)}));
  for (Hypothesis& law : laws(vehicle, flights)) all.push_back(std::move(law));
  return all;
}

}  // namespace atmos
