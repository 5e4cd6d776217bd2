// A body of QTM as a frame of the filter.
#pragma once

#include "atmos_mocap_bridge/pose_filter.h"
#include "atmos_mocap_bridge/qtm/packet.h"

namespace atmos::qtm {

// QTM's frame is the world. Not-a-number where the body is not seen or its rotation is none.
PoseFrame to_pose_frame(const Body& body, double stamp_s);
// The other way round, as a server sends it.
Body to_body(const PoseFrame& frame);

}  // namespace atmos::qtm
