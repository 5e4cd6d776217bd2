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
  bool joins_pulses = false;  // a valve that stays open over several commands makes one pulse of them
  // Errors of the mocap that depend on where the robot is, standard deviations: one that is rough along the
  // way, as markers come and go, and one that is a smooth function of the place.
  std::array<double, kAxes> rough{0, 0, 0};
  double rough_length_m = 0.7;  // its correlation length
  std::array<double, kAxes> distortion{0, 0, 0};
  double distortion_length_m = 0.8;

  bool operator==(const NoiseModel& other) const {
    return mocap == other.mocap && slow == other.slow && slow_time_s == other.slow_time_s &&
           scatter == other.scatter && joins_pulses == other.joins_pulses && rough == other.rough &&
           rough_length_m == other.rough_length_m && distortion == other.distortion &&
           distortion_length_m == other.distortion_length_m;
  }
};

// The way of the robot from one frame to the next.
struct Travel {
  double path_m;   // as smoothed, with what it trembles
  double chord_m;  // its share of the way between places that are apart
  double turn;     // cosine of the angle to the direction in which it goes on from there
};

// How an axis moves on by itself from one frame to the next. The distortion is a smooth function of the place
// (Matern 3/2), followed along the way: its slope in the direction of travel, times length / sqrt(3), is a
// state of its own, of which a turn keeps the cosine. What returns along its own path meets the same slope.
struct Transition {
  double dt;
  double slow_decay, slow_to_v, slow_to_p;  // of the slow acceleration, and what it adds meanwhile
  double rough_decay;
  // Of distortion b and slope c; what is new of them, for deviation 1.
  double b_from_b, b_from_c, c_from_b, c_from_c;
  double new_bb, new_bc, new_cc;

  Transition(const NoiseModel& noise, double dt, const Travel& travel);

  // What becomes of distortion and slope.
  template <class S>
  void distort(const S& b, const S& c, S& new_b, S& new_c) const {
    new_b = b_from_b * b + b_from_c * c;
    new_c = c_from_b * b + c_from_c * c;
  }
  void distort(double& b, double& c) const {
    const double old_b = b, old_c = c;
    distort(old_b, old_c, b, c);
  }
};

// Covariance of one axis' error in [position, velocity, slow acceleration, rough error, distortion, its
// slope]; of several axes side by side where S is an array.
template <class S>
class CovarianceOf {
 public:
  // Nothing is known of position and velocity: far wider than anything a recording can show.
  CovarianceOf(const S& mocap, const S& slow, const S& rough, const S& distortion, const S& scatter)
      : mocap2_(mocap * mocap),
        slow2_(slow * slow),
        rough2_(rough * rough),
        distortion2_(distortion * distortion),
        scatter2_(scatter * scatter),
        pp_(0.0 * mocap + 1e2),
        pv_(0.0 * mocap),
        pa_(pv_),
        pr_(pv_),
        pb_(pv_),
        pc_(pv_),
        vv_(0.0 * mocap + 1e1),
        va_(pv_),
        vr_(pv_),
        vb_(pv_),
        vc_(pv_),
        aa_(slow2_),
        ar_(pv_),
        ab_(pv_),
        ac_(pv_),
        rr_(rough2_),
        rb_(pv_),
        rc_(pv_),
        bb_(distortion2_),
        bc_(pv_),
        cc_(distortion2_) {}

  // Variance of what a frame shows.
  S shown_variance() const { return pp_ + rr_ + bb_ + 2.0 * (pr_ + pb_ + rb_) + mocap2_; }

  // Takes a frame into account; the gains of the states.
  std::array<S, 6> see() {
    const S p = pp_ + pr_ + pb_, v = pv_ + vr_ + vb_, a = pa_ + ar_ + ab_;
    const S r = pr_ + rr_ + rb_, b = pb_ + rb_ + bb_, c = pc_ + rc_ + bc_;
    const S s = 1.0 / (p + r + b + mocap2_);
    pp_ -= s * p * p;
    pv_ -= s * p * v;
    pa_ -= s * p * a;
    pr_ -= s * p * r;
    pb_ -= s * p * b;
    pc_ -= s * p * c;
    vv_ -= s * v * v;
    va_ -= s * v * a;
    vr_ -= s * v * r;
    vb_ -= s * v * b;
    vc_ -= s * v * c;
    aa_ -= s * a * a;
    ar_ -= s * a * r;
    ab_ -= s * a * b;
    ac_ -= s * a * c;
    rr_ -= s * r * r;
    rb_ -= s * r * b;
    rc_ -= s * r * c;
    bb_ -= s * b * b;
    bc_ -= s * b * c;
    cc_ -= s * c * c;
    return {s * p, s * v, s * a, s * r, s * b, s * c};
  }

