#include "connections.h"

#include <ros/master.h>
#include <ros/network.h>
#include <ros/this_node.h>
#include <xmlrpcpp/XmlRpc.h>

#include <sstream>

#include "atmos_model/strict_yaml.h"

namespace atmos {

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
  std::string host;
  std::uint32_t port = 0;
  if (!ros::network::splitURI(static_cast<std::string&>(uri), host, port)) return false;

  XmlRpc::XmlRpcClient client(host.c_str(), static_cast<int>(port), "/");
  XmlRpc::XmlRpcValue self, info;
  self[0] = ros::this_node::getName();
  if (!client.execute("getBusInfo", self, info) || client.isFault()) return false;
  try {
    // [code, message, [[id, peer, direction, transport, topic, connected, ...], ...]]
    XmlRpc::XmlRpcValue& rows = info[2];
    for (int i = 0; i < rows.size(); ++i) {
      XmlRpc::XmlRpcValue& row = rows[i];
      if (static_cast<std::string&>(row[2]) != "i" || static_cast<std::string&>(row[4]) != connection.topic) continue;
      if (row.size() < 6) return true;
      if (row[5].getType() == XmlRpc::XmlRpcValue::TypeInt ? static_cast<int&>(row[5]) != 0
                                                           : static_cast<bool&>(row[5]))
        return true;
    }
  } catch (const XmlRpc::XmlRpcException&) {
    return false;  // not the answer of a ROS node
  }
  return false;
}

}  // namespace atmos
