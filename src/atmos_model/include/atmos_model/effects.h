// The registry of effects: the one place that lists them, in the order in which they compose
// (docs/effects.md).
#pragma once

#include <string>
#include <variant>
#include <vector>

#include "atmos_model/effects/floor_tilt.h"
#include "atmos_model/effects/mocap_latency.h"
#include "atmos_model/effects/supply_coupling.h"

namespace atmos {

// In table order: effects of a list are applied in this order however a file lists them.
using Effect = std::variant<SupplyCoupling, FloorTilt, MocapLatency>;

struct EffectInfo {
  std::string kind;
  std::string equation;
  std::vector<ParameterInfo> parameters;
};

// Every registered kind, in table order, with its equation and parameters.
const std::vector<EffectInfo>& registered_effects();
// "supply_coupling".
std::string kind_of(const Effect& effect);

// Reads `effects:` of an open scenario or model file (absent: none); faults are recorded in the file. The
// result is in table order. Only a repeatable kind may stand more than once.
std::vector<Effect> read_effects(const ConfigMap& root);
// Reads a model.yaml. Throws ConfigError with every fault.
std::vector<Effect> load_model(const std::string& path);
// The text of a model.yaml that load_model reads back to the same effects.
std::string write_model(const std::vector<Effect>& effects);

}  // namespace atmos
