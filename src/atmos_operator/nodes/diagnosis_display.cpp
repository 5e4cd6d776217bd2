// What a diagnosis found, for rviz: model.yaml and report.json -> /display/diagnosis (MarkerArray, latched),
// in a world that tf knows.
// Parameters: ~vehicle, ~model (files), ~report (file; empty: no paths), ~exaggeration (of heights).
#include <ros/ros.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <visualization_msgs/MarkerArray.h>

#include <algorithm>
#include <cstdio>

#include "atmos_model_ros/marker.h"
#include "atmos_model_ros/messages.h"
#include "atmos_model_ros/node.h"
#include "atmos_operator/diagnosis_scene.h"

namespace atmos {
namespace {

using visualization_msgs::Marker;

constexpr double kForce_m_n = 3.0, kLongestArrow_m = 0.5;  // arrows of forces
constexpr int kRefine = 4;                                 // drawn cells per cell of a height map
constexpr int kLegendSteps = 24;

const auto kInk = color(0.10f, 0.12f, 0.16f, 1.0f);
const auto kForce = color(0.55f, 0.15f, 0.85f, 1.0f);
const auto kPatch = color(0.85f, 0.45f, 0.05f, 0.55f);

std_msgs::ColorRGBA paint(const Eigen::Vector3f& rgb, float alpha = 1.0f) {
  return color(rgb[0], rgb[1], rgb[2], alpha);
}

struct Area {
  double min_x = 1e9, min_y = 1e9, max_x = -1e9, max_y = -1e9;
  void include(double x, double y) {
    min_x = std::min(min_x, x);
    min_y = std::min(min_y, y);
    max_x = std::max(max_x, x);
    max_y = std::max(max_y, y);
  }
};

class Drawing {
 public:
  Drawing(const DiagnosisScene& scene, double exaggeration) : scene_(scene), exaggeration_(exaggeration) {
    for (const FlownPath& path : scene.paths) {
      for (const auto& p : path.p_W) area_.include(p.x(), p.y());
    }
    for (const RubbingPatch& patch : scene.patches) {
      area_.include(patch.center_m.x() - patch.radius_m, patch.center_m.y() - patch.radius_m);
      area_.include(patch.center_m.x() + patch.radius_m, patch.center_m.y() + patch.radius_m);
    }
    if (scene.floor) {
      const Grid& grid = scene.floor->grid;
      area_.include(grid.origin_m[0], grid.origin_m[1]);
      area_.include(
          grid.origin_m[0] + grid.spacing_m * static_cast<double>(scene.floor->height_m[0].size() - 1),
          grid.origin_m[1] + grid.spacing_m * static_cast<double>(scene.floor->height_m.size() - 1));
    }
    if (area_.min_x > area_.max_x) area_.include(0.0, 0.0);
    if (scene.floor) add_floor(*scene.floor);
    add_paths();
    add_forces();
    add_places();
    add_words();
  }

  const visualization_msgs::MarkerArray& array() const { return array_; }

 private:
  Marker& add(const std::string& ns, int type, const std_msgs::ColorRGBA& tint) {
    array_.markers.push_back(make_marker(ns, static_cast<int>(array_.markers.size()), type, tint));
    return array_.markers.back();
  }

  void add_text(const std::string& ns, double x, double y, const std::string& text, double height) {
    Marker& m = add(ns, Marker::TEXT_VIEW_FACING, kInk);
    m.pose.position = point_at({x, y, 0.05});
    m.scale.z = height;
    m.text = text;
  }

  double height_at(double x, double y) const {
    return scene_.floor ? exaggeration_ * bilinear<double>(scene_.floor->grid, scene_.floor->height_m, {x, y})
                        : 0.0;
  }

