// report.json: the diagnosis as data, and what its figures are drawn from.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "atmos_sim2real/diagnosis.h"
#include "atmos_sim2real/proof.h"

namespace atmos {

// The effects of a diagnosis as model.yaml lists them: in table order.
std::vector<Effect> claimed_effects(const Diagnosis& diagnosis);

// Where a claim stands among them, and among `effects` of the report.
std::size_t place_in_report(const Diagnosis& diagnosis, std::size_t claim);

// Schema 1 (docs/diagnosis.md). Numbers that do not exist are null.
nlohmann::ordered_json report(const Diagnosis& diagnosis, const Problem& problem, const Proof& proof);

// Paths, mismatch over time and prediction errors, for scripts/report_html.py. `report` names what was found.
nlohmann::ordered_json plot_data(const Diagnosis& diagnosis, const Problem& problem, const Proof& proof);

}  // namespace atmos
