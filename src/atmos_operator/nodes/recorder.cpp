// Records topics into a bag without losing a message at many times real time: unlike rosbag record, whose
// queues hold 100 messages a topic. `recorder --help` explains the arguments. `configuration` at the head of
// every file says what is running: every configuration file that a parameter names. SIGINT writes what has
// arrived and closes the bag.
#include <atmos_msgs/RunConfiguration.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <rosbag/bag.h>
#include <topic_tools/shape_shifter.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "atmos_operator/run_configuration.h"

namespace atmos {
namespace {

constexpr std::uint32_t kQueue = 100000;  // messages of each topic
constexpr double kMegabyte = 1e6;
const ros::WallDuration kLook(1.0);  // between two looks at what is running

using Event = ros::MessageEvent<topic_tools::ShapeShifter const>;

volatile std::sig_atomic_t interrupted = 0;
void interrupt(int) { interrupted = 1; }

struct Options {
  std::string bag;
  std::vector<std::string> topics;
  std::vector<std::string> repeated;
  std::string compression = "lz4";
  double split_mb = 0.0, split_s = 0.0;
};

// The scalars of the parameter server, "/name" -> value.
void flatten(const std::string& name, XmlRpc::XmlRpcValue& value, std::map<std::string, std::string>& out) {
  switch (value.getType()) {
    case XmlRpc::XmlRpcValue::TypeStruct:
      for (auto& member : value) flatten(name + "/" + member.first, member.second, out);
      break;
    case XmlRpc::XmlRpcValue::TypeString:
      out[name] = static_cast<std::string>(value);
      break;
    case XmlRpc::XmlRpcValue::TypeBoolean:
      out[name] = static_cast<bool>(value) ? "true" : "false";
      break;
    case XmlRpc::XmlRpcValue::TypeInt:
      out[name] = std::to_string(static_cast<int>(value));
      break;
    case XmlRpc::XmlRpcValue::TypeDouble: {
      char text[32];
      std::snprintf(text, sizeof text, "%.17g", static_cast<double>(value));
      out[name] = text;
      break;
    }
    default:
      break;  // lists and binaries are no settings of ours
  }
}

std::map<std::string, std::string> parameters() {
  XmlRpc::XmlRpcValue all;
  std::map<std::string, std::string> found;
  if (ros::param::get("/", all)) flatten("", all, found);
  return found;
}

std::string git_revision(const std::string& file) {
  std::string folder = std::filesystem::path(file).parent_path(), quoted;
  for (const char c : folder) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  FILE* pipe = popen(("git -C '" + quoted + "' describe --always --dirty --tags 2>/dev/null").c_str(), "r");
  if (pipe == nullptr) return "";
  char line[256];
  std::string revision = std::fgets(line, sizeof line, pipe) != nullptr ? line : "";
  pclose(pipe);
  revision.erase(std::remove(revision.begin(), revision.end(), '\n'), revision.end());
  return revision;
}

class Recorder {
 public:
  explicit Recorder(Options options) : options_(std::move(options)) {
    topic_ = node_.resolveName("configuration");
    configuration_publisher_ = node_.advertise<atmos_msgs::RunConfiguration>("configuration", 1, true);
    for (std::string& name : options_.repeated) name = node_.resolveName(name);
    look();
    open();
    for (const std::string& name : options_.topics) subscribe(node_.resolveName(name));
  }

  void spin() {
    ros::WallTime next_look = ros::WallTime::now() + kLook;
    while (ros::ok() && !interrupted) {
      ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.1));
      if (ros::WallTime::now() < next_look) continue;
      next_look = ros::WallTime::now() + kLook;
      if (look()) write_configuration();
    }
    ros::getGlobalCallbackQueue()->callAvailable();
    bag_.close();
  }

 private:
  // Before simulated time starts there is no time to write under.
  static ros::Time now() { return std::max(ros::Time::now(), ros::TIME_MIN); }

  bool splits() const { return options_.split_mb > 0.0 || options_.split_s > 0.0; }

  // "run.bag", or with splitting "run_0.bag", "run_1.bag", ...
  std::string next_name() {
    if (!splits()) return options_.bag;
    std::filesystem::path path(options_.bag);
    const std::string number = std::to_string(files_++);
    return path.replace_filename(path.stem().string() + "_" + number + ".bag");
  }

  void open() {
    bag_.open(next_name(), rosbag::bagmode::Write);
    bag_.setCompression(options_.compression == "none"  ? rosbag::compression::Uncompressed
                        : options_.compression == "bz2" ? rosbag::compression::BZ2
                                                        : rosbag::compression::LZ4);
    opened_ = now();
    write_configuration();
    // What holds until the next message of its topic holds in this file, too.
    for (const auto& [topic, event] : held_)
      bag_.write(topic, opened_, *event.getConstMessage(), event.getConnectionHeaderPtr());
  }

