// What an overhead camera sees of marker boards on robots and of markers on the floor.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "atmos_mocap_bridge/camera/camera_model.h"
#include "atmos_mocap_bridge/config.h"

namespace atmos {

struct BoardAppearance {
  std::vector<MarkerSettings> markers;  // body
  double height_m;                      // over the floor
};

struct RendererSettings {
  Camera camera;
  std::string dictionary;                     // of all markers
  std::vector<BoardAppearance> boards;        // one per robot
  std::vector<MarkerSettings> floor_markers;  // in the world, flat on the floor
  double exposure_s;                          // a moving board is smeared over it
  double blur_px;                             // standard deviation of the lens' point spread
  double noise;                               // standard deviation of a pixel, grey levels of 255
  std::uint32_t seed;
};

// A robot on the floor; not-a-number: outside of the picture.
struct BoardPose {
  Eigen::Vector2d p_WB;
  double yaw;
  Eigen::Vector2d v_WB = Eigen::Vector2d::Zero();  // m/s
  double yaw_rate = 0.0;                           // rad/s
};

// Traces rays through the lens model, 16 a pixel, each at another instant of the exposure, then blurs and
// adds noise. The same sequence of calls gives the same images.
class Renderer {
 public:
  // Throws std::invalid_argument when a marker is not in the dictionary.
  explicit Renderer(const RendererSettings& settings);
  ~Renderer();

  // One pose per board; the image lives until the next call.
  GrayImage render(const std::vector<BoardPose>& poses);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace atmos
