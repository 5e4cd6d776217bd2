// Which subscriptions of other nodes are connected, by asking the nodes themselves. For nodes only.
#pragma once

#include <ros/master.h>
#include <ros/network.h>
#include <ros/ros.h>
#include <xmlrpcpp/XmlRpc.h>

#include <algorithm>
#include <cstdio>
#include <sstream>
#include <string>
#include <vector>

#include "atmos_model/strict_yaml.h"

namespace atmos {

// The subscriber `node` receives `topic` from some publisher.
struct Connection {
  std::string node;
  std::string topic;
};

// "/atmos/nmpc:/atmos/odometry /atmos/nmpc:/atmos/setpoint"; throws ConfigError naming every malformed word.
inline std::vector<Connection> parse_connections(const std::string& text) {
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

// One row of a node's getBusInfo. The peer of an inbound link is the publisher's address, of an outbound one
// the subscriber's name.
struct BusLink {
  std::string peer, direction, topic;
};

// The links of the node that answers at `uri`; none when there is no such node.
inline std::vector<BusLink> links_of(const std::string& uri) {
  std::string host;
  std::uint32_t port = 0;
  if (!ros::network::splitURI(uri, host, port)) return {};
  XmlRpc::XmlRpcClient client(host.c_str(), static_cast<int>(port), "/");
  XmlRpc::XmlRpcValue self, answer;
  self[0] = ros::this_node::getName();
  if (!client.execute("getBusInfo", self, answer) || client.isFault()) return {};
  std::vector<BusLink> links;
  try {
    // [code, message, [[id, peer, direction, transport, topic, connected, ...], ...]]
    XmlRpc::XmlRpcValue& rows = answer[2];
    for (int i = 0; i < rows.size(); ++i) links.push_back({rows[i][1], rows[i][2], rows[i][4]});
  } catch (const XmlRpc::XmlRpcException&) {
    return {};  // not the answer of a ROS node
  }
  return links;
}

// Asks the node and its publishers (master API lookupNode, slave API getBusInfo): messages published from now
// on arrive. False as well when a node does not exist or answer.
inline bool is_connected(const Connection& connection) {
  XmlRpc::XmlRpcValue request, response, uri;
  request[0] = ros::this_node::getName();
  request[1] = connection.node;
  if (!ros::master::execute("lookupNode", request, response, uri, false)) return false;
  // The subscriber lists a link as soon as it asks for it; messages reach it once the publisher lists it too.
  for (const BusLink& in : links_of(uri)) {
    if (in.direction != "i" || in.topic != connection.topic) continue;
    for (const BusLink& out : links_of(in.peer)) {
      if (out.direction == "o" && out.topic == connection.topic && out.peer == connection.node) return true;
    }
  }
  return false;
}

// Waits until all of `missing` are there, calling `meanwhile` on the way. False after `limit_s` of wall time,
// with a line on stderr for each that is still missing, and when the node is shut down.
template <class Meanwhile>
bool wait_for_connections(std::vector<Connection> missing, double limit_s, const char* who,
                          const Meanwhile& meanwhile) {
  const ros::WallTime limit = ros::WallTime::now() + ros::WallDuration(limit_s);
  while (ros::ok()) {
    meanwhile();
    missing.erase(std::remove_if(missing.begin(), missing.end(), is_connected), missing.end());
    if (missing.empty()) return true;
    if (ros::WallTime::now() > limit) {
      for (const Connection& connection : missing)
        std::fprintf(stderr, "%s: no connection after %.3g s: node %s does not receive topic %s\n", who,
                     limit_s, connection.node.c_str(), connection.topic.c_str());
      return false;
    }
    ros::WallDuration(0.02).sleep();
  }
  return false;
}

}  // namespace atmos
