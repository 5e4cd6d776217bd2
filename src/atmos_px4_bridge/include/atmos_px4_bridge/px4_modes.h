// PX4's numbers of modes, commands and results, the same over every link.
#pragma once

#include <cstdint>

#include "atmos_px4_bridge/autopilot_link.h"

namespace atmos {

constexpr std::uint16_t kCommandSetMode = 176, kCommandArm = 400;
// Second parameter of kCommandArm: arm or disarm whatever the checks say.
constexpr float kForceMagic = 21196.0f;
constexpr std::uint8_t kResultAccepted = 0, kResultTemporarilyRejected = 1, kResultDenied = 2,
                       kResultUnsupported = 3, kResultInProgress = 5;
// Of a result that is not kResultAccepted.
const char* command_result_text(std::uint8_t result);

// Main modes: what a mode command asks for; MAVLink's HEARTBEAT has them in bits 16 to 23 of custom_mode.
constexpr std::uint8_t main_mode(FlightMode mode) {
  switch (mode) {
    case FlightMode::kManual:
      return 1;
    case FlightMode::kAltitude:
      return 2;
    case FlightMode::kPosition:
      return 3;
    case FlightMode::kAuto:
      return 4;
    case FlightMode::kAcro:
      return 5;
    case FlightMode::kOffboard:
      return 6;
    case FlightMode::kStabilized:
      return 7;
    case FlightMode::kUnknown:
      break;
  }
  return 0;
}

constexpr FlightMode mode_of(std::uint8_t main) {
  return main >= 1 && main <= 7 ? static_cast<FlightMode>(main) : FlightMode::kUnknown;
}
static_assert(mode_of(main_mode(FlightMode::kOffboard)) == FlightMode::kOffboard);
static_assert(mode_of(main_mode(FlightMode::kStabilized)) == FlightMode::kStabilized);

// Navigation states: what VehicleStatus reports.
constexpr FlightMode mode_of_navigation_state(std::uint8_t state) {
  switch (state) {
    case 0:
      return FlightMode::kManual;
    case 1:
      return FlightMode::kAltitude;
    case 2:
      return FlightMode::kPosition;
    case 10:
      return FlightMode::kAcro;
    case 14:
      return FlightMode::kOffboard;
    case 15:
      return FlightMode::kStabilized;
    default:
      return FlightMode::kAuto;
  }
}

}  // namespace atmos
