#include "atmos_sim/replay.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <stdexcept>

namespace atmos {

namespace {

constexpr double kRow = 0.1;           // s
constexpr double kStep = 1e-3;         // s, of the simulator
constexpr double kSameInstant = 1e-6;  // s

// When the vehicle was as a frame stamped so shows it (docs/effects.md, clock_skew).
double instant_of(double stamp_s, const Plant& plant) {
  const PlantProperties& properties = plant.properties();
  return plant.start_s() +
         (stamp_s - plant.start_s() - properties.mocap_latency_s) / (1.0 + properties.stamp_skew);
}

// One flight through the windows with these numbers, none of which begins before the one before it has ended.
void fly(const Scenario& scenario, const std::vector<ThrusterCommand>& commands, double begin_s,
         const std::vector<ReplayStart>& starts, const std::vector<std::size_t>& windows, int rows,
         std::vector<std::vector<ReplayedPose>>& out) {
  Simulation simulation(scenario, begin_s);
  for (const ThrusterCommand& command : commands) simulation.robot().command(command);
  const Plant& plant = simulation.robot().plant();
  for (const std::size_t w : windows) {
    simulation.advance_to(instant_of(starts[w].stamp_s, plant));
    simulation.robot().set_body(plant.from_measured(starts[w].shown));
    for (int row = 1; row <= rows; ++row) {
      const double stamp = starts[w].stamp_s + row * kRow;
      simulation.advance_to(instant_of(stamp, plant));
      const PlanarState<double> shown = plant.measured(simulation.robot().center_of_mass());
      out[w].push_back({starts[w].stamp_s, stamp, {shown.p_WC, shown.yaw}});
    }
  }
}

}  // namespace

std::vector<ReplayedPose> replay(const Vehicle& vehicle, const std::vector<Effect>& effects,
                                 const std::vector<ThrusterCommand>& commands,
                                 const std::vector<ReplayStart>& starts, double horizon_s) {
  if (commands.empty()) throw std::invalid_argument("there is no command to replay");
  Scenario scenario{};
  scenario.vehicle = vehicle;
  scenario.effects = effects;
  scenario.step_s = kStep;
  const double begin_s = commands.front().stamp_s;
  std::vector<std::size_t> left;
  for (std::size_t w = 0; w < starts.size(); ++w) {
    if (starts[w].stamp_s < begin_s + 0.5 * kRow)
      throw std::invalid_argument("a window starts before the first command acts");
    left.push_back(w);
  }
  std::stable_sort(left.begin(), left.end(),
                   [&](std::size_t a, std::size_t b) { return starts[a].stamp_s < starts[b].stamp_s; });

  const int rows = static_cast<int>(std::lround(horizon_s / kRow));
  std::vector<std::vector<ReplayedPose>> windows(starts.size());
  while (!left.empty()) {
    std::vector<std::size_t> now, later;
    for (const std::size_t w : left) {
      const bool free =
          now.empty() || starts[w].stamp_s > starts[now.back()].stamp_s + rows * kRow - kSameInstant;
      (free ? now : later).push_back(w);
    }
    fly(scenario, commands, begin_s, starts, now, rows, windows);
    left = std::move(later);
  }
  std::vector<ReplayedPose> all;
  for (const auto& window : windows) all.insert(all.end(), window.begin(), window.end());
  return all;
}

std::vector<ReplayStart> read_replay_starts(const std::string& path) {
  std::ifstream in(path);
  std::string line;
  if (!std::getline(in, line) || line != "stamp,x,y,yaw,vx,vy,yaw_rate")
    throw std::invalid_argument(path + ":1: the header must be stamp,x,y,yaw,vx,vy,yaw_rate");
  std::vector<ReplayStart> starts;
  for (int number = 2; std::getline(in, line); ++number) {
    ReplayStart start{};
    PlanarState<double>& s = start.shown;
    char rest = 0;
    const int read = std::sscanf(line.c_str(), "%lf,%lf,%lf,%lf,%lf,%lf,%lf%c", &start.stamp_s, &s.p_WC.x(),
                                 &s.p_WC.y(), &s.yaw, &s.v_WC.x(), &s.v_WC.y(), &s.yaw_rate, &rest);
    const bool finite =
        s.p_WC.allFinite() && s.v_WC.allFinite() && std::isfinite(s.yaw + s.yaw_rate + start.stamp_s);
    if (read != 7 || !finite)
      throw std::invalid_argument(path + ":" + std::to_string(number) + ": a row must be seven numbers");
    starts.push_back(start);
  }
  return starts;
}

void write_replay(const std::vector<ReplayedPose>& rows, std::ostream& out) {
  out << "window_start,stamp,x,y,yaw\n";
  char line[160];
  for (const ReplayedPose& row : rows) {
    std::snprintf(line, sizeof(line), "%.9f,%.9f,%.9f,%.9f,%.9f\n", row.window_start_s, row.stamp_s,
                  row.shown.p_W.x(), row.shown.p_W.y(), row.shown.yaw);
    out << line;
  }
}

}  // namespace atmos
