#include "atmos_px4_bridge/px4_modes.h"

namespace atmos {

const char* name_of(FlightMode mode) {
  switch (mode) {
    case FlightMode::kManual:
      return "manual";
    case FlightMode::kAltitude:
      return "altitude";
    case FlightMode::kPosition:
      return "position";
    case FlightMode::kAuto:
      return "auto";
    case FlightMode::kAcro:
      return "acro";
    case FlightMode::kOffboard:
      return "offboard";
    case FlightMode::kStabilized:
      return "stabilized";
    case FlightMode::kUnknown:
      break;
  }
  return "unknown";
}

FlightMode mode_named(const std::string& name) {
  for (std::uint8_t number = 1; number <= 7; ++number) {
    if (name == name_of(mode_of(number))) return mode_of(number);
  }
  return FlightMode::kUnknown;
}

const char* command_result_text(std::uint8_t result) {
  switch (result) {
    case kResultTemporarilyRejected:
      return "temporarily rejected";
    case kResultDenied:
      return "denied";
    case kResultUnsupported:
      return "unsupported";
    default:
      return "failed";
  }
}

}  // namespace atmos
