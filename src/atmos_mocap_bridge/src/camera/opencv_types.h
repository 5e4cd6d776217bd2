// Our types as OpenCV's.
#pragma once

#include <opencv2/core.hpp>

#include "atmos_mocap_bridge/camera/camera_model.h"

namespace atmos {

inline cv::Matx33d camera_matrix(const CameraIntrinsics& intrinsics) {
  return {intrinsics.fx, 0.0, intrinsics.cx, 0.0, intrinsics.fy, intrinsics.cy, 0.0, 0.0, 1.0};
}

}  // namespace atmos
