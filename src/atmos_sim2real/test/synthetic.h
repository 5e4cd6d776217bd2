// Flights that a plant of our own really flew, with what every lab adds: for tests.
#pragma once

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "atmos_model/predictor.h"
#include "atmos_model/vehicle.h"
#include "atmos_sim2real/recording.h"

namespace atmos {

inline Vehicle nominal_vehicle() {
  return load_vehicle(std::string(ATMOS_ROOT) + "/config/vehicle/atmos.yaml");
}

struct SyntheticFlight {
  Recording recording;
  std::vector<PlantState> truth;  // one per pose, before noise
};

// Commands: every second another small group of thrusters for a few periods of the PWM grid, then the same
// pulses with the opposite ones, so that the robot stays near its start.
inline std::vector<ThrusterCommand> pulse_commands(double start_s, double duration_s, std::uint32_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> duty(0.2, 1.0);
  std::uniform_int_distribution<int> group(0, 5);
  // Pushes along +x, -x, +y, -y, and turns both ways; each with its opposite.
  const std::vector<std::vector<int>> groups = {{1, 3}, {2, 4}, {6, 8}, {5, 7}, {1, 4}, {2, 3}};
  const int opposite[] = {1, 0, 3, 2, 5, 4};
  std::vector<ThrusterCommand> commands;
  int current = 0;
  std::vector<double> pulses(10, 0.0);
  const int periods = static_cast<int>(std::lround(duration_s / 0.1));
  for (int k = 0; k < periods; ++k) {
    const int second = k / 10;
    if (k % 10 == 0) {
      if (second % 4 == 0) {
        current = group(random);
        for (int p = 0; p < 10; ++p) pulses[static_cast<std::size_t>(p)] = p < 4 ? duty(random) : 0.0;
      } else if (second % 4 == 1) {
        current = opposite[current];
      }
    }
    ThrusterCommand command{start_s + 0.1 * k, 0.1, std::vector<double>(8, 0.0)};
    // Push, brake, push back, brake.
    const int use = second % 4 == 3 ? opposite[current] : current;
    for (const int thruster : groups[static_cast<std::size_t>(use)])
      command.duty[static_cast<std::size_t>(thruster - 1)] = pulses[static_cast<std::size_t>(k % 10)];
    commands.push_back(command);
  }
  return commands;
}

// The same with pulses that last this share of their time.
inline std::vector<ThrusterCommand> shortened(std::vector<ThrusterCommand> commands, double share) {
  for (ThrusterCommand& command : commands) {
    for (double& duty : command.duty) duty *= share;
  }
  return commands;
}

struct Lab {
  double mocap_m = 5e-5, mocap_rad = 2e-4;  // white noise of the poses
  double scatter = 0.02;                    // of each pulse
  double slow_m_s2 = 2e-4;                  // slow random acceleration, correlation time 4 s
  double slow_rad_s2 = 5e-4;
  double scatter_s = 0.1;  // how long a thrust stays the same
};

// Flies `effects` on `commands` from rest at the origin. Nuisances act as velocity changes per 10 ms.
inline SyntheticFlight fly(const Vehicle& vehicle, const std::vector<Effect>& effects,
                           const std::vector<ThrusterCommand>& commands, std::uint32_t seed,
                           const Lab& lab = {}, Eigen::Vector2d start_W = {0.0, 0.0}) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const double t0 = commands.front().stamp_s;
  const Plant plant(vehicle, effects, t0);
  ValveSchedule valves(plant.thruster_count(), plant.properties().timing);
  for (const ThrusterCommand& command : commands) valves.add(command);
  PlantState state;
  state.time_s = t0;
  state.body.p_WC = start_W;
  state.hidden = plant.initial_hidden();
  SyntheticFlight flight;
  flight.recording.name = "synthetic";
  flight.recording.commands = commands;
  Eigen::Vector3d slow(lab.slow_m_s2 * normal(random), lab.slow_m_s2 * normal(random),
                       lab.slow_rad_s2 * normal(random));
  const double dt = 0.01, decay = std::exp(-dt / 4.0), renew = std::sqrt(1.0 - decay * decay);
  std::vector<double> pulse(8, 1.0);
  const int pulse_frames = static_cast<int>(std::lround(lab.scatter_s / dt));
  const int frames = static_cast<int>(std::lround(commands.size() * 10.0));
  for (int i = 0; i <= frames; ++i) {
    if (i % pulse_frames == 0) {
      for (double& factor : pulse) factor = lab.scatter * normal(random);
    }
    if (i > 0) {
      const double t = t0 + dt * i;
      // The pulses' scatter: that part of the thrust which the plant does not know of.
      const std::vector<double> open = valves.openings(t - 0.5 * dt);
      for (std::size_t k = 0; k < open.size(); ++k) {
        const PlanarThruster& thruster = plant.properties().thrusters[k];
        const double impulse = open[k] * pulse[k] * thruster.force_n * dt;
        state.body.v_WC += rotation_WB(state.body.yaw) * thruster.direction * (impulse / vehicle.mass_kg);
        state.body.yaw_rate +=
            impulse * cross2(thruster.position_m, thruster.direction) / vehicle.inertia_kg_m2.z();
      }
      state.body.v_WC += slow.head<2>() * dt;
      state.body.yaw_rate += slow[2] * dt;
      for (int k = 0; k < 3; ++k)
        slow[k] = decay * slow[k] + renew * (k < 2 ? lab.slow_m_s2 : lab.slow_rad_s2) * normal(random);
      advance(plant, valves, t, state);
    }
    flight.truth.push_back(state);
    const PlanarState<double> shown = plant.measured(state.body);
    flight.recording.poses.push_back({state.time_s, shown.p_WC.x() + lab.mocap_m * normal(random),
                                      shown.p_WC.y() + lab.mocap_m * normal(random),
                                      shown.yaw + lab.mocap_rad * normal(random)});
  }
  return flight;
}

// The same without any nuisance.
inline SyntheticFlight fly_ideal(const Vehicle& vehicle, const std::vector<Effect>& effects,
                                 const std::vector<ThrusterCommand>& commands) {
  return fly(vehicle, effects, commands, 1, Lab{0.0, 0.0, 0.0, 0.0, 0.0});
}

}  // namespace atmos
