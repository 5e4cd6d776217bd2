// Which subscriptions of other nodes are connected, by asking the nodes themselves.
#pragma once

#include <string>
#include <vector>

namespace atmos {

// The subscriber `node` receives `topic` from some publisher.
struct Connection {
  std::string node;
  std::string topic;
};

// "/atmos/nmpc:/atmos/odometry /atmos/nmpc:/atmos/setpoint"; throws ConfigError naming every malformed word.
std::vector<Connection> parse_connections(const std::string& text);

// Asks the node and its publishers (master API lookupNode, slave API getBusInfo): messages published from now
// on arrive. False as well when a node does not exist or answer.
bool is_connected(const Connection& connection);

}  // namespace atmos
