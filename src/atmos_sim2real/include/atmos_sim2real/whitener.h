// Whitening: turns pose minus double-integrated force into independent unit normals, if the model is right.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <vector>

namespace atmos {

enum Axis { kX = 0, kY = 1, kYaw = 2, kAxes = 3 };

// What the nominal model does not describe and no hypothesis is about. SI: m, rad, m/s^2, rad/s^2, s.
struct NoiseModel {
  std::array<double, kAxes> mocap{1e-4, 1e-4, 5e-4};  // white, per frame
  std::array<double, kAxes> slow{3e-4, 3e-4, 5e-3};   // slow random acceleration, standard deviation
  double slow_time_s = 4.0;                           // its correlation time
  double scatter = 0.02;                              // of each pulse's thrust, relative
  std::array<double, kAxes> distortion{0, 0,
                                       0};  // smooth error of the mocap over the floor, standard deviation
  double distortion_length_m = 0.7;         // its correlation length along the path
};

// The gains of one axis of one recording: they depend on the frame times, the pulses and the noise alone, so
// that they are computed once and used for every column. A frame's state is [position, velocity, slow
// acceleration, distortion].
class Whitener {
 public:
  // `times`: of the frames, ascending. `scatter_variance[i]`: variance of the velocity change between frames
  // i and i + 1 for scatter 1. `travel[i]`: path length between them [m].
  Whitener(const std::vector<double>& times, const std::vector<double>& scatter_variance,
           const std::vector<double>& travel, const NoiseModel& noise, Axis axis);

  // Innovations over their standard deviation. `measured[i]` is a pose, `dv[i]` and `dp[i]` what the modelled
  // force adds to velocity and position between frames i and i + 1 (starting from rest there). Linear in the
  // three together.
  void whiten(const double* measured, const double* dv, const double* dp, double* innovations) const;

  // The filter's own estimate right after each frame, out of that frame and those before it.
  void filter(const double* measured, const double* dv, const double* dp, double* innovations,
              double* position, double* velocity) const;

  // What a unit change of velocity between frames `at` and `at` + 1 does to the next `count` innovations
  // (fewer at the end): returns how many were written.
  std::size_t step_response(std::size_t at, std::size_t count, double* innovations) const;

  // Log of the standard deviation of one frame's innovation; 0 during burn-in.
  double log_deviation(std::size_t frame) const {
    return step_[frame].inverse_deviation > 0.0 ? -std::log(step_[frame].inverse_deviation) : 0.0;
  }
  // Sum of the log variances of the innovations.
  double log_determinant() const { return log_determinant_; }
  // Frames at the start whose innovations only settle the unknown initial state: left out of every sum.
  static constexpr int kBurnIn = 3;
  std::size_t size() const { return step_.size(); }

 private:
  template <class AfterFrame>
  void run(const double* measured, const double* dv, const double* dp, double* innovations,
           const AfterFrame& after_frame) const;

  struct Step {
    double dt;  // to the next frame
    double slow_decay, slow_to_v, slow_to_p, distortion_decay;
    double gain[4];
    double inverse_deviation;
  };
  std::vector<Step> step_;
  double log_determinant_ = 0.0;
};

}  // namespace atmos
