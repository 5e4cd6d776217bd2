// What every lab adds to a flight: thrust that scatters from pulse to pulse, and a small force that drifts.
#pragma once

#include <cstdint>
#include <random>

#include "atmos_model/plant.h"
#include "atmos_model/scenario.h"

namespace atmos {

// One flight's share of it. Depends on seed, time and the valves' movements alone.
class Lab {
 public:
  Lab(const LabSettings& settings, std::uint32_t seed, double start_s, int thruster_count);

  // Whether there is anything at all.
  bool quiet() const { return quiet_; }
  // To be told of every change of the openings: each pulse gets its own strength.
  void valves_moved(const VecX<double>& openings);
  // The random part of the wrench about the centre of mass at time t, which must not go back, where the
  // thrusters push with `thrust` [N]. The slow part is constant over stretches of 10 ms.
  PlanarWrench<double> wrench(double t, const PlantProperties& plant, double yaw, const VecX<double>& thrust);

 private:
  LabSettings settings_;
  bool quiet_;
  double start_s_;
  std::int64_t stretch_ = 0;
  std::mt19937_64 pulses_, drift_;
  VecX<double> before_;  // openings
  VecX<double> excess_;  // of each valve's thrust in its present or last pulse, relative
  PlanarWrench<double> slow_;
};

}  // namespace atmos
