// fit_all: what system identification without hypotheses does, as a baseline of the blind benchmark
// (docs/blind.md): every parameter of one list is fitted to windows of the recording by Gauss-Newton on the
// output error, with deviations out of s^2 (J'J)^-1, and whatever lies clearly off its nominal value is
// claimed.
#include <CLI/CLI.hpp>
#include <Eigen/Cholesky>
#include <cmath>
#include <nlohmann/json.hpp>

#include "atmos_model/effects.h"
#include "atmos_model/predictor.h"
#include "recordings.h"

namespace {

using namespace atmos;

constexpr double kWindow = 2.0, kRow = 0.1;  // s
constexpr double kHalfFit = 0.15;            // s of poses on either side of a window's start, for its state
constexpr double kArm = 0.15;                // m: weighs yaw against position
constexpr int kIterations = 8;
constexpr double kClaim = 4.0;  // deviations

// One number of the list.
struct Knob {
  std::string kind, parameter;
  int thruster;  // 0: none
  double neutral, step, least, most;
};

std::vector<Knob> knobs(int thrusters) {
  std::vector<Knob> all;
  for (int k = 1; k <= thrusters; ++k)
    all.push_back({"thruster_efficiency", "factor", k, 1.0, 1e-3, 0.0, 1.2});
  all.push_back({"inertia_error", "factor", 0, 1.0, 1e-3, 0.3, 3.0});
  for (const char* axis : {"x_m", "y_m"}) all.push_back({"com_offset", axis, 0, 0.0, 1e-4, -0.1, 0.1});
  for (const char* axis : {"slope_x", "slope_y"})
    all.push_back({"floor_tilt", axis, 0, 0.0, 1e-5, -0.02, 0.02});
  all.push_back({"viscous_drag", "linear_n_s_m", 0, 0.0, 1e-2, 0.0, 50.0});
  all.push_back({"viscous_drag", "angular_n_m_s", 0, 0.0, 1e-3, 0.0, 5.0});
  all.push_back({"quadratic_drag", "coefficient_n_s2_m2", 0, 0.0, 1e-1, 0.0, 99.0});
  all.push_back({"coulomb_friction", "coefficient", 0, 0.0, 1e-6, 0.0, 0.1});
  all.push_back({"supply_coupling", "fraction_per_open_thruster", 0, 0.0, 1e-3, -0.05, 0.3});
  all.push_back({"command_delay", "delay_s", 0, 0.0, 1e-3, -0.1, 0.3});
  all.push_back({"yaw_misalignment", "angle_rad", 0, 0.0, 1e-3, -0.5, 0.5});
  return all;
}

// The same through the reader of model.yaml, so that nothing is typed twice.
std::string model_text(const std::vector<Knob>& all, const Eigen::VectorXd& values) {
  std::string text = "effects:\n", kind;
  int thruster = -1;
  char number[40];
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all[i].kind != kind || all[i].thruster != thruster) {
      text += (i > 0 ? "}}\n" : std::string()) + "  - {kind: " + all[i].kind + ", parameters: {";
      if (all[i].thruster > 0) text += "thruster: " + std::to_string(all[i].thruster) + ", ";
    } else {
      text += ", ";
    }
    kind = all[i].kind;
    thruster = all[i].thruster;
    std::snprintf(number, sizeof(number), "%.12e", values[static_cast<Eigen::Index>(i)]);
    text += all[i].parameter + ": " + number;
  }
  return text + "}}\n";
}

std::vector<Effect> effects_of(const std::vector<Knob>& all, const Eigen::VectorXd& values,
                               const Vehicle& vehicle) {
  const ConfigFile file = ConfigFile::from_text(model_text(all, values), "fit_all");
  std::vector<Effect> effects = read_effects(file.root(), &vehicle);
  file.check();
  return effects;
}

struct Window {
  double start_s;
  PlanarState<double> shown;
  std::vector<std::size_t> poses;  // what is compared: about one per kRow
};

// Quadratic fits to the poses around every start.
std::vector<Window> windows_of(const Recording& recording) {
  const auto& poses = recording.poses;
  std::vector<Window> windows;
  for (double start = poses.front().time_s + kHalfFit; start + kWindow < poses.back().time_s;
       start += kWindow) {
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero(), b = A;
    Window window{start, {}, {}};
    int used = 0;
    double due = start + kRow;
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const double dt = poses[i].time_s - start;
      if (std::abs(dt) < kHalfFit) {
        const Eigen::Vector3d row(1.0, dt, dt * dt);
        A += row * row.transpose();
        b += row * Eigen::RowVector3d(poses[i].x_m, poses[i].y_m, poses[i].yaw_rad);
        ++used;
      }
      if (poses[i].time_s >= due && poses[i].time_s <= start + kWindow) {
        window.poses.push_back(i);
        due = poses[i].time_s + kRow - 1e-3;
      }
    }
    if (used < 8) continue;
    const Eigen::Matrix3d fit = A.ldlt().solve(b);
    window.shown.p_WC = fit.row(0).head<2>();
    window.shown.yaw = fit(0, 2);
    window.shown.v_WC = fit.row(1).head<2>();
    window.shown.yaw_rate = fit(1, 2);
    windows.push_back(window);
  }
  return windows;
}

