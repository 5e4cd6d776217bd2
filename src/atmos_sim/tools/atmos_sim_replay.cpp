// atmos_sim_replay: recorded commands in the simulator, window by window from recorded states, under a
// model.yaml.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>

#include "atmos_sim/batch.h"
#include "atmos_sim/replay.h"

int main(int argc, char** argv) {
  std::string vehicle_path, model_path, commands_path, starts_path, out_path;
  double horizon_s = 5.0;
  CLI::App app("Flies recorded commands in the simulator, window by window from recorded states.");
  app.add_option("--vehicle", vehicle_path, "vehicle file")->required();
  app.add_option("--model", model_path, "model.yaml; without it the nominal model");
  app.add_option("--commands", commands_path, "CSV: stamp_s,period_s,duty1,...,dutyN")->required();
  app.add_option("--initial-states", starts_path, "CSV of window starts: stamp,x,y,yaw,vx,vy,yaw_rate")
      ->required();
  app.add_option("--horizon", horizon_s, "length of a window [s]")
      ->capture_default_str()
      ->check(CLI::Range(0.1, 1000.0));
  app.add_option("--out", out_path, "CSV to write: window_start,stamp,x,y,yaw")->required();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    const atmos::Vehicle vehicle = atmos::load_vehicle(vehicle_path);
    const std::vector<atmos::Effect> effects =
        model_path.empty() ? std::vector<atmos::Effect>{} : atmos::load_model(model_path, vehicle);
    const auto commands = atmos::read_commands(commands_path, static_cast<int>(vehicle.thrusters.size()));
    const auto rows =
        atmos::replay(vehicle, effects, commands, atmos::read_replay_starts(starts_path), horizon_s);
    std::ofstream out(out_path);
    atmos::write_replay(rows, out);
    if (!out.flush()) throw std::runtime_error(out_path + ": cannot be written");
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 2;
  }
}
