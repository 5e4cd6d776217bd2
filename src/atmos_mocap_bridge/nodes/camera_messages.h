// Camera messages as the core's types.
#pragma once

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <optional>
#include <vector>

#include "atmos_mocap_bridge/camera/camera_model.h"

namespace atmos {

// Nothing where the camera is not calibrated or its distortion model is not plumb_bob.
inline std::optional<CameraIntrinsics> from_message(const sensor_msgs::CameraInfo& info) {
  const auto& K = info.K;
  if (!(K[0] > 0.0) || !(K[4] > 0.0) || info.width == 0 || info.height == 0) return std::nullopt;
  if (info.distortion_model != "plumb_bob" || info.D.size() < 4) return std::nullopt;
  return CameraIntrinsics{
      static_cast<int>(info.width), static_cast<int>(info.height), K[0], K[4], K[2], K[5], info.D};
}

// A view of a mono8 image; of rgb8 and bgr8 the green channel goes into `storage`. Nothing for other
// encodings or too little data.
inline std::optional<GrayImage> gray_view(const sensor_msgs::Image& image,
                                          std::vector<std::uint8_t>& storage) {
  const std::size_t channels = image.encoding == "mono8"                              ? 1
                               : image.encoding == "rgb8" || image.encoding == "bgr8" ? 3
                                                                                      : 0;
  const std::size_t width = image.width, height = image.height;
  if (channels == 0 || width == 0 || height == 0 || image.step < width * channels ||
      image.data.size() < image.step * height)
    return std::nullopt;
  if (channels == 1)
    return GrayImage{static_cast<int>(width), static_cast<int>(height), image.data.data(), image.step};
  storage.resize(width * height);
  for (std::size_t v = 0; v < height; ++v) {
    for (std::size_t u = 0; u < width; ++u) storage[v * width + u] = image.data[v * image.step + 3 * u + 1];
  }
  return GrayImage{static_cast<int>(width), static_cast<int>(height), storage.data(), width};
}

}  // namespace atmos
