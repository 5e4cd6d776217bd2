// Findings in plain sentences, with numbers and units.
#pragma once

#include <string>

#include "atmos_model/effects.h"

namespace atmos {

// `value` with three significant digits.
std::string short_number(double value);

// What an effect does, in one sentence. `start_s` (ROS time) is what times are told from.
std::string statement_of(const Effect& effect, double start_s);

// The manoeuvre that would tell a claimed kind from the one it is confused with.
std::string experiment_against(const std::string& claimed, const std::string& rival);

}  // namespace atmos
