#include "atmos_mocap_bridge/camera/renderer.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>
#include <stdexcept>

#include "atmos_mocap_bridge/camera/marker_detector.h"
#include "marker_dictionary.h"

namespace atmos {

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kSide = 4;            // rays a pixel: kSide x kSide
constexpr double kNowhere = 1e9;    // m, for rays that meet no floor
constexpr double kMargin_m = 0.03;  // of the white plate around the outermost markers
constexpr float kFloor = 110.0f, kWhite = 225.0f, kBlack = 25.0f, kNothing = 20.0f;
constexpr double kFloorPattern_m = 0.7, kFloorPattern = 6.0;  // faint waves: no real floor is one grey

// The cells of a marker with its black border, top row first.
struct Pattern {
  MarkerSettings marker;
  int cells;  // a side
  std::vector<bool> white;
};

Pattern pattern_of(const MarkerSettings& marker, const cv::Ptr<cv::aruco::Dictionary>& dictionary) {
  if (marker.id >= dictionary->bytesList.rows)
    throw std::invalid_argument("marker " + std::to_string(marker.id) + " is not in the dictionary");
  Pattern pattern{marker, dictionary->markerSize + 2, {}};
  cv::Mat bits;
  dictionary->drawMarker(marker.id, pattern.cells, bits, 1);
  for (int row = 0; row < pattern.cells; ++row) {
    for (int column = 0; column < pattern.cells; ++column)
      pattern.white.push_back(bits.at<std::uint8_t>(row, column) > 127);
  }
  return pattern;
}

// Grey of a white sheet with markers at `p`, in the frame of the markers; negative: not on the sheet.
class Sheet {
 public:
  Sheet(const std::vector<MarkerSettings>& markers, const cv::Ptr<cv::aruco::Dictionary>& dictionary)
      : low_(Vector2d::Constant(1e9)), high_(Vector2d::Constant(-1e9)) {
    for (const MarkerSettings& marker : markers) {
      patterns_.push_back(pattern_of(marker, dictionary));
      for (const Vector2d& corner : corners_of(marker)) {
        low_ = low_.cwiseMin(corner - Vector2d::Constant(kMargin_m));
        high_ = high_.cwiseMax(corner + Vector2d::Constant(kMargin_m));
      }
    }
  }

  float gray(const Vector2d& p) const {
    if ((p.array() < low_.array()).any() || (p.array() > high_.array()).any()) return -1.0f;
    for (const Pattern& pattern : patterns_) {
      const Vector2d q = (p - pattern.marker.center_m) / pattern.marker.size_m;
      if (std::abs(q.x()) >= 0.5 || std::abs(q.y()) >= 0.5) continue;
      const int column = static_cast<int>((q.x() + 0.5) * pattern.cells);
      const int row = static_cast<int>((0.5 - q.y()) * pattern.cells);
      return pattern.white[static_cast<std::size_t>(row * pattern.cells + column)] ? kWhite : kBlack;
    }
    return kWhite;
  }
  double radius() const { return std::max(low_.norm(), high_.norm()); }

 private:
  std::vector<Pattern> patterns_;
  Vector2d low_, high_;
};

}  // namespace

struct Renderer::Impl {
  explicit Impl(const RendererSettings& all) : settings(all), random(all.seed) {
    const auto dictionary = marker_dictionary(settings.dictionary);
    for (const BoardAppearance& board : settings.boards) sheets.emplace_back(board.markers, dictionary);
    for (const MarkerSettings& marker : settings.floor_markers)
      floor_sheets.emplace_back(std::vector<MarkerSettings>{marker}, dictionary);
    for (const BoardAppearance& board : settings.boards) planes.push_back(trace(board.height_m));
    draw_background();
    // Fresh noise for every pixel of every frame would cost more than all the rest: one big sheet of it is
    // laid over the image at a random place.
    const CameraIntrinsics& lens = settings.camera.intrinsics;
    noise.create(lens.height + 256, lens.width + 256, CV_16SC1);
    cv::RNG(settings.seed + 1).fill(noise, cv::RNG::NORMAL, 0.0, settings.noise);
  }

