#include "connections.h"

#include <ros/master.h>
#include <ros/network.h>
#include <ros/this_node.h>
#include <xmlrpcpp/XmlRpc.h>

#include <sstream>

#include "atmos_model/strict_yaml.h"

namespace atmos {

namespace {

// One row of a node's getBusInfo. The peer of an inbound link is the publisher's address, of an outbound one
// the subscriber's name.
struct Link {
  std::string peer, direction, topic;
};

// The links of the node that answers at `uri`; none when there is no such node.
std::vector<Link> links_of(const std::string& uri) {
  std::string host;
  std::uint32_t port = 0;
  if (!ros::network::splitURI(uri, host, port)) return {};
  XmlRpc::XmlRpcClient client(host.c_str(), static_cast<int>(port), "/");
  XmlRpc::XmlRpcValue self, answer;
  self[0] = ros::this_node::getName();
  if (!client.execute("getBusInfo", self, answer) || client.isFault()) return {};
  std::vector<Link> links;
  try {
    // [code, message, [[id, peer, direction, transport, topic, connected, ...], ...]]
    XmlRpc::XmlRpcValue& rows = answer[2];
    for (int i = 0; i < rows.size(); ++i) links.push_back({rows[i][1], rows[i][2], rows[i][4]});
  } catch (const XmlRpc::XmlRpcException&) {
    return {};  // not the answer of a ROS node
  }
  return links;
}

}  // namespace

std::vector<Connection> parse_connections(const std::string& text) {
  std::vector<Connection> connections;
  std::vector<ConfigFault> faults;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    const std::size_t colon = word.find(':');
    if (colon == std::string::npos || word[0] != '/' || word.size() < colon + 3 || word[colon + 1] != '/') {
      faults.push_back({ros::this_node::getName(), 0, "wait_for", "'" + word + "' must be /node:/topic"});
      continue;
    }
    connections.push_back({word.substr(0, colon), word.substr(colon + 1)});
  }
  if (!faults.empty()) throw ConfigError(faults);
  return connections;
}

bool is_connected(const Connection& connection) {
  XmlRpc::XmlRpcValue request, response, uri;
  request[0] = ros::this_node::getName();
  request[1] = connection.node;
  if (!ros::master::execute("lookupNode", request, response, uri, false)) return false;
  // The subscriber lists a link as soon as it asks for it; messages reach it once the publisher lists it too.
  for (const Link& in : links_of(uri)) {
    if (in.direction != "i" || in.topic != connection.topic) continue;
    for (const Link& out : links_of(in.peer)) {
      if (out.direction == "o" && out.topic == connection.topic && out.peer == connection.node) return true;
    }
  }
  return false;
}

}  // namespace atmos
