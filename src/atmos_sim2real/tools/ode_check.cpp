#include "ode_check.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "atmos_model/planar.h"
#include "atmos_sim2real/prediction.h"
#include "child.h"

namespace atmos {

namespace {

namespace fs = std::filesystem;

constexpr double kHorizon = 5.0;  // s
constexpr const char* kSimulator = "atmos_sim_replay";

void write_commands(const std::string& path, const std::vector<ThrusterCommand>& commands) {
  std::ofstream out(path);
  out.precision(17);
  out << "stamp_s,period_s";
  for (std::size_t k = 1; k <= commands.front().duty.size(); ++k) out << ",duty" << k;
  out << '\n';
  for (std::size_t i = 0; i < commands.size(); ++i) {
    if (i + 1 < commands.size() && commands[i + 1].stamp_s <= commands[i].stamp_s)
      continue;  // replaced at once
    out << commands[i].stamp_s << ',' << commands[i].period_s;
    for (const double duty : commands[i].duty) out << ',' << duty;
    out << '\n';
  }
}

void write_starts(const std::string& path, const std::vector<WindowStart>& starts) {
  std::ofstream out(path);
  out.precision(17);
  out << "stamp,x,y,yaw,vx,vy,yaw_rate\n";
  for (const WindowStart& start : starts) {
    const PlanarState<double>& s = start.shown;
    out << start.stamp_s << ',' << s.p_WC.x() << ',' << s.p_WC.y() << ',' << s.yaw << ',' << s.v_WC.x() << ','
        << s.v_WC.y() << ',' << s.yaw_rate << '\n';
  }
}

std::vector<PredictedPose> read_rows(const std::string& path) {
  std::ifstream in(path);
  std::string line;
  std::getline(in, line);
  std::vector<PredictedPose> rows;
  while (std::getline(in, line)) {
    PredictedPose row{};
    if (std::sscanf(line.c_str(), "%lf,%lf,%lf,%lf,%lf", &row.window_start_s, &row.stamp_s, &row.x_m,
                    &row.y_m, &row.yaw_rad) != 5)
      throw std::runtime_error("the simulator wrote a row that is none: " + line);
    rows.push_back(row);
  }
  return rows;
}

struct Sums {
  double squares = 0.0, yaw_squares = 0.0, difference = 0.0;
  std::size_t windows = 0;

  nlohmann::ordered_json rms() const {
    if (windows == 0) return {{"position_rms_m", nullptr}, {"yaw_rms_rad", nullptr}};
    const auto n = static_cast<double>(windows);
    return {{"position_rms_m", std::sqrt(squares / n)}, {"yaw_rms_rad", std::sqrt(yaw_squares / n)}};
  }
};

// One model over all recordings.
Sums fly(const std::vector<Recording>& recordings, const Vehicle& vehicle, const std::string& vehicle_path,
         const std::vector<Effect>& effects, const fs::path& folder) {
  Sums sums;
  std::ofstream(folder / "model.yaml") << write_model(effects);
  for (const Recording& recording : recordings) {
    const OpenLoop open_loop(recording, vehicle, effects);
    const std::vector<WindowStart> starts = open_loop.window_starts(kHorizon);
    if (starts.empty()) continue;
    write_commands(folder / "commands.csv", recording.commands);
    write_starts(folder / "starts.csv", starts);
    run_child({simulator_tool(kSimulator), "--vehicle", vehicle_path, "--model", folder / "model.yaml",
               "--commands", folder / "commands.csv", "--initial-states", folder / "starts.csv", "--horizon",
               std::to_string(kHorizon), "--out", folder / "rows.csv"},
              folder / "log");
    const std::vector<PredictedPose> flown = read_rows(folder / "rows.csv");
    const std::vector<PredictedPose> predicted = open_loop.predict(starts, kHorizon);
    const PredictionError error = prediction_error(recording, flown);
    const auto n = static_cast<double>(error.windows);
    sums.windows += error.windows;
    sums.squares += n * error.position_rms_m * error.position_rms_m;
    sums.yaw_squares += n * error.yaw_rms_rad * error.yaw_rms_rad;
    for (std::size_t i = 0; i < std::min(flown.size(), predicted.size()); ++i)
      sums.difference = std::max(
          sums.difference, std::hypot(flown[i].x_m - predicted[i].x_m, flown[i].y_m - predicted[i].y_m));
  }
  return sums;
}

}  // namespace

nlohmann::ordered_json ode_check(const std::vector<Recording>& recordings, const Vehicle& vehicle,
                                 const std::string& vehicle_path, const std::vector<Effect>& nominal,
                                 const std::vector<Effect>& fitted, const std::string& folder) {
  if (!fs::exists(simulator_tool(kSimulator)))
    return {{"skipped", simulator_tool(kSimulator).string() + " is not there"}};
  const fs::path scratch = fs::path(folder) / "ode_check";
  nlohmann::ordered_json check;
  try {
    fs::create_directories(scratch);
    const Sums before = fly(recordings, vehicle, vehicle_path, nominal, scratch);
    const Sums after = fly(recordings, vehicle, vehicle_path, fitted, scratch);
    check = {{"simulator", "atmos_sim (ODE)"}, {"horizon_s", kHorizon},
             {"windows", after.windows},       {"nominal", before.rms()},
             {"fitted", after.rms()},          {"largest_difference_m", after.difference}};
  } catch (const std::exception& error) {
    check = {{"skipped", error.what()}};
  }
  std::error_code none;
  fs::remove_all(scratch, none);
  return check;
}

}  // namespace atmos
