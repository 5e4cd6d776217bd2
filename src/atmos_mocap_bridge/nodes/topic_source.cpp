#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TransformStamped.h>

#include "pose_source.h"

namespace atmos {

namespace {

constexpr std::uint32_t kQueue = 10000;  // messages: nothing may be lost at many times real time

class TopicSource : public PoseSource {
 public:
  TopicSource(const TopicSourceConfig& config, const SourceContext& context) : sink_(context.sink) {
    ros::NodeHandle node = context.node;
    const auto hints = ros::TransportHints().tcpNoDelay();
    subscriber_ = config.transform
                      ? node.subscribe(config.topic, kQueue, &TopicSource::on_transform, this, hints)
                      : node.subscribe(config.topic, kQueue, &TopicSource::on_pose, this, hints);
    is_pose_topic_ = subscriber_.getTopic() == node.resolveName("mocap/pose");
  }

  bool is_pose_topic() const override { return is_pose_topic_; }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& out) override {
    if (subscriber_.getNumPublishers() == 0)
      out.summary(diagnostic_msgs::DiagnosticStatus::WARN, "nobody publishes " + subscriber_.getTopic());
    else
      out.summary(diagnostic_msgs::DiagnosticStatus::OK, "listening to " + subscriber_.getTopic());
  }

 private:
  template <class Position, class Orientation>
  void take(const ros::Time& stamp, const Position& p, const Orientation& q) {
    sink_({stamp, {stamp.toSec(), {p.x, p.y, p.z}, {q.w, q.x, q.y, q.z}}, ros::SteadyTime::now()});
  }
  void on_pose(const geometry_msgs::PoseStamped& message) {
    take(message.header.stamp, message.pose.position, message.pose.orientation);
  }
  void on_transform(const geometry_msgs::TransformStamped& message) {
    take(message.header.stamp, message.transform.translation, message.transform.rotation);
  }

  Sink sink_;
  ros::Subscriber subscriber_;
  bool is_pose_topic_ = false;
};

}  // namespace

std::unique_ptr<PoseSource> make_topic_source(const TopicSourceConfig& config, const SourceContext& context) {
  return std::make_unique<TopicSource>(config, context);
}

}  // namespace atmos
