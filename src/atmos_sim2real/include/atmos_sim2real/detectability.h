// What flights would have shown: the smallest size of every kind that the search would have accepted.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "atmos_sim2real/search.h"

namespace atmos {

struct Detectable {
  std::string parameter;
  double value = 0.0;  // distance from the value without effect
  std::string unit;
};

// By kind, beside the other effects of the final model; a kind that was claimed is judged as if it had not
// been. Maps: standard deviation of their field. thruster_dead: seconds of flight with the valve dead.
// floor_vibration: at 1 Hz. Sizes are to first order, for the thruster and the start that show most.
std::map<std::string, Detectable> smallest_detectable(const Problem& problem, const Fit& final,
                                                      const std::vector<Hypothesis>& library,
                                                      const SearchOptions& options);

}  // namespace atmos
