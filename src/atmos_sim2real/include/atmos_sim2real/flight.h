// One recording prepared for fitting: frames, the smoothed motion along which forces are evaluated, and valve
// edges.
#pragma once

#include <array>
#include <vector>

#include "atmos_model/plant.h"
#include "atmos_sim2real/recording.h"
#include "atmos_sim2real/whitener.h"

namespace atmos {

// Per frame interval i (from frame i to i + 1): what a plant's forces add to velocity and position of its
// centre of mass, and per frame the pose of the centre of mass that the plant reads out of the measurement.
struct ForceIntegrals {
  std::array<std::vector<double>, kAxes> measured;
  std::array<std::vector<double>, kAxes> dv;
  std::array<std::vector<double>, kAxes> dp;
};

class Flight {
 public:
  explicit Flight(Recording recording);

  const Recording& recording() const { return recording_; }
  std::size_t frames() const { return times_.size(); }
  const std::vector<double>& times() const { return times_; }

  // Smooths the measured motion, with `plant`'s forces as known input, under a process noise `looseness`
  // times the given one: velocities must not be biased by a model that is still wrong.
  void smooth(const Plant& plant, const NoiseModel& noise, double looseness);
  // The same out of each frame and those before it alone, for predictions: pose and velocity of every frame.
  void track(const Plant& plant, const NoiseModel& noise);
  // Evaluates the plant's forces along the motion, exactly between valve edges. `hidden_at_frame`, where
  // given, receives the hidden states at every frame.
  ForceIntegrals integrate(const Plant& plant, std::vector<VecX<double>>* hidden_at_frame = nullptr) const;

  // For Whitener: variance of the velocity change per interval for unit relative scatter of each pulse, and
  // path length.
  const std::array<std::vector<double>, kAxes>& scatter_variance() const { return scatter_variance_; }
  const std::vector<double>& travel() const { return travel_; }

  // Motion of the measured point, one per frame.
  const std::vector<PlanarState<double>>& motion() const { return motion_; }

 private:
  PlanarState<double> motion_at(std::size_t interval, double fraction) const;
  void note_scatter(const Plant& plant);
  void set_motion(const Plant& plant, const std::array<std::vector<double>, kAxes>& position,
                  const std::array<std::vector<double>, kAxes>& velocity);

  Recording recording_;
  std::vector<double> times_;                // stamps
  std::vector<PlanarState<double>> motion_;  // one per frame, of the measured point
  std::array<std::vector<double>, kAxes> scatter_variance_;
  std::vector<double> travel_;
};

// When the vehicle was as a frame stamped `stamp` shows it (docs/effects.md, clock_skew and mocap_latency).
double vehicle_time(const Plant& plant, double stamp);

// The valves' openings as a list of constant stretches.
struct ValveStretch {
  double begin_s;
  double end_s;
  std::vector<double> openings;
};
std::vector<ValveStretch> valve_stretches(const Recording& recording, const Plant& plant, double begin_s,
                                          double end_s);

}  // namespace atmos
