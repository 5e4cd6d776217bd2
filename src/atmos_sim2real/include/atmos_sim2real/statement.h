// Findings in plain sentences, with numbers and units.
#pragma once

#include <string>
#include <vector>

#include "atmos_model/effects.h"

namespace atmos {

// `value` with three significant digits.
std::string short_number(double value);

// When the first command of a recording was given (ROS time).
struct Began {
  std::string recording;
  double at_s;
};

// What an effect does, in one sentence. Times are told from the first command of the recording that they lie
// in, of which it is given the name where there are several; with the deviation of an onset, where that is a
// second or more.
std::string statement_of(const Effect& effect, const std::vector<Began>& recordings,
                         double onset_deviation_s = 0.0);

// The manoeuvre that would tell a claimed kind from the one it is confused with.
std::string experiment_against(const std::string& claimed, const std::string& rival);

}  // namespace atmos
