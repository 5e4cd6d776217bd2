// Shared by the command-line tools: reading what they are given, and ending in good order.
#pragma once

#include <cstdio>
#include <exception>
#include <fstream>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "atmos_model/effects.h"
#include "atmos_model/vehicle.h"
#include "atmos_sim2real/recording.h"
#include "atmos_sim2real/response.h"
#include "atmos_sim2real_ros/bag_reader.h"

namespace atmos {

// Reads and checks a bag; its warnings go to stderr. Throws std::exception with one sentence.
inline Recording read_recording(const std::string& path, const Vehicle& vehicle) {
  Recording recording = clean_recording(read_bag(path), static_cast<int>(vehicle.thrusters.size()));
  for (const std::string& warning : recording.warnings)
    std::fprintf(stderr, "warning: %s: %s\n", path.c_str(), warning.c_str());
  return recording;
}

// The same for a diagnosis: refuses a recording whose motion does not answer the commands as this vehicle's
// would.
inline Recording read_answering(const std::string& path, const Vehicle& vehicle) {
  Recording recording = read_recording(path, vehicle);
  if (const std::string why = refusal(response(recording, vehicle)); !why.empty())
    throw std::invalid_argument(path + ": " + why);
  return recording;
}

// Reads a model.yaml for this vehicle; an empty path is the nominal model. Throws std::exception with one
// sentence per fault.
inline std::vector<Effect> read_model(const std::string& path, const Vehicle& vehicle) {
  if (path.empty()) return {};
  return load_model(path, vehicle);
}

// Throws std::runtime_error when the file cannot be written.
inline void write_text(const std::string& path, const std::string& text) {
  std::ofstream file(path);
  file << text;
  if (!file.flush()) throw std::runtime_error(path + ": cannot be written");
}

// What a tool does; bad input ends it with one message and exit code 2.
template <class Work>
int with_clear_errors(const Work& work) {
  try {
    work();
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 2;
  }
}

}  // namespace atmos