  // `scatter_variance`: of the velocity change meanwhile for scatter 1. Scatter enters as white acceleration;
  // the floor under it keeps the filter from believing itself without limit.
  void advance(const Transition& to, const S& scatter_variance) {
    const double dt = to.dt, decay = to.slow_decay, keep = to.rough_decay;
    const S q = scatter2_ * scatter_variance + 1e-12 * dt;
    const S pp = pp_ + dt * pv_ + to.slow_to_p * pa_, pv = pv_ + dt * vv_ + to.slow_to_p * va_;
    const S pa = pa_ + dt * va_ + to.slow_to_p * aa_, pr = pr_ + dt * vr_ + to.slow_to_p * ar_;
    const S pb = pb_ + dt * vb_ + to.slow_to_p * ab_, pc = pc_ + dt * vc_ + to.slow_to_p * ac_;
    const S vv = vv_ + to.slow_to_v * va_, va = va_ + to.slow_to_v * aa_, vr = vr_ + to.slow_to_v * ar_;
    const S vb = vb_ + to.slow_to_v * ab_, vc = vc_ + to.slow_to_v * ac_;
    const S ab = decay * ab_, ac = decay * ac_, rb = keep * rb_, rc = keep * rc_;
    pp_ = pp + dt * pv + to.slow_to_p * pa + q * (dt * dt / 3.0);
    pv_ = pv + to.slow_to_v * pa + q * (dt / 2.0);
    pa_ = decay * pa;
    pr_ = keep * pr;
    vv_ = vv + to.slow_to_v * va + q;
    va_ = decay * va;
    vr_ = keep * vr;
    aa_ = decay * decay * aa_ + slow2_ * (1.0 - decay * decay);
    ar_ *= decay * keep;
    rr_ = keep * keep * rr_ + rough2_ * (1.0 - keep * keep);
    to.distort(pb, pc, pb_, pc_);
    to.distort(vb, vc, vb_, vc_);
    to.distort(ab, ac, ab_, ac_);
    to.distort(rb, rc, rb_, rc_);
    S b_with_b, b_with_c, c_with_b, c_with_c;  // rows of the old, columns of the new
    to.distort(bb_, bc_, b_with_b, b_with_c);
    to.distort(bc_, cc_, c_with_b, c_with_c);
    bb_ = to.b_from_b * b_with_b + to.b_from_c * c_with_b;
    to.distort(b_with_c, c_with_c, bc_, cc_);
    bb_ += distortion2_ * to.new_bb;
    bc_ += distortion2_ * to.new_bc;
    cc_ += distortion2_ * to.new_cc;
  }

  // A prediction knows position and velocity of its start, but takes no slow force and no distortion into
  // account: those stay at their prior. An optimal estimate is uncorrelated with its own error, so that the
  // cross covariances stay.
  void forget_what_predictions_leave_out() {
    aa_ = slow2_;
    rr_ = rough2_;
    bb_ = cc_ = distortion2_;
    rb_ = rc_ = bc_ = 0.0 * distortion2_;
  }

 private:
  S mocap2_, slow2_, rough2_, distortion2_, scatter2_;
  S pp_, pv_, pa_, pr_, pb_, pc_, vv_, va_, vr_, vb_, vc_, aa_, ar_, ab_, ac_, rr_, rb_, rc_, bb_, bc_, cc_;
};

struct AxisCovariance : CovarianceOf<double> {
  AxisCovariance(const NoiseModel& noise, Axis axis)
      : CovarianceOf(noise.mocap[axis], noise.slow[axis], noise.rough[axis], noise.distortion[axis],
                     noise.scatter) {}
};

// The gains of one axis of one recording: they depend on the frame times, the pulses and the noise alone, so
// that they are computed once and used for every column.
class Whitener {
 public:
  // `times`: of the frames, ascending. `scatter_variance[i]`: variance of the velocity change between frames
  // i and i + 1 for scatter 1. `travel[i]`: the way between them.
  Whitener(const std::vector<double>& times, const std::vector<double>& scatter_variance,
           const std::vector<Travel>& travel, const NoiseModel& noise, Axis axis);

  // Innovations over their standard deviation. `measured[i]` is a pose, `dv[i]` and `dp[i]` what the modelled
  // force adds to velocity and position between frames i and i + 1 (starting from rest there). Linear in the
  // three together.
  void whiten(const double* measured, const double* dv, const double* dp, double* innovations) const;
  // All axes of a recording side by side, as each is a chain of operations that wait for one another; one
  // that does not move is passed over.
  struct Track {
    const double *measured, *dv, *dp;
    double* innovations;
  };
  static void whiten(const std::vector<Whitener>& axes, const std::array<Track, kAxes>& tracks);

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
  template <std::size_t N>
  static void run_together(const std::array<const Whitener*, N>& axes, const std::array<Track, N>& tracks,
                           std::size_t first);

  struct Step {
    Transition to_next;
    std::array<double, 6> gain;
    double inverse_deviation;
  };
  std::vector<Step> step_;
  double log_determinant_ = 0.0;
};

}  // namespace atmos
