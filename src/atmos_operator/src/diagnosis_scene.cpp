#include "atmos_operator/diagnosis_scene.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "atmos_model/effects.h"
#include "atmos_model/plant.h"

namespace atmos {

namespace {

using nlohmann::json;

constexpr double kArrowStep_m = 0.15;  // between the places of forces
constexpr double kTiltCell_m = 0.25;
constexpr double kBorder_m = 0.25;  // of a tilted floor around the paths

struct Bounds2 {
  Eigen::Vector2d min_m = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector2d max_m = -min_m;

  void include(const Eigen::Vector2d& p) {
    min_m = min_m.cwiseMin(p);
    max_m = max_m.cwiseMax(p);
  }
  bool empty() const { return !(min_m.array() <= max_m.array()).all(); }
};

json read_json(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::invalid_argument(path + ": cannot be read");
  try {
    return json::parse(file);
  } catch (const json::exception& error) {
    throw std::invalid_argument(path + ": " + error.what());
  }
}

// Mismatch of each of `points` points out of bins over the same time; the mean square over the axes.
std::vector<double> mismatch_of(const json& series, std::size_t points) {
  std::vector<double> result(points, 1.0);
  const json& axes = series.at("axes");
  for (std::size_t i = 0; i < points; ++i) {
    double sum = 0.0, known = 0.0;
    for (const auto& [axis, bins] : axes.items()) {
      if (bins.empty()) continue;
      const json& bin = bins[std::min(i * bins.size() / points, bins.size() - 1)];
      if (!bin.is_number()) continue;
      sum += bin.get<double>() * bin.get<double>();
      known += 1.0;
    }
    if (known > 0.0) result[i] = std::sqrt(sum / known);
  }
  return result;
}

void read_report(const std::string& path, DiagnosisScene& scene) {
  const std::string plots_path = (std::filesystem::path(path).parent_path() / "plots.json").string();
  const json report = read_json(path);
  const json plots = read_json(plots_path);
  try {
    scene.verdict = report.at("verdict").get<std::string>();
    for (const json& effect : report.at("effects"))
      scene.statements.push_back(effect.at("statement").get<std::string>());
    for (const json& flight : plots.at("flights")) {
      FlownPath flown;
      flown.name = flight.at("name").get<std::string>();
      const auto x = flight.at("x_m").get<std::vector<double>>();
      const auto y = flight.at("y_m").get<std::vector<double>>();
      if (x.size() != y.size()) throw std::invalid_argument(plots_path + ": x_m and y_m differ in length");
      for (std::size_t i = 0; i < x.size(); ++i) flown.p_W.emplace_back(x[i], y[i]);
      flown.nominal = mismatch_of(flight.at("nominal"), x.size());
      flown.fitted = mismatch_of(flight.at("fitted"), x.size());
      scene.paths.push_back(std::move(flown));
    }
  } catch (const json::exception& error) {
    throw std::invalid_argument(path +
                                ": not a diagnosis' report, or its plots.json is not: " + error.what());
  }
}

// The heights of all floor effects on one grid: that of the uneven floor, or one around what was flown.
std::optional<FloorMap> floor_of(const std::vector<Effect>& effects, const Bounds2& flown) {
  const FloorUnevenness* uneven = nullptr;
  const FloorTilt* tilt = nullptr;
  for (const Effect& effect : effects) {
    if (const auto* found = std::get_if<FloorUnevenness>(&effect)) uneven = found;
    if (const auto* found = std::get_if<FloorTilt>(&effect)) tilt = found;
  }
  if (uneven == nullptr && tilt == nullptr) return std::nullopt;
  FloorMap map;
  if (uneven != nullptr) {
    map.grid = uneven->grid;
    map.height_m = uneven->height_m;
  } else {
    Bounds2 area = flown;
    if (area.empty()) area.include(Eigen::Vector2d::Zero());
    area.include(area.min_m - Eigen::Vector2d::Constant(kBorder_m));
    area.include(area.max_m + Eigen::Vector2d::Constant(kBorder_m));
    map.grid.origin_m = {area.min_m.x(), area.min_m.y()};
    map.grid.spacing_m = kTiltCell_m;
    const Eigen::Vector2d size = (area.max_m - area.min_m) / kTiltCell_m;
    map.height_m.assign(static_cast<std::size_t>(std::ceil(size.y())) + 1,
                        std::vector<double>(static_cast<std::size_t>(std::ceil(size.x())) + 1, 0.0));
  }
  double sum = 0.0, count = 0.0;
  for (std::size_t j = 0; j < map.height_m.size(); ++j) {
    for (std::size_t i = 0; i < map.height_m[j].size(); ++i) {
      double& height = map.height_m[j][i];
      if (tilt != nullptr) {
        height += map.grid.spacing_m *
                  (tilt->slope_x * static_cast<double>(i) + tilt->slope_y * static_cast<double>(j));
      }
      sum += height;
      count += 1.0;
    }
  }
  map.highest_m = 0.0;
  for (auto& row : map.height_m) {
    for (double& height : row) {
      height -= sum / count;
      map.highest_m = std::max(map.highest_m, std::abs(height));
    }
  }
  return map;
}

PlacedForce force_at(const Plant& plant, const Eigen::Vector2d& p_W) {
  PlanarState<double> at_rest;
  at_rest.p_WC = p_W;
  const VecX<double> closed = VecX<double>::Zero(plant.thruster_count());
  return {p_W, plant.wrench<double>(plant.start_s(), at_rest, plant.initial_hidden(), closed).force_W};
}

std::vector<Eigen::Vector2d> places_of(const DiagnosisScene& scene) {
  std::vector<Eigen::Vector2d> places;
  const auto far_from_all = [&places](const Eigen::Vector2d& p) {
    return std::all_of(places.begin(), places.end(),
                       [&](const Eigen::Vector2d& q) { return (p - q).norm() >= kArrowStep_m; });
  };
  for (const FlownPath& path : scene.paths) {
    for (const Eigen::Vector2d& p : path.p_W) {
      if (p.allFinite() && far_from_all(p)) places.push_back(p);
    }
  }
  if (!places.empty() || !scene.floor) return places;
  const Grid& grid = scene.floor->grid;
  for (std::size_t j = 0; j < scene.floor->height_m.size(); ++j) {
    for (std::size_t i = 0; i < scene.floor->height_m[j].size(); ++i)
      places.emplace_back(grid.origin_m[0] + grid.spacing_m * static_cast<double>(i),
                          grid.origin_m[1] + grid.spacing_m * static_cast<double>(j));
  }
  return places;
}

Eigen::Vector3f mix(const Eigen::Vector3f& a, const Eigen::Vector3f& b, double share) {
  return a + static_cast<float>(std::clamp(share, 0.0, 1.0)) * (b - a);
}

}  // namespace

DiagnosisScene load_diagnosis_scene(const Vehicle& vehicle, const std::string& model_path,
                                    const std::string& report_path) {
  const std::vector<Effect> effects = load_model(model_path, vehicle);
  DiagnosisScene scene;
  if (report_path.empty()) {
    for (const Effect& effect : effects) scene.statements.push_back(kind_of(effect));
  } else {
    read_report(report_path, scene);
  }
  Bounds2 flown;
  for (const FlownPath& path : scene.paths) {
    for (const Eigen::Vector2d& p : path.p_W) flown.include(p);
  }
  scene.floor = floor_of(effects, flown);
  for (const Effect& effect : effects) {
    if (const auto* patch = std::get_if<FrictionPatch>(&effect))
      scene.patches.push_back({{patch->center_x_m, patch->center_y_m}, patch->radius_m, patch->coefficient});
    if (const auto* tether = std::get_if<Tether>(&effect))
      scene.tether = TetherPlace{{tether->anchor_x_m, tether->anchor_y_m}, tether->slack_m};
  }
  const Plant plant(vehicle, effects, 0.0);
  for (const Eigen::Vector2d& p : places_of(scene)) scene.forces.push_back(force_at(plant, p));
  return scene;
}

Eigen::Vector3f diverging_color(double share) {
  const Eigen::Vector3f low(0.13f, 0.40f, 0.67f), middle(0.97f, 0.97f, 0.97f), high(0.70f, 0.09f, 0.17f);
  return share < 0.0 ? mix(middle, low, -share) : mix(middle, high, share);
}

Eigen::Vector3f mismatch_color(double mismatch) {
  const Eigen::Vector3f noise(0.35f, 0.60f, 0.45f), wrong(0.80f, 0.10f, 0.10f);
  return mix(noise, wrong, (mismatch - 1.0) / 3.0);
}

}  // namespace atmos
