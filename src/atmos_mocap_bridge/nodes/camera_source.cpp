// Frames out of the images of an overhead camera that sees the robot's markers.
#include <deque>

#include "atmos_mocap_bridge/camera/planar_pose.h"
#include "camera_messages.h"
#include "pose_source.h"

namespace atmos {

namespace {

constexpr std::uint32_t kLockstepQueue = 1000;  // images: none may be lost
constexpr std::uint32_t kQueue = 1;             // in real time the newest image is the only one of use

class CameraSource : public PoseSource {
 public:
  CameraSource(const CameraSourceConfig& config, const SourceContext& context)
      : config_(context.config),
        sink_(context.sink),
        queue_(context.lockstep ? kLockstepQueue : kQueue),
        detector_(config.dictionary),
        fit_{config.markers, config.board_height_m, config.min_corners, config.corner_noise_px,
             config.max_reprojection_px} {
    camera_.X_WC = load_extrinsic(config.extrinsic_path).X_WC;
    ros::NodeHandle node = context.node;
    const auto hints = ros::TransportHints().tcpNoDelay();
    info_subscriber_ = node.subscribe(config.camera_info, queue_, &CameraSource::on_info, this, hints);
    image_subscriber_ = node.subscribe(config.image, queue_, &CameraSource::on_image, this, hints);
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& out) override {
    using diagnostic_msgs::DiagnosticStatus;
    if (images_ == 0)
      out.summary(DiagnosticStatus::WARN, "no image on " + image_subscriber_.getTopic());
    else if (!calibrated_)
      out.summary(DiagnosticStatus::ERROR, "no usable calibration on " + info_subscriber_.getTopic());
    else if (corners_ == 0)
      out.summary(DiagnosticStatus::WARN, "the board is not seen");
    else
      out.summary(DiagnosticStatus::OK, "the board is seen");
    out.add("images", images_);
    out.add("images without the board", unseen_);
    out.add("images that cannot be read", unreadable_);
    out.add("corners of the board", corners_);
    out.add("reprojection RMS [px]", rms_px_);
  }

 private:
  void on_info(const sensor_msgs::CameraInfo& message) {
    const auto intrinsics = from_message(message);
    if (!intrinsics) {
      ROS_WARN_THROTTLE(5.0, "%s: not calibrated, or not with plumb_bob",
                        info_subscriber_.getTopic().c_str());
      return;
    }
    camera_.intrinsics = *intrinsics;
    calibrated_ = true;
    for (; !waiting_.empty(); waiting_.pop_front()) take(*waiting_.front(), ros::SteadyTime::now());
  }

  // Images come on a connection of their own: the first may be here before the calibration.
  void on_image(const sensor_msgs::Image::ConstPtr& message) {
    ++images_;
    if (calibrated_) return take(*message, ros::SteadyTime::now());
    waiting_.push_back(message);
    if (waiting_.size() > queue_) waiting_.pop_front();
  }

  void take(const sensor_msgs::Image& message, const ros::SteadyTime& received) {
    const double stamp = message.header.stamp.toSec();
    PoseFrame frame = unseen_frame(stamp);
    corners_ = 0;
    const auto image = gray_view(message, storage_);
    if (!image || image->width != camera_.intrinsics.width || image->height != camera_.intrinsics.height) {
      ++unreadable_;
    } else if (const auto fit = fit_planar_pose(camera_, fit_, detector_.detect(*image))) {
      frame = to_pose_frame(*fit, stamp, config_);
      corners_ = fit->corners;
      rms_px_ = fit->rms_px;
    } else {
      ++unseen_;
    }
    sink_({message.header.stamp, frame, received});
  }

  MocapConfig config_;
  Sink sink_;
  std::uint32_t queue_;
  MarkerDetector detector_;
  FitSettings fit_;
  Camera camera_;
  bool calibrated_ = false;
  std::deque<sensor_msgs::Image::ConstPtr> waiting_;
  std::vector<std::uint8_t> storage_;
  std::uint64_t images_ = 0, unseen_ = 0, unreadable_ = 0;
  int corners_ = 0;
  double rms_px_ = 0.0;
  ros::Subscriber info_subscriber_, image_subscriber_;
};

}  // namespace

std::unique_ptr<PoseSource> make_camera_source(const CameraSourceConfig& config,
                                               const SourceContext& context) {
  return std::make_unique<CameraSource>(config, context);
}

}  // namespace atmos