  void add_floor(const FloorMap& map) {
    Marker& mesh = add("floor map", Marker::TRIANGLE_LIST, color(1, 1, 1, 1));
    mesh.scale.x = mesh.scale.y = mesh.scale.z = 1.0;
    const double cell = map.grid.spacing_m / kRefine;
    const auto corner = [&](std::size_t i, std::size_t j) {
      const double x = map.grid.origin_m[0] + cell * static_cast<double>(i);
      const double y = map.grid.origin_m[1] + cell * static_cast<double>(j);
      const double h = bilinear<double>(map.grid, map.height_m, {x, y});
      mesh.points.push_back(point_at({x, y, exaggeration_ * h}));
      mesh.colors.push_back(paint(diverging_color(map.highest_m > 0.0 ? h / map.highest_m : 0.0)));
    };
    const std::size_t columns = kRefine * (map.height_m[0].size() - 1),
                      rows = kRefine * (map.height_m.size() - 1);
    for (std::size_t j = 0; j < rows; ++j) {
      for (std::size_t i = 0; i < columns; ++i) {
        for (const auto& [di, dj] : {std::pair{0u, 0u}, {1u, 0u}, {1u, 1u}, {0u, 0u}, {1u, 1u}, {0u, 1u}})
          corner(i + di, j + dj);
      }
    }
    add_legend(map.highest_m);
  }

  // A bar of the map's colours to its right, with heights in mm.
  void add_legend(double highest_m) {
    const double x = area_.max_x + 0.18, width = 0.1,
                 length = std::max(0.6, 0.8 * (area_.max_y - area_.min_y));
    const double low = 0.5 * (area_.min_y + area_.max_y - length);
    Marker& bar = add("legend", Marker::TRIANGLE_LIST, color(1, 1, 1, 1));
    bar.scale.x = bar.scale.y = bar.scale.z = 1.0;
    for (int k = 0; k < kLegendSteps; ++k) {
      const double y0 = low + length * k / kLegendSteps, y1 = low + length * (k + 1) / kLegendSteps;
      const auto tint = paint(diverging_color(2.0 * (k + 0.5) / kLegendSteps - 1.0));
      for (const auto& [px, py] :
           {std::pair{x, y0}, {x + width, y0}, {x + width, y1}, {x, y0}, {x + width, y1}, {x, y1}}) {
        bar.points.push_back(point_at({px, py, 0.01}));
        bar.colors.push_back(tint);
      }
    }
    for (const double share : {-1.0, -0.5, 0.0, 0.5, 1.0}) {
      char text[32];
      std::snprintf(text, sizeof(text), "%+.2f", 1e3 * highest_m * share);
      add_text("legend", x + width + 0.16, low + 0.5 * length * (share + 1.0), text, 0.08);
    }
    add_text("legend", x + 0.1, low + length + 0.12, "height [mm]", 0.08);
  }

  void add_paths() {
    for (const FlownPath& path : scene_.paths) {
      if (path.p_W.size() < 2) continue;
      for (const bool fitted : {false, true}) {
        Marker& line =
            add(fitted ? "path, fitted mismatch" : "path, nominal mismatch", Marker::LINE_STRIP, kInk);
        line.scale.x = fitted ? 0.01 : 0.035;
        const std::vector<double>& mismatch = fitted ? path.fitted : path.nominal;
        for (std::size_t i = 0; i < path.p_W.size(); ++i) {
          const auto& p = path.p_W[i];
          line.points.push_back(point_at({p.x(), p.y(), height_at(p.x(), p.y()) + (fitted ? 0.03 : 0.02)}));
          line.colors.push_back(paint(mismatch_color(mismatch[i])));
        }
      }
    }
  }

  void add_forces() {
    for (const PlacedForce& force : scene_.forces) {
      const double size = force.force_W.norm();
      if (!(size > 1e-3)) continue;
      const double length = std::min(kForce_m_n * size, kLongestArrow_m);
      const double z = height_at(force.p_W.x(), force.p_W.y()) + 0.05;
      const Eigen::Vector2d head = force.p_W + length * force.force_W / size;
      Marker& m = add("force of the found effects", Marker::ARROW, kForce);
      m.points = {point_at({force.p_W.x(), force.p_W.y(), z}), point_at({head.x(), head.y(), z})};
      m.scale.x = 0.012;
      m.scale.y = 0.035;
      m.scale.z = std::min(0.05, 0.5 * length);
    }
  }

