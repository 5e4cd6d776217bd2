// Rows of scripts/bench: one JSON object per line on stdout.
#pragma once

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

namespace atmos {

inline void print_row(const std::string& name, const char* unit, double value) {
  std::printf("{\"name\": \"%s\", \"unit\": \"%s\", \"value\": %.6g}\n", name.c_str(), unit, value);
  std::fflush(stdout);
}

// Prints median, 99th percentile and largest of at least one value.
inline void print_row(const std::string& name, const char* unit, std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  std::printf(
      "{\"name\": \"%s\", \"unit\": \"%s\", \"median\": %.6g, \"p99\": %.6g, \"max\": %.6g, \"n\": %zu}\n",
      name.c_str(), unit, values[n / 2], values[std::min(n - 1, n * 99 / 100)], values.back(), n);
  std::fflush(stdout);
}

}  // namespace atmos