  int width() const { return settings.camera.intrinsics.width; }
  int height() const { return settings.camera.intrinsics.height; }

  // Where the rays of all pixels' centres meet the plane `z`: one pixel more each way, for the differences.
  std::vector<Vector2d> trace(double z) const {
    std::vector<Vector2d> pixels;
    for (int v = 0; v <= height(); ++v) {
      for (int u = 0; u <= width(); ++u) pixels.emplace_back(u, v);
    }
    std::vector<Vector2d> hits = undistort(settings.camera.intrinsics, pixels);
    const Vector3d p_WC = settings.camera.X_WC.translation();
    for (Vector2d& hit : hits) {
      const Vector3d direction = settings.camera.X_WC.linear() * Vector3d(hit.x(), hit.y(), 1.0);
      hit = direction.z() < 0.0 ? (p_WC + (z - p_WC.z()) / direction.z() * direction).head<2>().eval()
                                : Vector2d::Constant(kNowhere);
    }
    return hits;
  }

  // Where the ray of pixel (u + du, v + dv) meets the plane that was traced.
  Vector2d hit(const std::vector<Vector2d>& plane, int u, int v, double du, double dv) const {
    const std::size_t row = static_cast<std::size_t>(width()) + 1;
    const std::size_t at = static_cast<std::size_t>(v) * row + static_cast<std::size_t>(u);
    return plane[at] + du * (plane[at + 1] - plane[at]) + dv * (plane[at + row] - plane[at]);
  }

  // Averages `gray(du, dv, number)` over the rays of a pixel.
  template <class Gray>
  static float average(const Gray& gray) {
    float sum = 0.0f;
    for (int i = 0; i < kSide * kSide; ++i)
      sum += gray((i % kSide + 0.5) / kSide - 0.5, (i / kSide + 0.5) / kSide - 0.5, i);
    return sum / (kSide * kSide);
  }

  void draw_background() {
    const std::vector<Vector2d> floor = trace(0.0);
    background.create(height(), width(), CV_32FC1);
    const auto on_sheet = [&](const Vector2d& p) {
      float gray = -1.0f;
      for (const Sheet& sheet : floor_sheets) gray = std::max(gray, sheet.gray(p));
      return gray;
    };
    for (int v = 0; v < height(); ++v) {
      for (int u = 0; u < width(); ++u) {
        const Vector2d p = hit(floor, u, v, 0.0, 0.0);
        const float bare =
            p.x() > 0.1 * kNowhere
                ? kNothing
                : kFloor + static_cast<float>(kFloorPattern * std::sin(p.x() / kFloorPattern_m) *
                                              std::sin(p.y() / kFloorPattern_m));
        // Only where a sheet touches the pixel's corners do its rays differ.
        bool touched = false;
        for (const double du : {-0.5, 0.5}) {
          for (const double dv : {-0.5, 0.5}) touched = touched || on_sheet(hit(floor, u, v, du, dv)) >= 0.0f;
        }
        background.at<float>(v, u) = !touched ? bare : average([&](double du, double dv, int) {
          const float gray = on_sheet(hit(floor, u, v, du, dv));
          return gray >= 0.0f ? gray : bare;
        });
      }
    }
    blur(background, sharp_background = background.clone());
  }

  void blur(cv::Mat& out, const cv::Mat& in) const {
    if (settings.blur_px > 0.0)
      cv::GaussianBlur(in, out, {0, 0}, settings.blur_px);
    else
      in.copyTo(out);
  }

