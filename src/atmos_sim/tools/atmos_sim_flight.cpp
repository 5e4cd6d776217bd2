// atmos_sim_flight: flies a scenario's set-points in closed loop, without a ROS master, and writes the
// recording a lab would have: a bag of poses, commands and set-points. What the lab does not have goes to a
// table.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>

#include "atmos_sim/pilot.h"
#include "bag_of_flight.h"

namespace {

using namespace atmos;

// The motion that the mocap would have shown without error, by its own stamps: the format of `predict`'s
// window starts.
void write_shown(const std::string& path, const PilotedFlight& flight) {
  std::ofstream out(path);
  out << "stamp,x,y,yaw,vx,vy,yaw_rate\n";
  char line[200];
  for (const PilotedRow& row : flight.rows) {
    const PlanarState<double>& s = row.shown;
    std::snprintf(line, sizeof(line), "%.9f,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f\n", row.row.frame.stamp_s,
                  s.p_WC.x(), s.p_WC.y(), s.yaw, s.v_WC.x(), s.v_WC.y(), s.yaw_rate);
    out << line;
  }
  if (!out.flush()) throw std::runtime_error(path + ": cannot be written");
}

}  // namespace

int main(int argc, char** argv) {
  std::string scenario_path, bag_path, shown_path, robot = "atmos";
  double start_s = 1000.0;
  PilotGains gains;
  CLI::App app("Flies a scenario's set-points in closed loop and writes the recording.");
  app.add_option("scenario", scenario_path, "scenario file")->required();
  app.add_option("--bag", bag_path, "bag to write: mocap/pose, thruster_command, setpoint")->required();
  app.add_option("--shown", shown_path,
                 "CSV of the motion shown, free of error: stamp,x,y,yaw,vx,vy,yaw_rate");
  app.add_option("--robot", robot, "namespace of the topics")->capture_default_str();
  app.add_option("--start", start_s, "ROS time of the start [s], a whole multiple of the PWM period")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  app.add_option("--natural-frequency", gains.natural_frequency_rad_s, "of the pilot [rad/s]")
      ->capture_default_str()
      ->check(CLI::Range(0.05, 3.0));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    const Scenario scenario = load_scenario(scenario_path);
    const PilotedFlight flight = fly_piloted(scenario, gains, start_s);
    write_bag(bag_path, scenario, flight, start_s, robot);
    if (!shown_path.empty()) write_shown(shown_path, flight);
    std::printf("%zu frames, %zu commands: %s\n", flight.rows.size(), flight.commands.size(),
                bag_path.c_str());
    return 0;
  } catch (const ConfigError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "atmos_sim_flight: %s\n", error.what());
    return 1;
  }
}