  void add_places() {
    for (const RubbingPatch& patch : scene_.patches) {
      Marker& disc = add("friction patch", Marker::CYLINDER, kPatch);
      disc.pose.position = point_at({patch.center_m.x(), patch.center_m.y(), 0.005});
      disc.scale.x = disc.scale.y = 2.0 * patch.radius_m;
      disc.scale.z = 0.01;
      char text[48];
      std::snprintf(text, sizeof(text), "rubs, coefficient %.4f", patch.coefficient);
      add_text("friction patch", patch.center_m.x(), patch.center_m.y(), text, 0.07);
    }
    if (!scene_.tether) return;
    Marker& anchor = add("tether", Marker::SPHERE, kPatch);
    anchor.pose.position = point_at({scene_.tether->anchor_m.x(), scene_.tether->anchor_m.y(), 0.05});
    anchor.scale.x = anchor.scale.y = anchor.scale.z = 0.1;
    Marker& circle = add("tether", Marker::LINE_STRIP, kPatch);
    circle.scale.x = 0.015;
    for (int k = 0; k <= 72; ++k) {
      const double angle = 2.0 * M_PI * k / 72;
      circle.points.push_back(
          point_at({scene_.tether->anchor_m.x() + scene_.tether->slack_m * std::cos(angle),
                    scene_.tether->anchor_m.y() + scene_.tether->slack_m * std::sin(angle), 0.02}));
    }
  }

  void add_words() {
    const double middle = 0.5 * (area_.min_x + area_.max_x);
    std::string title = scene_.verdict;
    for (const std::string& statement : scene_.statements) title += (title.empty() ? "" : "\n") + statement;
    add_text("verdict", middle, area_.max_y + 0.15 + 0.05 * static_cast<double>(scene_.statements.size()),
             title, 0.07);
    if (scene_.paths.empty()) return;
    double strongest = 0.0;
    for (const PlacedForce& force : scene_.forces) strongest = std::max(strongest, force.force_W.norm());
    char text[200];
    std::snprintf(text, sizeof(text),
                  "paths: wide, nominal model; thin, fitted; green, noise alone; red, mismatch of 4 and "
                  "more\narrows: force of the found effects at "
                  "rest, largest %.0f mN; heights x %.0f",
                  1e3 * strongest, exaggeration_);
    add_text("legend", middle, area_.min_y - 0.25, text, 0.07);
  }

  const DiagnosisScene& scene_;
  double exaggeration_;
  Area area_;
  visualization_msgs::MarkerArray array_;
};

// rviz warns of a fixed frame that no transform names.
geometry_msgs::TransformStamped world_transform() {
  geometry_msgs::TransformStamped transform;
  transform.header.frame_id = kWorldFrame;
  transform.child_frame_id = "floor";
  transform.transform.rotation.w = 1.0;
  return transform;
}

}  // namespace
}  // namespace atmos

int main(int argc, char** argv) {
  return atmos::run_node(argc, argv, "diagnosis_display", [] {
    ros::NodeHandle node;
    const ros::NodeHandle parameters("~");
    const auto vehicle = atmos::load_vehicle(atmos::required_parameter<std::string>(parameters, "vehicle"));
    const auto scene =
        atmos::load_diagnosis_scene(vehicle, atmos::required_parameter<std::string>(parameters, "model"),
                                    parameters.param<std::string>("report", ""));
    const atmos::Drawing drawing(scene, parameters.param("exaggeration", 100.0));
    const ros::Publisher publisher =
        node.advertise<visualization_msgs::MarkerArray>("/display/diagnosis", 1, true);
    publisher.publish(drawing.array());
    tf2_ros::StaticTransformBroadcaster transforms;
    transforms.sendTransform(atmos::world_transform());
    ros::spin();
    return 0;
  });
}
