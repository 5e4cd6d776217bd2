#include "atmos_sim/batch.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <random>

#include "atmos_sim/simulation.h"

namespace atmos {

namespace {

constexpr double kSameInstant = 1e-7;  // s

std::vector<std::string> split(const std::string& line) {
  std::vector<std::string> cells;
  std::size_t from = 0;
  for (std::size_t comma; (comma = line.find(',', from)) != std::string::npos; from = comma + 1)
    cells.push_back(line.substr(from, comma - from));
  cells.push_back(line.substr(from));
  return cells;
}

std::string command_header(std::size_t thruster_count) {
  std::string header = "stamp_s,period_s";
  for (std::size_t i = 1; i <= thruster_count; ++i) header += ",duty" + std::to_string(i);
  return header;
}

// Shortest text would differ between libraries; 17 digits read back to the same number everywhere.
void put(std::ostream& out, double value, char end) {
  char text[40];
  if (std::isnan(value))
    std::snprintf(text, sizeof text, "nan");  // without the sign that some NaN carry
  else
    std::snprintf(text, sizeof text, "%.17g", value);
  out << text << end;
}

}  // namespace

BatchResult run_batch(const Scenario& scenario, const std::vector<ThrusterCommand>& commands,
                      double start_s) {
  Simulation simulation(scenario, start_s);
  MocapSensor mocap(scenario.mocap, scenario.seed, start_s);
  BatchResult result;
  for (const ThrusterCommand& command : commands) {
    const ValveSchedule::Taken taken = simulation.robot().command(command);
    if (taken == ValveSchedule::Taken::kExpired || taken == ValveSchedule::Taken::kMalformed)
      ++result.unused_commands;
  }
  const double end_s = start_s + scenario.duration_s;
  while (mocap.next_frame_s() <= end_s + kSameInstant) {
    simulation.advance_to(mocap.next_frame_s());
    result.rows.push_back(
        {simulation.time_s(), simulation.robot().truth(), mocap.expose(simulation.robot())});
  }
  result.steps = simulation.steps();
  return result;
}

std::vector<ThrusterCommand> random_commands(const Scenario& scenario, double start_s, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const double period_s = scenario.vehicle.pwm.period_s;
  const double first = std::ceil(start_s / period_s - kSameInstant);
  std::vector<ThrusterCommand> commands;
  for (double k = first; k * period_s < start_s + scenario.duration_s; k += 1.0) {
    ThrusterCommand command{k * period_s, period_s, {}};
    for (std::size_t i = 0; i < scenario.vehicle.thrusters.size(); ++i) {
      const double draw = static_cast<double>(random() >> 11) * 0x1p-53;
      command.duty.push_back(std::min(std::max((draw - 0.125) / 0.75, 0.0), 1.0));
    }
    commands.push_back(std::move(command));
  }
  return commands;
}

std::vector<ThrusterCommand> read_commands(const std::string& path, int thruster_count) {
  std::ifstream in(path);
  if (!in) throw ConfigError({{path, 0, "", "cannot be read"}});
  std::vector<ConfigFault> faults;
  std::vector<ThrusterCommand> commands;
  const std::string header = command_header(static_cast<std::size_t>(thruster_count));
  std::string line;
  int number = 1;
  if (!std::getline(in, line) || line != header) faults.push_back({path, 1, "header", "must be " + header});
  while (std::getline(in, line)) {
    ++number;
    const std::vector<std::string> cells = split(line);
    if (cells.size() != 2 + static_cast<std::size_t>(thruster_count)) {
      faults.push_back({path, number, "row", "must have " + std::to_string(2 + thruster_count) + " numbers"});
      continue;
    }
    std::vector<double> values;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      char* end = nullptr;
      const double value = std::strtod(cells[i].c_str(), &end);
      const std::string column = i == 0 ? "stamp_s" : i == 1 ? "period_s" : "duty" + std::to_string(i - 1);
      const Bounds bounds = i == 0 ? Bounds::any() : i == 1 ? Bounds::positive() : Bounds::between(0.0, 1.0);
      if (cells[i].empty() || *end != '\0')
        faults.push_back({path, number, column, "must be a number"});
      else if (!bounds.contains(value))
        faults.push_back({path, number, column, "must be " + bounds.text()});
      values.push_back(value);
    }
    if (!commands.empty() && values[0] <= commands.back().stamp_s)
      faults.push_back({path, number, "stamp_s", "must be later than in the row before"});
    commands.push_back({values[0], values[1], {values.begin() + 2, values.end()}});
  }
  if (!faults.empty()) throw ConfigError(faults);
  return commands;
}

void write_commands(const std::vector<ThrusterCommand>& commands, std::ostream& out) {
  out << command_header(commands.empty() ? 0 : commands.front().duty.size()) << '\n';
  for (const ThrusterCommand& command : commands) {
    put(out, command.stamp_s, ',');
    put(out, command.period_s, ',');
    for (std::size_t i = 0; i < command.duty.size(); ++i)
      put(out, command.duty[i], i + 1 < command.duty.size() ? ',' : '\n');
  }
}

void write_states(const BatchResult& result, std::ostream& out) {
  out << "stamp_s,x_m,y_m,yaw_rad,vx_m_s,vy_m_s,yaw_rate_rad_s,mocap_stamp_s,mocap_x_m,mocap_y_m,mocap_yaw_"
         "rad\n";
  for (const BatchRow& row : result.rows) {
    const PlanarState<double>& truth = row.truth;
    for (const double value :
         {row.time_s, truth.p_WC.x(), truth.p_WC.y(), truth.yaw, truth.v_WC.x(), truth.v_WC.y(),
          truth.yaw_rate, row.frame.stamp_s, row.frame.pose.p_W.x(), row.frame.pose.p_W.y()})
      put(out, value, ',');
    put(out, row.frame.pose.yaw, '\n');
  }
}

}  // namespace atmos
