// Claims seen again when others are known: which are still needed, and which have a better name.
#pragma once

#include <vector>

#include "atmos_sim2real/crossvalidation.h"
#include "atmos_sim2real/search.h"

namespace atmos {

std::vector<Hypothesis> unclaimed(const std::vector<Hypothesis>& all, const std::vector<Claim>& claims);

// Whether an effect of this gain is a wind that is but the slopes of a floor: one without curl would be rare.
bool blows_as_slopes(const Effect& effect, double gain, double gain_of_floor);

constexpr const char* kDoesNotHold = "does not hold on unseen data";

// What happened once, or lies in one place, cannot help where a fit has not seen it.
bool holds_on_unseen_data(const Hypothesis& hypothesis, const BlockEvidence& blocks,
                          const SearchOptions& options);

// The model without each of its effects, refitted.
std::vector<Fit> leave_one_out(const Problem& problem, const Fit& current, const Fit& nominal);

// What came earlier must still be needed beside what came later, or else the worse of the two goes; where
// that is the newest, it has had its turn. Whether any went.
bool drop_needless(const Problem& problem, Fit& current, std::vector<Claim>& claims,
                   std::vector<Claim>& refused, double looseness, const SearchOptions& options);

// Names effects by their simpler forms (simpler_form.h). Whether one was renamed.
bool simplify(const Problem& problem, const std::vector<Hypothesis>& library, Fit& current,
              std::vector<Claim>& claims, const SearchOptions& options);

// An effect was named before its neighbours were known, and may have stood for several: tries the best rivals
// of each in its place, beside all others. `screening`: of the final model. `without_each`: that model
// without each effect. Whether one was replaced.
bool reconsider(const Problem& problem, Fit& current, std::vector<Claim>& claims, const Screening& screening,
                const std::vector<Fit>& without_each, double looseness, const SearchOptions& options);

// Where two effects resemble each other, the wrong one may have been named, and another to make up for it, so
// that only both together can change: tries the nearest rivals with others in place of the rest. Whether
// that is better.
bool reconsider_together(const Problem& problem, const std::vector<Hypothesis>& library, const Fit& nominal,
                         Fit& current, std::vector<Claim>& claims, double looseness,
                         const SearchOptions& options);

}  // namespace atmos
