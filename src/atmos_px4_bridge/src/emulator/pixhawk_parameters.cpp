#include "atmos_px4_bridge/emulator/pixhawk_parameters.h"

#include <cmath>
#include <set>

#include "atmos_model/strict_yaml.h"

namespace atmos {

namespace {

double radians(double degrees) { return degrees * M_PI / 180.0; }

const std::set<std::string> kWhole = {"COM_OBL_RC_ACT", "COM_LOW_BAT_ACT", "MAV_SYS_ID", "MAV_FWDEXTSP",
                                      "CA_METHOD"};

}  // namespace

PixhawkParameters::PixhawkParameters()
    : values_{{"SPC_POS_P", 0.2},        {"SPC_POS_I", 0.0},       {"SPC_POS_I_LIM", 1.0},
              {"SPC_VEL_P", 6.55},       {"SPC_VEL_I", 0.0},       {"SPC_VEL_I_LIM", 1.0},
              {"SPC_VEL_D", 0.0},        {"SPC_VEL_MAX", 12.0},    {"SPC_VEL_MANUAL", 10.0},
              {"SPC_THR_MAX", 1.0},      {"SPC_MAN_Y_MAX", 150.0}, {"SC_YAW_P", 2.8},
              {"SC_ROLL_P", 6.5},        {"SC_PITCH_P", 6.5},      {"SC_YAWRATE_P", 10.0},
              {"SC_YAWRATE_I", 0.865},   {"SC_YAWRATE_D", 0.0},    {"SC_YR_INT_LIM", 0.2},
              {"SC_YAWRATE_MAX", 200.0}, {"SC_MAN_F_MAX", 1.0},    {"SC_MAN_T_MAX", 1.0},
              {"COM_OF_LOSS_T", 1.0},    {"COM_OBL_RC_ACT", 0.0},  {"COM_RC_LOSS_T", 0.5},
              {"COM_LOW_BAT_ACT", 0.0},  {"BAT_CRIT_THR", 0.07},   {"MAV_SYS_ID", 1.0},
              {"MAV_FWDEXTSP", 1.0},     {"CA_METHOD", 0.0}} {}

PixhawkParameters PixhawkParameters::load(const std::string& path) {
  const ConfigFile file(path);
  const ConfigMap map = file.root().map("parameters");
  PixhawkParameters parameters;
  for (const std::string& name : map.keys()) {
    if (parameters.has(name)) parameters.values_[name] = map.number(name, Bounds::any());
  }
  file.check();
  return parameters;
}

bool PixhawkParameters::set(const std::string& name, double value) {
  const auto found = values_.find(name);
  if (found == values_.end() || !std::isfinite(value)) return false;
  found->second = value;
  return true;
}

bool PixhawkParameters::is_whole(const std::string& name) { return kWhole.count(name) > 0; }

CascadeGains PixhawkParameters::gains() const {
  const auto& at = *this;
  CascadeGains gains{};
  gains.position_p.setConstant(at["SPC_POS_P"]);
  gains.position_i.setConstant(at["SPC_POS_I"]);
  gains.position_integral_max.setConstant(at["SPC_POS_I_LIM"]);
  gains.velocity_max.setConstant(at["SPC_VEL_MAX"]);
  gains.velocity.fill({at["SPC_VEL_P"], at["SPC_VEL_I"], at["SPC_VEL_D"], 0.0, at["SPC_VEL_I_LIM"]});
  gains.force_max.setConstant(at["SPC_THR_MAX"]);
  gains.attitude_p << at["SC_ROLL_P"], at["SC_PITCH_P"], at["SC_YAW_P"];
  gains.rate_max.setConstant(radians(at["SC_YAWRATE_MAX"]));
  // Roll and pitch have no actuators on a planar vehicle.
  gains.rate.fill({at["SC_YAWRATE_P"], at["SC_YAWRATE_I"], at["SC_YAWRATE_D"], 0.0, at["SC_YR_INT_LIM"]});
  return gains;
}

}  // namespace atmos
