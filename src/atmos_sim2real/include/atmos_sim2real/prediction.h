// Open-loop prediction of a recording: the proof of a model, and the `predict` command.
#pragma once

#include <string>
#include <vector>

#include "atmos_model/plant.h"
#include "atmos_sim2real/flight.h"

namespace atmos {

// What the mocap reports at a stamp: the measured point, its velocity in the world, the yaw it shows and its
// rate.
struct WindowStart {
  double stamp_s;
  PlanarState<double> shown;
};

struct PredictedPose {
  double window_start_s;
  double stamp_s;
  double x_m, y_m, yaw_rad;
};

// Reads `stamp,x,y,yaw,vx,vy,yaw_rate`. Throws std::invalid_argument with file, line and rule.
std::vector<WindowStart> read_window_starts(const std::string& path);

// Predicts one recording under one model. What a window starts from is estimated from commands and poses
// stamped up to its start alone; so is the phase of a vibration where the model's, which belongs to the
// recording it was fitted to, does not hold.
class OpenLoop {
 public:
  // The recording must outlive it.
  OpenLoop(const Recording& recording, const Vehicle& vehicle, const std::vector<Effect>& effects);

  // A start every `horizon_s` from the first second on.
  std::vector<WindowStart> window_starts(double horizon_s) const;
  // One window per start: rows every 0.1 s up to the horizon, on the recorded commands.
  std::vector<PredictedPose> predict(const std::vector<WindowStart>& starts, double horizon_s) const;

 private:
  // A filter with a certain trust in the model, and with a phase. Several run side by side; at any frame the
  // one that has predicted best so far counts.
  struct Track {
    Plant plant;
    std::vector<PlanarState<double>> motion;
    std::vector<VecX<double>> hidden;
    std::vector<double> log_likelihood;  // up to each frame, less the handicap
  };
  const Track& best_at(std::size_t frame) const;
  std::size_t frame_before(double stamp) const;

  Track track_of(Plant plant, const NoiseModel& noise, double handicap) const;

  const Recording& recording_;
  std::vector<double> times_;  // of its poses
  std::vector<Track> tracks_;
};

// Root mean square of the errors at each window's end against the recording; windows whose end no pose shows
// are left out.
struct PredictionError {
  double position_rms_m = 0.0;
  double yaw_rms_rad = 0.0;
  double position_fit_percent = 0.0;  // 100 (1 - |y - predicted| / |y - mean|), MATLAB's convention
  std::size_t windows = 0;
};
PredictionError prediction_error(const Recording& recording, const std::vector<PredictedPose>& predicted);

}  // namespace atmos
