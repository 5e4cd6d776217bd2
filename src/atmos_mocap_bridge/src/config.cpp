#include "atmos_mocap_bridge/config.h"

#include <cmath>
#include <set>

#include "atmos_mocap_bridge/camera/marker_detector.h"
#include "atmos_model/strict_yaml.h"

namespace atmos {

namespace {

AccelerationNoise read_noise(const ConfigMap& map) {
  return {map.number("acceleration_m_s2", Bounds::positive()),
          map.number("angular_acceleration_rad_s2", Bounds::positive())};
}

CameraSourceConfig read_camera(const ConfigFile& file, const ConfigMap& map) {
  CameraSourceConfig camera;
  camera.image = map.text("image");
  camera.camera_info = map.text("camera_info");
  camera.extrinsic_path = file.resolve(map.text("extrinsic"));
  camera.dictionary = map.choice("dictionary", marker_dictionaries());
  camera.corner_noise_px = map.number("corner_noise_px", Bounds::positive());
  camera.max_reprojection_px = map.number("max_reprojection_px", Bounds::positive());
  const ConfigMap board = map.map("board");
  camera.board_height_m = board.number("height_m", Bounds::non_negative());
  camera.markers = read_markers(board);
  camera.min_corners = board.integer("min_corners", 4, 1000);
  if (!board.faulty("markers") && !board.faulty("min_corners") &&
      camera.min_corners > 4 * static_cast<int>(camera.markers.size()))
    board.fault("min_corners", "must not exceed four per marker");
  return camera;
}

SourceConfig read_source(const ConfigFile& file, const ConfigMap& map) {
  const std::string kind = map.choice("kind", {"topic", "qtm", "camera"});
  if (kind == "qtm") {
    return QtmSourceConfig{map.text("host"), map.integer("port", 1, 65535), map.text("body", ""),
                           map.number("silence_s", Bounds::positive()),
                           map.number("max_wait_s", Bounds::positive())};
  }
  if (kind == "camera") return read_camera(file, map);
  return TopicSourceConfig{map.text("topic"), map.choice("message", {"pose", "transform"}) == "transform"};
}

MocapCalibration read_calibration(const ConfigMap& map) {
  MocapCalibration calibration;
  if (const auto latency = map.optional_map("mocap_latency"))
    calibration.delay_s = latency->number("delay_s", Bounds::between(0.0, 0.5));
  if (const auto offset = map.optional_map("marker_offset"))
    calibration.marker_offset_m = {offset->number("x_m", Bounds::between(-1.0, 1.0)),
                                   offset->number("y_m", Bounds::between(-1.0, 1.0))};
  if (const auto yaw = map.optional_map("yaw_misalignment"))
    calibration.yaw_misalignment_rad = yaw->number("angle_rad", Bounds::between(-M_PI, M_PI));
  return calibration;
}

}  // namespace

std::vector<MarkerSettings> read_markers(const ConfigMap& map) {
  std::vector<MarkerSettings> markers;
  std::set<int> ids;
  for (const ConfigMap& entry : map.maps("markers")) {
    markers.push_back({entry.integer("id", 0, 100000), entry.vector2("center_m"),
                       entry.number("size_m", Bounds::positive())});
    if (!ids.insert(markers.back().id).second) entry.fault("id", "must not stand on two markers");
  }
  if (markers.empty() && !map.faulty("markers")) map.fault("markers", "must have at least one entry");
  return markers;
}

FloorMarkers load_floor_markers(const std::string& path) {
  const ConfigFile file(path);
  FloorMarkers floor{file.root().choice("dictionary", marker_dictionaries()), read_markers(file.root())};
  file.check();
  return floor;
}

MocapConfig load_mocap_config(const std::string& path) {
  const ConfigFile file(path);
  const ConfigMap root = file.root();
  MocapConfig config;
  config.robot = root.text("robot", "");
  config.source = read_source(file, root.map("source"));
  if (const auto calibration = root.optional_map("calibration"))
    config.calibration = read_calibration(*calibration);

  const ConfigMap measurement = root.map("measurement");
  config.position_noise_m = measurement.number("position_noise_m", Bounds::positive());
  config.attitude_noise_rad = measurement.number("attitude_noise_rad", Bounds::positive());

  const ConfigMap process = root.map("process");
  config.correlation_s = process.number("correlation_s", Bounds::positive());
  config.thrust_error = process.number("thrust_error", Bounds::between(0.0, 1.0));
  config.known_input = read_noise(process.map("known_input"));
  config.unknown_input = read_noise(process.map("unknown_input"));

  const ConfigMap initial = root.map("initial");
  config.initial_velocity_m_s = initial.number("velocity_m_s", Bounds::positive());
  config.initial_angular_velocity_rad_s = initial.number("angular_velocity_rad_s", Bounds::positive());

  const ConfigMap gate = root.map("gate");
  config.nis_gate = gate.number("nis", Bounds::positive());
  config.reinitialise_after = gate.integer("reinitialise_after", 1, 1000);
  config.coast_s = root.number("coast_s", Bounds::between(0.0, 10.0));
  config.forget_s = root.number("forget_s", Bounds::between(0.0, 10.0));
  if (!root.faulty("coast_s") && !root.faulty("forget_s") && config.forget_s < config.coast_s)
    root.fault("forget_s", "must not be shorter than coast_s");
  file.check();
  return config;
}

}  // namespace atmos
