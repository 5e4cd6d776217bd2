#include "atmos_sim2real/merge.h"

#include <algorithm>

#include "atmos_sim2real/laws.h"

namespace atmos {

namespace {

// Makes effect `from` part of effect `to`: its free parameters go over to it, or leave.
void absorb(Fit& fit, std::vector<Claim>& claims, std::size_t from, std::size_t to, bool keep_parameters) {
  claims[to].gain += claims[from].gain;
  claims[to].heldout_gain += claims[from].heldout_gain;
  claims[to].inclusion = std::max(claims[to].inclusion, claims[from].inclusion);
  if (keep_parameters) {
    for (FreeParameter& parameter : fit.free) {
      if (parameter.effect == from) parameter.effect = to;
    }
  }
  fit.take_out(from);
  claims.erase(claims.begin() + static_cast<long>(from));
}

}  // namespace

void merge_floor(Fit& fit, std::vector<Claim>& claims) {
  std::size_t tilt = fit.effects.size(), map = fit.effects.size();
  for (std::size_t i = 0; i < fit.effects.size(); ++i) {
    if (std::holds_alternative<FloorTilt>(fit.effects[i])) tilt = i;
    if (std::holds_alternative<FloorUnevenness>(fit.effects[i])) map = i;
  }
  if (tilt == fit.effects.size() || map == fit.effects.size()) return;
  const FloorTilt slope = std::get<FloorTilt>(fit.effects[tilt]);
  FloorUnevenness& floor = std::get<FloorUnevenness>(fit.effects[map]);
  for (std::size_t j = 0; j < floor.height_m.size(); ++j) {
    for (std::size_t i = 0; i < floor.height_m[j].size(); ++i) {
      floor.height_m[j][i] += floor.grid.spacing_m * (slope.slope_x * static_cast<double>(i) +
                                                      slope.slope_y * static_cast<double>(j));
    }
  }
  absorb(fit, claims, tilt, map, false);
}

void merge_laws(Fit& fit, std::vector<Claim>& claims) {
  std::size_t first = fit.effects.size();
  for (std::size_t i = 0; i < fit.effects.size(); ++i) {
    if (!std::holds_alternative<Unmodelled>(fit.effects[i])) continue;
    if (first == fit.effects.size()) {
      first = i;
      continue;
    }
    Unmodelled& law = std::get<Unmodelled>(fit.effects[first]);
    const std::size_t before = law.coefficients.size();
    law = joined(law, std::get<Unmodelled>(fit.effects[i]));
    for (FreeParameter& free : fit.free) {
      if (free.effect == i) free.element += before;
    }
    claims[first].hypothesis.law += "; " + claims[i].hypothesis.law;
    absorb(fit, claims, i, first, true);
    --i;
  }
}

}  // namespace atmos
