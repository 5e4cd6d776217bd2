// Records topics into a bag without losing a message at many times real time: unlike rosbag record, whose
// queues hold 100 messages a topic. Usage: recorder BAG TOPIC...; SIGINT writes what has arrived and closes
// the bag.
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <rosbag/bag.h>
#include <topic_tools/shape_shifter.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <string>
#include <vector>

namespace {

constexpr std::uint32_t kQueue = 100000;  // messages of each topic

volatile std::sig_atomic_t interrupted = 0;
void interrupt(int) { interrupted = 1; }

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "recorder", ros::init_options::NoSigintHandler);
  if (argc < 3) {
    std::fprintf(stderr, "usage: recorder BAG TOPIC...\n");
    return 2;
  }
  ros::NodeHandle node;
  std::signal(SIGINT, interrupt);
  std::signal(SIGTERM, interrupt);
  try {
    rosbag::Bag bag(argv[1], rosbag::bagmode::Write);
    bag.setCompression(rosbag::compression::LZ4);
    std::vector<ros::Subscriber> subscribers;
    for (int i = 2; i < argc; ++i) {
      const std::string topic = node.resolveName(argv[i]);
      const boost::function<void(const ros::MessageEvent<topic_tools::ShapeShifter const>&)> write =
          [&bag, topic](const ros::MessageEvent<topic_tools::ShapeShifter const>& event) {
            // Before simulated time starts there is no time to write under.
            bag.write(topic, std::max(ros::Time::now(), ros::TIME_MIN), *event.getConstMessage(),
                      event.getConnectionHeaderPtr());
          };
      ros::SubscribeOptions options;
      options.initByFullCallbackType<const ros::MessageEvent<topic_tools::ShapeShifter const>&>(topic, kQueue,
                                                                                                write);
      options.transport_hints = ros::TransportHints().tcpNoDelay();
      subscribers.push_back(node.subscribe(options));
    }
    while (ros::ok() && !interrupted) ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.1));
    ros::getGlobalCallbackQueue()->callAvailable();
    bag.close();
  } catch (const rosbag::BagException& error) {
    std::fprintf(stderr, "recorder: %s: %s\n", argv[1], error.what());
    return 1;
  }
  return 0;
}
