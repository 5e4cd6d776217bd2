// Loads a scenario and the vehicles it names and prints what a launch needs from it, one `key=value` a line:
// vehicle and controller of the first robot, and the names of all where the file lists robots.
// Exit code 2 with one line per fault when something is wrong.
#include <CLI/CLI.hpp>

#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "atmos_model/scenario.h"

int main(int argc, char** argv) {
  std::string path;
  CLI::App app("Checks a scenario file and the vehicle file it names.");
  app.add_option("scenario", path, "scenario file")->required();
  CLI11_PARSE(app, argc, argv);
  try {
    const std::vector<atmos::Scenario> fleet = atmos::load_fleet(path);
    const atmos::Scenario& scenario = fleet.front();
    const auto absolute = [](const std::string& file) {
      return std::filesystem::weakly_canonical(std::filesystem::absolute(file)).string();
    };
    std::printf("scenario=%s\nvehicle=%s\ncontroller=%s\nname=%s\nduration_s=%g\n", absolute(path).c_str(),
                absolute(scenario.vehicle_path).c_str(), absolute(scenario.controller_path).c_str(),
                scenario.name.c_str(), scenario.duration_s);
    std::string robots;
    for (const atmos::Scenario& member : fleet) robots += (robots.empty() ? "" : " ") + member.robot;
    std::printf("robots=%s\n", robots.c_str());
  } catch (const atmos::ConfigError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
  return 0;
}
