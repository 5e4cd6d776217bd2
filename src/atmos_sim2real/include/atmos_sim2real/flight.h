// One recording prepared for fitting: frames, the smoothed motion along which forces are evaluated, and valve
// edges.
#pragma once

#include <array>
#include <vector>

#include "atmos_model/plant.h"
#include "atmos_sim2real/recent.h"
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

// The motion cut into steps over which no valve moves: where a plant's forces are evaluated.
struct Path {
  // All that the steps depend on besides the motion.
  struct Key {
    ValveTiming timing;
    std::vector<double> jumps;  // of forces, for reasons other than valves
    double latency_s, skew, start_s, longest_step_s;
    int valves;
    Eigen::Vector2d com_to_marker;
    double yaw_offset_rad;

    bool operator==(const Key& other) const;
  };
  struct Step {
    double middle_s, dt;
    double to_next;  // from the middle to the next frame; negative before the first frame
    std::size_t frame, openings;
    PlanarState<double> state;  // of the centre of mass, in the middle
  };
  std::vector<Step> steps;
  std::vector<VecX<double>> openings;
  std::array<std::vector<double>, kAxes> measured;  // pose of the centre of mass that each frame shows
};

// A disc over the floor [m].
struct Reach {
  Eigen::Vector2d center_m;
  double radius_m;
};

// The mean of several poses, whose times have this variance about its own [s^2].
struct Frame {
  PoseSample pose;
  double spread_s2;
};

class Flight {
 public:
  // Frames are poses averaged over about 1/50 s: the motion within tells nothing, and all work is done per
  // frame.
  explicit Flight(Recording recording);
  // A frame for every pose, for what may look at no pose after a certain one.
  static Flight of_every_pose(Recording recording);

  // The same motion as if these commands had been given.
  Flight under(std::vector<ThrusterCommand> commands) const;

  const Recording& recording() const { return recording_; }
  std::size_t frames() const { return times_.size(); }
  const std::vector<PoseSample>& poses() const { return poses_; }  // one per frame
  const std::vector<double>& times() const { return times_; }      // their stamps

  // Smooths the measured motion, with `plant`'s forces as known input, under a process noise `looseness`
  // times the given one: velocities must not be biased by a model that is still wrong.
  void smooth(const Plant& plant, const NoiseModel& noise, double looseness);
  // The same out of each frame and those before it alone, for predictions: pose and velocity of every frame.
  void track(const Plant& plant, const NoiseModel& noise);
  // Evaluates the plant's forces along the motion, exactly between valve edges. `hidden_at_frame`, where
  // given, receives the hidden states at every frame.
  ForceIntegrals integrate(const Plant& plant, std::vector<VecX<double>>* hidden_at_frame = nullptr) const;
  // The same for a plant without thrusters whose forces depend on place and velocity alone, so that they are
  // evaluated a few times less often than there are frames. Outside of `reach`, where given, it is known to
  // push nothing.
  ForceIntegrals integrate_slow(const Plant& plant, const Reach* reach = nullptr) const;

  // One whitener per axis.
  std::shared_ptr<const std::vector<Whitener>> whiteners(const NoiseModel& noise) const;

  // For Whitener: variance of the velocity change per interval for unit relative scatter of each pulse, and
  // the way.
  const std::array<std::vector<double>, kAxes>& scatter_variance() const { return scatter_variance_; }
  const std::vector<Travel>& travel() const { return travel_; }

  // Motion of the measured point, one per frame.
  const std::vector<PlanarState<double>>& motion() const { return motion_; }

 private:
  Flight(Recording recording, std::vector<Frame> (*frames_of)(const std::vector<PoseSample>&));
  PlanarState<double> motion_at(std::size_t interval, double fraction) const;
  std::shared_ptr<const Path> path(const Plant& plant) const;
  Path make_path(const Plant& plant, const Path::Key& key) const;
  // Velocity of the centre of mass, and how fast friction takes away what it is more or less than that [1/s]:
  // where friction holds the robot, a velocity that is a little off pushes it about.
  void note_damping(const Plant& plant, Axis axis, std::vector<double>& along,
                    std::vector<double>& damping) const;
  // The mean of several poses lies inside the bend of the way.
  void take_off_bend(ForceIntegrals& forces) const;
  void note_travel();
  void note_scatter(const Plant& plant, bool joins_pulses);
  void set_motion(const Plant& plant, const std::array<std::vector<double>, kAxes>& position,
                  const std::array<std::vector<double>, kAxes>& velocity);

  Recording recording_;
  std::vector<PoseSample> poses_;            // one per frame
  std::vector<double> times_;                // their stamps
  std::vector<double> spread_s2_;            // Frame::spread_s2
  std::vector<PlanarState<double>> motion_;  // one per frame, of the measured point
  std::array<std::vector<double>, kAxes> scatter_variance_;
  std::vector<Travel> travel_;

  // What was derived from the motion and is asked for again and again; a new motion starts anew.
  struct Derived {
    Recent<Path::Key, Path> paths;
    Recent<NoiseModel, std::vector<Whitener>> whiteners;
  };
  std::shared_ptr<Derived> derived_ = std::make_shared<Derived>();
};

// The floor that flights visited [m].
struct Box {
  double x0, x1, y0, y1;
};
Box visited(const std::vector<Flight>& flights);

// When the vehicle was as a frame stamped `stamp` shows it (docs/effects.md, clock_skew and mocap_latency).
double vehicle_time(const Plant& plant, double stamp);

}  // namespace atmos
