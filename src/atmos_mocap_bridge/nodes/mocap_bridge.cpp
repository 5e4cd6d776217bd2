// Poses of a motion capture -> odometry (docs/mocap.md).
// Parameters: ~vehicle and ~config (paths), ~lockstep (bool).
#include <ros/ros.h>

#include "atmos_model_ros/node.h"
#include "bridge_node.h"

int main(int argc, char** argv) {
  return atmos::run_node(argc, argv, "mocap_bridge", [] {
    const ros::NodeHandle parameters("~");
    const auto config =
        atmos::load_mocap_config(atmos::required_parameter<std::string>(parameters, "config"));
    const auto vehicle = atmos::load_vehicle(atmos::required_parameter<std::string>(parameters, "vehicle"));
    const bool lockstep = atmos::required_parameter<bool>(parameters, "lockstep");
    const atmos::BridgeNode node(config, vehicle, lockstep);
    ros::spin();
    return 0;
  });
}
