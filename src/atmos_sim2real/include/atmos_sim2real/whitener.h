// Whitening: turns pose minus double-integrated force into independent unit normals, if the model is right.
#pragma once

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

  bool operator==(const NoiseModel& other) const {
    return mocap == other.mocap && slow == other.slow && slow_time_s == other.slow_time_s &&
           scatter == other.scatter && distortion == other.distortion &&
           distortion_length_m == other.distortion_length_m;
  }
};

// How an axis moves on by itself from one frame to the next.
struct Transition {
  double dt;
  double slow_decay, slow_to_v, slow_to_p;  // of the slow acceleration, and what it adds meanwhile
  double distortion_decay;

  Transition(const NoiseModel& noise, double dt, double travel_m);
};

// Covariance of one axis' error in [position, velocity, slow acceleration, distortion].
class AxisCovariance {
 public:
  // Nothing is known of position and velocity: far wider than anything a recording can show.
  AxisCovariance(const NoiseModel& noise, Axis axis);

  // Variance of what a frame shows.
  double shown_variance() const { return pp_ + 2.0 * pb_ + bb_ + mocap2_; }
  // Takes a frame into account; the gains of the four states.
  std::array<double, 4> see();
  // `scatter_variance`: of the velocity change meanwhile for scatter 1.
  void advance(const Transition& transition, double scatter_variance);
  // A prediction knows position and velocity of its start, but takes no slow force and no distortion into
  // account: those stay at their prior. An optimal estimate is uncorrelated with its own error, so that the
  // cross covariances stay.
  void forget_what_predictions_leave_out();

 private:
  double mocap2_, slow2_, distortion2_, scatter2_;
  double pp_ = 1e2, pv_ = 0, pa_ = 0, pb_ = 0, vv_ = 1e1, va_ = 0, vb_ = 0, aa_, ab_ = 0, bb_;
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
    Transition to_next;
    std::array<double, 4> gain;
    double inverse_deviation;
  };
  std::vector<Step> step_;
  double log_determinant_ = 0.0;
};

}  // namespace atmos
