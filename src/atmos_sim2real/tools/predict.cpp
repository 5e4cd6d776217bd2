// predict: open-loop windows of a recording under a model.
#include <CLI/CLI.hpp>

#include "atmos_model/effects.h"
#include "atmos_sim2real/prediction.h"
#include "recordings.h"

namespace {

using namespace atmos;

std::string table(const std::vector<PredictedPose>& rows) {
  std::string text = "window_start,stamp,x,y,yaw\n";
  char line[160];
  for (const PredictedPose& row : rows) {
    std::snprintf(line, sizeof(line), "%.9f,%.9f,%.12g,%.12g,%.12g\n", row.window_start_s, row.stamp_s,
                  row.x_m, row.y_m, row.yaw_rad);
    text += line;
  }
  return text;
}

}  // namespace

int main(int argc, char** argv) {
  std::string vehicle_path, model_path, starts_path, out_path, bag;
  double horizon_s = 5.0;
  CLI::App app("Predicts a recording open loop, window by window, on its recorded commands.");
  app.add_option("bag", bag, "recording (ROS 1 bag)")->required();
  app.add_option("--vehicle", vehicle_path, "vehicle file")->required();
  app.add_option("--out", out_path, "CSV to write: window_start,stamp,x,y,yaw")->required();
  app.add_option("--model", model_path, "model.yaml; without it the nominal model");
  app.add_option("--initial-states", starts_path, "CSV of window starts: stamp,x,y,yaw,vx,vy,yaw_rate");
  app.add_option("--horizon", horizon_s, "length of a window [s]")
      ->capture_default_str()
      ->check(CLI::Range(0.1, 1000.0));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  return with_clear_errors([&] {
    const Vehicle vehicle = load_vehicle(vehicle_path);
    const std::vector<Effect> effects = read_model(model_path, vehicle);
    std::vector<WindowStart> starts;
    if (!starts_path.empty()) starts = read_window_starts(starts_path);
    const Recording recording = read_recording(bag, vehicle);
    const OpenLoop open_loop(recording, vehicle, effects);
    if (starts_path.empty()) starts = open_loop.window_starts(horizon_s);
    if (starts.empty()) throw std::invalid_argument(bag + ": is shorter than one horizon");
    write_text(out_path, table(open_loop.predict(starts, horizon_s)));
    std::printf("%zu windows of %g s: %s\n", starts.size(), horizon_s, out_path.c_str());
  });
}