Eigen::VectorXd residual(const Recording& recording, const std::vector<Window>& windows,
                         const Vehicle& vehicle, const std::vector<Effect>& effects) {
  const Plant plant(vehicle, effects, recording.start_s());
  ValveSchedule valves(plant.thruster_count(), plant.properties().timing);
  for (const ThrusterCommand& command : recording.commands) valves.add(command);
  std::vector<double> out;
  for (const Window& window : windows) {
    PlantState state{window.start_s, plant.from_measured(window.shown), plant.initial_hidden()};
    for (const std::size_t i : window.poses) {
      const PoseSample& pose = recording.poses[i];
      advance(plant, valves, pose.time_s, state);
      const PlanarState<double> shown = plant.measured(state.body);
      out.push_back(pose.x_m - shown.p_WC.x());
      out.push_back(pose.y_m - shown.p_WC.y());
      out.push_back(kArm * wrap_angle(pose.yaw_rad - shown.yaw));
    }
  }
  return Eigen::Map<Eigen::VectorXd>(out.data(), static_cast<Eigen::Index>(out.size()));
}

struct Result {
  Eigen::VectorXd values, deviations;
};

Result fit(const Recording& recording, const Vehicle& vehicle, const std::vector<Knob>& all) {
  const std::vector<Window> windows = windows_of(recording);
  if (windows.size() < 5) throw std::invalid_argument(recording.name + ": too short");
  const auto n = static_cast<Eigen::Index>(all.size());
  Eigen::VectorXd values(n);
  for (Eigen::Index i = 0; i < n; ++i) values[i] = all[static_cast<std::size_t>(i)].neutral;
  const auto at = [&](const Eigen::VectorXd& x) {
    return residual(recording, windows, vehicle, effects_of(all, x, vehicle));
  };
  Eigen::VectorXd r = at(values);
  Eigen::MatrixXd JtJ(n, n);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Eigen::MatrixXd J(r.size(), n);
    for (Eigen::Index i = 0; i < n; ++i) {
      Eigen::VectorXd moved = values;
      const Knob& knob = all[static_cast<std::size_t>(i)];
      // Inwards at an upper bound.
      const double step = values[i] + knob.step > knob.most ? -knob.step : knob.step;
      moved[i] += step;
      J.col(i) = (at(moved) - r) / step;
    }
    JtJ = J.transpose() * J;
    const Eigen::VectorXd full =
        -(JtJ + 1e-9 * Eigen::MatrixXd(JtJ.diagonal().asDiagonal())).ldlt().solve(J.transpose() * r);
    bool better = false;
    for (double share = 1.0; share > 0.1 && !better; share *= 0.5) {
      Eigen::VectorXd next = values + share * full;
      for (Eigen::Index i = 0; i < n; ++i) {
        const Knob& knob = all[static_cast<std::size_t>(i)];
        next[i] = std::min(std::max(next[i], knob.least), knob.most);
      }
      const Eigen::VectorXd r_next = at(next);
      if (r_next.squaredNorm() >= r.squaredNorm() * (1.0 - 1e-6)) continue;
      values = next;
      r = r_next;
      better = true;
    }
    if (!better) break;
  }
  const double variance = r.squaredNorm() / static_cast<double>(r.size() - n);
  const Eigen::MatrixXd covariance = variance * JtJ.ldlt().solve(Eigen::MatrixXd::Identity(n, n));
  return {values, covariance.diagonal().cwiseMax(0.0).cwiseSqrt()};
}

// report.json as far as the benchmark reads it: one entry per kind and thruster, claimed where a parameter is
// clear.
nlohmann::ordered_json report_of(const std::vector<Knob>& all, const Result& result) {
  nlohmann::ordered_json effects = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < all.size();) {
    nlohmann::ordered_json parameters = nlohmann::ordered_json::object();
    if (all[i].thruster > 0)
      parameters["thruster"] = {{"value", all[i].thruster}, {"std", nullptr}, {"unit", "1"}};
    double score = 0.0;
    std::size_t j = i;
    for (; j < all.size() && all[j].kind == all[i].kind && all[j].thruster == all[i].thruster; ++j) {
      const auto p = static_cast<Eigen::Index>(j);
      parameters[all[j].parameter] = {
          {"value", result.values[p]}, {"std", result.deviations[p]}, {"unit", ""}};
      if (result.deviations[p] > 0.0)
        score = std::max(score, std::abs(result.values[p] - all[j].neutral) / result.deviations[p]);
    }
    if (score > kClaim)
      effects.push_back({{"kind", all[i].kind},
                         {"parameters", parameters},
                         {"evidence", {{"log_likelihood_gain", 0.5 * score * score}}},
                         {"indistinguishable_from", nlohmann::ordered_json::array()}});
    i = j;
  }
  return {{"verdict", effects.empty() ? "consistent" : "explained"},
          {"mismatch", {{"p_value", nullptr}, {"smallest_detectable", nlohmann::ordered_json::object()}}},
          {"effects", effects}};
}

}  // namespace

int main(int argc, char** argv) {
  std::string vehicle_path, out, bag;
  CLI::App app("Fits every parameter of one list to a recording, as a baseline of the diagnosis.");
  app.add_option("bag", bag, "recording (ROS 1 bag)")->required();
  app.add_option("--vehicle", vehicle_path, "vehicle file")->required();
  app.add_option("--out", out, "folder to write report.json and model.yaml into; it must exist")->required();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  return with_clear_errors([&] {
    const Vehicle vehicle = load_vehicle(vehicle_path);
    const Recording recording = read_recording(bag, vehicle);
    const std::vector<Knob> all = knobs(static_cast<int>(vehicle.thrusters.size()));
    const Result result = fit(recording, vehicle, all);
    write_text(out + "/model.yaml", model_text(all, result.values));
    write_text(out + "/report.json", report_of(all, result).dump(1) + "\n");
  });
}
