// Loads a controller file for a vehicle, as the node does. Exit code 2 with one line per fault when something
// is wrong.
#include <CLI/CLI.hpp>

#include <cstdio>
#include <string>

#include "atmos_nmpc/config.h"

int main(int argc, char** argv) {
  std::string vehicle, controller;
  CLI::App app("Checks a controller file against a vehicle file.");
  app.add_option("--vehicle", vehicle, "vehicle file")->required();
  app.add_option("controller", controller, "controller file")->required();
  CLI11_PARSE(app, argc, argv);
  try {
    atmos::load_controller(controller, atmos::load_vehicle(vehicle));
  } catch (const atmos::ConfigError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
  return 0;
}
