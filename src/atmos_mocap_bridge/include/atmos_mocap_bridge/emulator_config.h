// Settings of the emulators (config/mocap/emulator/*.yaml): how much worse than the simulator's the frames
// are.
#pragma once

#include <cstdint>
#include <string>

#include "atmos_mocap_bridge/camera/renderer.h"

namespace atmos {

struct QtmEmulatorConfig {
  int port;
  int newest_minor;            // newest protocol version it claims to know: 1.<newest_minor>
  double rate_hz;              // of the simulator's frames, told to clients
  double loss_probability;     // a frame is not sent
  double dropout_probability;  // a body is not seen in a frame
  double latency_s;            // from the simulator's frame to its sending; not in lockstep
  double jitter_s;             // mean of an exponential addition; not in lockstep
  double clock_offset_s;       // server's clock at ROS time 0; not in lockstep
  double clock_drift;          // seconds that the server's clock gains per second; not in lockstep
  std::uint32_t seed;
};

// Throws ConfigError with every fault.
QtmEmulatorConfig load_qtm_emulator_config(const std::string& path);

struct CameraEmulatorConfig {
  RendererSettings renderer;
  double rate_hz;  // at most the simulator's; frames in between are left out
};

// The boards are those of the mocap settings it names, one per robot. Throws ConfigError with every fault.
CameraEmulatorConfig load_camera_emulator_config(const std::string& path);

}  // namespace atmos
