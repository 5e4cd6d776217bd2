#include "next_experiment.h"

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "child.h"
#include "recordings.h"

namespace atmos {

namespace {

namespace fs = std::filesystem;

struct Undecided {
  std::size_t claim;
  const Tried* rival;
};

std::optional<Undecided> undecided(const Diagnosis& diagnosis) {
  for (std::size_t i = 0; i < diagnosis.search.claims.size(); ++i) {
    const std::vector<std::string>& same = diagnosis.indistinguishable[i];
    for (const Tried& rival : diagnosis.search.claims[i].rivals) {
      if (std::find(same.begin(), same.end(), rival.hypothesis.kind) != same.end())
        return Undecided{i, &rival};
    }
  }
  return {};
}

// A scenario of the simulator: the manoeuvre, the claimed effects and the noise that was found.
void write_scenario(const fs::path& path, const Manoeuvre& manoeuvre, const std::string& vehicle_path,
                    const Vehicle& vehicle, const std::vector<Effect>& effects, const NoiseModel& noise) {
  const std::string vehicle_file = fs::absolute(vehicle_path).string();
  const Setpoint& first = manoeuvre.setpoints.front();
  std::ofstream out(path);
  out << "name: next_experiment\nvehicle: " << vehicle_file << "\ncontroller: " << vehicle_file
      << "\nduration_s: " << manoeuvre.duration_s << "\nseed: 1\nstart: {x_m: " << first.x_m
      << ", y_m: " << first.y_m << ", yaw_deg: " << first.yaw_deg
      << "}\nmocap: {rate_hz: 100.0, noise_m: " << noise.mocap[kX] << ", noise_rad: " << noise.mocap[kYaw]
      << "}\nlab: {thrust_scatter: " << noise.scatter
      << ", slow_force_n: " << noise.slow[kX] * vehicle.mass_kg
      << ", slow_torque_n_m: " << noise.slow[kYaw] * vehicle.inertia_kg_m2.z() << ", slow_time_s: 4.0}\n"
      << setpoint_file(manoeuvre) << write_model(effects);
}

}  // namespace

std::optional<NextExperiment> next_experiment(const Diagnosis& diagnosis, const Problem& problem,
                                              const std::string& vehicle_path, const std::string& folder) {
  const std::optional<Undecided> open = undecided(diagnosis);
  if (!open) return {};
  const Fit& final = diagnosis.search.final;
  std::vector<Effect> present = problem.known;
  present.insert(present.end(), final.effects.begin(), final.effects.end());
  const fs::path scratch = fs::path(folder) / "next_experiment";
  fs::create_directories(scratch);
  std::optional<NextExperiment> best;
  for (Manoeuvre& manoeuvre : manoeuvres(visited(*problem.flights))) {
    write_scenario(scratch / "scenario.yaml", manoeuvre, vehicle_path, *problem.vehicle, present,
                   final.noise);
    run_child(
        {simulator_tool("atmos_sim_flight"), scratch / "scenario.yaml", "--bag", scratch / "flight.bag"},
        scratch / "log");
    std::vector<Flight> flown;
    flown.emplace_back(read_recording(scratch / "flight.bag", *problem.vehicle));
    const double nats = separation({problem.vehicle, problem.known, &flown}, final, *open->rival);
    if (!best || nats > best->expected_nats)
      best = NextExperiment{open->claim, open->rival->hypothesis.kind, std::move(manoeuvre), nats};
  }
  fs::remove_all(scratch);
  return best;
}

}  // namespace atmos
