// The motion-capture system: what it would report of a simulated robot.
#pragma once

#include <array>
#include <cstdint>
#include <random>
#include <vector>

#include "atmos_model/scenario.h"
#include "atmos_sim/robot.h"

namespace atmos {

// One frame. A frame in which the robot is not seen has a pose of NaN, as mocap systems send it.
struct MocapFrame {
  double stamp_s;           // exposure, by the mocap's clock
  PlanarPose<double> pose;  // of the measured point, world
};

// Frames are due at whole multiples of 1/rate_hz in ROS time. The noise of a frame depends on seed and frame
// number alone: dropouts do not shift it.
class MocapSensor {
 public:
  MocapSensor(const MocapSettings& settings, std::uint32_t seed, double start_s);

  // When the next frame is due, ROS time.
  double next_frame_s() const { return static_cast<double>(frame_) / settings_.rate_hz; }
  // Takes the frame due at next_frame_s(); the robot must have come exactly there.
  MocapFrame expose(const Robot& robot);

 private:
  static constexpr int kWaves = 6;
  struct Wave {
    Vec2<double> number_W, amplitude_W;  // rad/m, m
    double phase;
  };
  Vec2<double> distortion(const Vec2<double>& p_W) const;

  MocapSettings settings_;
  double start_s_;
  std::int64_t frame_;
  std::mt19937_64 random_, jitter_;
  std::array<Wave, kWaves> distortion_;
};

}  // namespace atmos
