// Wall time for nodes, tools, tests and benchmarks. Cores are given the time, or a function that tells it;
// scripts/check keeps them from including this.
#pragma once

#include <chrono>

namespace atmos {

// Seconds since some moment in the past, never running back.
inline double steady_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace atmos
