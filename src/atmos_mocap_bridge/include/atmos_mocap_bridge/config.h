// Settings of the mocap bridge (config/mocap/*.yaml; docs/mocap.md explains the keys).
#pragma once

#include <Eigen/Core>
#include <string>
#include <variant>
#include <vector>

namespace atmos {

class ConfigMap;

// Standard deviations of unknown accelerations over MocapConfig::correlation_s.
struct AccelerationNoise {
  double linear_m_s2;     // > 0
  double angular_rad_s2;  // > 0
};

// What a diagnosis found out about the mocap, with the names and signs of its model.yaml (docs/effects.md).
// The bridge takes it back.
struct MocapCalibration {
  double delay_s = 0.0;                                       // mocap_latency, >= 0
  Eigen::Vector2d marker_offset_m = Eigen::Vector2d::Zero();  // marker_offset, body
  double yaw_misalignment_rad = 0.0;                          // yaw_misalignment
};

// Poses from a topic.
struct TopicSourceConfig {
  std::string topic;       // relative to the robot's namespace
  bool transform = false;  // TransformStamped instead of PoseStamped
};

// Poses from a Qualisys Track Manager, over TCP.
struct QtmSourceConfig {
  std::string host;
  int port;           // little-endian port: base port + 1
  std::string body;   // as QTM calls it; empty: the robot's name
  double silence_s;   // > 0; without a word for so long, the server is taken for gone
  double max_wait_s;  // > 0; longest pause between attempts to connect
};

// One square ArUco marker on the robot's top, its x axis along body x.
struct MarkerSettings {
  int id;
  Eigen::Vector2d center_m;  // body
  double size_m;             // > 0, edge of the black square
};

// Poses from an overhead camera that sees markers on the robot.
struct CameraSourceConfig {
  std::string image, camera_info;  // topics, relative to the robot's namespace
  std::string extrinsic_path;      // absolute; where the camera is, written by calibrate_camera
  std::string dictionary;          // OpenCV's name without DICT_, e.g. 4X4_50
  double board_height_m;           // of the markers over the floor
  std::vector<MarkerSettings> markers;
  int min_corners;             // 4 a marker; fewer do not make a pose
  double corner_noise_px;      // > 0, 1 sigma per axis
  double max_reprojection_px;  // > 0; RMS above which a fit is refused
};

using SourceConfig = std::variant<TopicSourceConfig, QtmSourceConfig, CameraSourceConfig>;

struct MocapConfig {
  std::string robot;  // empty: the node's namespace
  SourceConfig source;
  MocapCalibration calibration;
  double position_noise_m;                // > 0, 1 sigma per axis
  double attitude_noise_rad;              // > 0, 1 sigma per axis
  double correlation_s;                   // > 0
  double thrust_error;                    // >= 0, relative 1 sigma of each open valve's thrust
  AccelerationNoise known_input;          // while commands are known, besides thrust_error
  AccelerationNoise unknown_input;        // without commands
  double initial_velocity_m_s;            // > 0, 1 sigma per axis
  double initial_angular_velocity_rad_s;  // > 0, 1 sigma per axis
  double nis_gate;                        // > 0; normalised innovation squared above which a frame is refused
  int reinitialise_after;                 // >= 1 consecutive refusals
  double coast_s;                         // >= 0; predictions are published over gaps up to this
  double forget_s;                        // >= coast_s; after a longer gap the filter starts anew
};

// Throws ConfigError with every fault.
MocapConfig load_mocap_config(const std::string& path);

// Markers on the floor whose places in the world are known.
struct FloorMarkers {
  std::string dictionary;
  std::vector<MarkerSettings> markers;  // center_m in the world
};
// Throws ConfigError with every fault.
FloorMarkers load_floor_markers(const std::string& path);

// The list `markers` of `map`: id, center_m, size_m. Faults are recorded there.
std::vector<MarkerSettings> read_markers(const ConfigMap& map);

}  // namespace atmos
