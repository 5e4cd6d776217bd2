#include "atmos_mocap_bridge/emulator_config.h"

#include "atmos_model/strict_yaml.h"

namespace atmos {

QtmEmulatorConfig load_qtm_emulator_config(const std::string& path) {
  const ConfigFile file(path);
  const ConfigMap root = file.root();
  QtmEmulatorConfig config;
  config.port = root.integer("port", 1, 65535);
  config.newest_minor = root.integer("newest_minor", 1, 99);
  config.rate_hz = root.number("rate_hz", Bounds::positive());
  config.loss_probability = root.number("loss_probability", Bounds::between(0.0, 1.0));
  config.dropout_probability = root.number("dropout_probability", Bounds::between(0.0, 1.0));
  config.latency_s = root.number("latency_s", Bounds::between(0.0, 1.0));
  config.jitter_s = root.number("jitter_s", Bounds::between(0.0, 1.0));
  config.clock_offset_s = root.number("clock_offset_s", Bounds::non_negative());
  config.clock_drift = root.number("clock_drift", Bounds::between(-1e-3, 1e-3));
  config.seed = static_cast<std::uint32_t>(root.integer("seed", 0, 2147483647));
  file.check();
  return config;
}

CameraEmulatorConfig load_camera_emulator_config(const std::string& path) {
  const ConfigFile file(path);
  const ConfigMap root = file.root();
  CameraEmulatorConfig config;
  config.rate_hz = root.number("rate_hz", Bounds::positive());
  RendererSettings& renderer = config.renderer;
  renderer.exposure_s = root.number("exposure_s", Bounds::between(0.0, 0.1));
  renderer.blur_px = root.number("blur_px", Bounds::between(0.0, 10.0));
  renderer.noise = root.number("noise", Bounds::between(0.0, 100.0));
  renderer.seed = static_cast<std::uint32_t>(root.integer("seed", 0, 2147483647));

  const ConfigMap lens = root.map("lens");
  renderer.camera.intrinsics = {lens.integer("width_px", 16, 10000),
                                lens.integer("height_px", 16, 10000),
                                lens.number("fx_px", Bounds::positive()),
                                lens.number("fy_px", Bounds::positive()),
                                lens.number("cx_px"),
                                lens.number("cy_px"),
                                lens.numbers("distortion", 5)};
  const std::vector<std::string> robots = root.texts("robots");
  const std::string floor_path = file.resolve(root.text("floor")), truth = file.resolve(root.text("pose"));
  file.check();
  const FloorMarkers floor = load_floor_markers(floor_path);
  renderer.dictionary = floor.dictionary;
  renderer.floor_markers = floor.markers;
  renderer.camera.X_WC = load_extrinsic(truth).X_WC;
  for (const std::string& robot : robots) {
    const MocapConfig settings = load_mocap_config(file.resolve(robot));
    const auto* const camera = std::get_if<CameraSourceConfig>(&settings.source);
    if (camera == nullptr || camera->dictionary != floor.dictionary)
      throw ConfigError({{path, 0, "robots", robot + " must be a camera with the floor's dictionary"}});
    renderer.boards.push_back({camera->markers, camera->board_height_m});
  }
  return config;
}

}  // namespace atmos