  void subscribe(const std::string& topic) {
    const bool repeated =
        std::find(options_.repeated.begin(), options_.repeated.end(), topic) != options_.repeated.end();
    const boost::function<void(const Event&)> write = [this, topic, repeated](const Event& event) {
      const ros::Time time = now();
      split_if_full(time);
      bag_.write(topic, time, *event.getConstMessage(), event.getConnectionHeaderPtr());
      if (repeated) held_[topic] = event;
    };
    ros::SubscribeOptions subscription;
    subscription.initByFullCallbackType<const Event&>(topic, kQueue, write);
    subscription.transport_hints = ros::TransportHints().tcpNoDelay();
    subscribers_.push_back(node_.subscribe(subscription));
  }

  void split_if_full(const ros::Time& time) {
    const bool large = options_.split_mb > 0.0 && bag_.getSize() >= options_.split_mb * kMegabyte;
    // Simulated time may start after the file.
    if (options_.split_s > 0.0 && opened_ == ros::TIME_MIN) opened_ = time;
    const bool late = options_.split_s > 0.0 && (time - opened_).toSec() >= options_.split_s;
    if (!large && !late) return;
    bag_.close();
    open();
  }

  // Reads what is running; true when it is not what it was.
  bool look() {
    const std::map<std::string, std::string> found = parameters();
    if (found == parameters_) return false;
    parameters_ = found;
    const RunConfiguration run = collect_configuration(found);
    configuration_ = atmos_msgs::RunConfiguration();
    configuration_.digest = run.digest;
    for (std::size_t i = 0; i < run.files.size() && configuration_.revision.empty(); ++i)
      configuration_.revision = git_revision(run.files[i].path);
    for (const auto& [name, value] : found) {
      // What roslaunch waits for says nothing of the flight.
      if (name.find("/wait_for") == name.npos) configuration_.parameters.push_back(name + ": " + value);
    }
    for (const ConfigurationFile& file : run.files) {
      atmos_msgs::ConfigurationFile entry;
      entry.path = file.path;
      entry.used_by = file.used_by;
      entry.sha256 = file.sha256;
      entry.content = file.content;
      configuration_.files.push_back(entry);
    }
    configuration_.header.stamp = now();
    configuration_publisher_.publish(configuration_);
    return true;
  }

  void write_configuration() {
    using namespace ros::message_traits;
    const auto header = boost::make_shared<ros::M_string>();
    (*header)["topic"] = topic_;
    (*header)["callerid"] = ros::this_node::getName();
    (*header)["latching"] = "1";
    (*header)["type"] = datatype(configuration_);
    (*header)["md5sum"] = md5sum(configuration_);
    (*header)["message_definition"] = definition(configuration_);
    bag_.write(topic_, now(), configuration_, header);
  }

  ros::NodeHandle node_;
  Options options_;
  std::string topic_;
  rosbag::Bag bag_;
  int files_ = 0;
  ros::Time opened_;
  std::map<std::string, Event> held_;
  std::map<std::string, std::string> parameters_;
  atmos_msgs::RunConfiguration configuration_;
  ros::Publisher configuration_publisher_;
  std::vector<ros::Subscriber> subscribers_;
};

}  // namespace
}  // namespace atmos

int main(int argc, char** argv) {
  ros::init(argc, argv, "recorder", ros::init_options::NoSigintHandler);
  atmos::Options options;
  CLI::App app("Records topics into a bag, with what is running at the head of every file.");
  app.add_option("bag", options.bag, "bag file, overwritten")->required();
  app.add_option("topics", options.topics, "topics, seen from the node's namespace")->required();
  app.add_option("--repeat", options.repeated, "topic whose last message is repeated at the head of a file")
      ->allow_extra_args(false);
  app.add_option("--split-mb", options.split_mb, "size [MB] after which a new file begins; 0: never");
  app.add_option("--split-s", options.split_s, "ROS time [s] after which a new file begins; 0: never");
  app.add_option("--compression", options.compression, "none, lz4 or bz2")
      ->check(CLI::IsMember({"none", "lz4", "bz2"}));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  std::signal(SIGINT, atmos::interrupt);
  std::signal(SIGTERM, atmos::interrupt);
  try {
    atmos::Recorder(options).spin();
  } catch (const rosbag::BagException& error) {
    std::fprintf(stderr, "recorder: %s: %s\n", options.bag.c_str(), error.what());
    return 1;
  }
  return 0;
}