  // The part of the image in which the board can be, with room for the blur.
  cv::Rect region(const Sheet& sheet, const BoardAppearance& board, const BoardPose& pose) const {
    const double reach = sheet.radius() + pose.v_WB.norm() * settings.exposure_s;
    double u0 = 1e9, u1 = -1e9, v0 = 1e9, v1 = -1e9;
    for (const double dx : {-reach, reach}) {
      for (const double dy : {-reach, reach}) {
        const Vector3d corner(pose.p_WB.x() + dx, pose.p_WB.y() + dy, board.height_m);
        if ((settings.camera.X_WC.inverse() * corner).z() <= 0.1) return {};
        const Vector2d pixel = project(settings.camera, corner);
        u0 = std::min(u0, pixel.x()), u1 = std::max(u1, pixel.x());
        v0 = std::min(v0, pixel.y()), v1 = std::max(v1, pixel.y());
      }
    }
    const int room = 2 + static_cast<int>(std::ceil(4.0 * settings.blur_px));
    const cv::Rect2d box(u0 - room, v0 - room, u1 - u0 + 2 * room, v1 - v0 + 2 * room);
    return cv::Rect(box & cv::Rect2d(0, 0, width(), height()));
  }

  void draw_board(std::size_t index, const BoardPose& pose) {
    if (!pose.p_WB.allFinite() || !std::isfinite(pose.yaw)) return;
    const Sheet& sheet = sheets[index];
    const BoardAppearance& board = settings.boards[index];
    const cv::Rect box = region(sheet, board, pose);
    if (box.area() == 0) return;
    struct Instant {
      Vector2d p;
      double cosine, sine;
    };
    Instant instants[kSide * kSide];
    for (int i = 0; i < kSide * kSide; ++i) {
      // Rays side by side belong to instants far apart, so that a smear has no structure.
      const double t = ((7 * i) % (kSide * kSide) + 0.5) / (kSide * kSide) - 0.5;
      const double yaw = pose.yaw + pose.yaw_rate * t * settings.exposure_s;
      instants[i] = {pose.p_WB + t * settings.exposure_s * pose.v_WB, std::cos(yaw), std::sin(yaw)};
    }
    cv::Mat patch = sharp_background(box).clone();
    for (int v = 0; v < box.height; ++v) {
      for (int u = 0; u < box.width; ++u) {
        float& pixel = patch.at<float>(v, u);
        const float floor = pixel;
        pixel = average([&](double du, double dv, int i) {
          const Vector2d d = hit(planes[index], box.x + u, box.y + v, du, dv) - instants[i].p;
          const double c = instants[i].cosine, s = instants[i].sine;
          const float gray = sheet.gray({c * d.x() + s * d.y(), -s * d.x() + c * d.y()});
          return gray >= 0.0f ? gray : floor;
        });
      }
    }
    cv::Mat target = image(box);
    blur(target, patch);
  }

  RendererSettings settings;
  std::mt19937 random;
  std::vector<Sheet> sheets, floor_sheets;
  std::vector<std::vector<Vector2d>> planes;  // hits at the height of each board
  cv::Mat background, sharp_background;       // with and without the lens' blur
  cv::Mat image, noise, result;
};

Renderer::Renderer(const RendererSettings& settings) : impl_(std::make_unique<Impl>(settings)) {}
Renderer::~Renderer() = default;

GrayImage Renderer::render(const std::vector<BoardPose>& poses) {
  Impl& r = *impl_;
  r.background.copyTo(r.image);
  for (std::size_t i = 0; i < r.sheets.size() && i < poses.size(); ++i) r.draw_board(i, poses[i]);
  cv::Mat gray;
  r.image.convertTo(gray, CV_16SC1);
  std::uniform_int_distribution<int> place(0, 255);
  const int x = place(r.random), y = place(r.random);
  gray += r.noise(cv::Rect(x, y, r.width(), r.height()));
  gray.convertTo(r.result, CV_8UC1);
  return {r.width(), r.height(), r.result.data, r.result.step};
}

}  // namespace atmos
