// Numbers of PX4 and of the common dialect that link and emulator share.
#pragma once

#include "atmos_px4_bridge/autopilot_link.h"
#include "atmos_px4_bridge/mavlink/messages.h"

namespace atmos::mavlink {

inline constexpr u8 kTypeOnboardController = 18, kTypeSpacecraft = 45;
inline constexpr u8 kAutopilotInvalid = 8, kAutopilotPx4 = 12;
inline constexpr u8 kStateActive = 4, kStateStandby = 3;
inline constexpr u8 kFlagArmed = 0x80, kFlagCustomMode = 0x01;
inline constexpr u8 kComponentAutopilot = 1, kComponentOnboardComputer = 191;

inline constexpr u16 kCommandSetMode = 176, kCommandActuatorTest = 310, kCommandArm = 400,
                     kCommandMessageInterval = 511;
inline constexpr float kForceMagic =
    21196.0f;  // param2 of kCommandArm: arm or disarm whatever the checks say
inline constexpr u8 kResultAccepted = 0, kResultTemporarilyRejected = 1, kResultDenied = 2,
                    kResultUnsupported = 3;

// Type masks.
inline constexpr u8 kIgnoreBodyRates = 7, kIgnoreYawRate = 4, kThrustBodySet = 32, kIgnoreThrottle = 64,
                    kIgnoreAttitude = 128;
inline constexpr u16 kIgnorePosition = 1, kIgnoreVelocity = 8, kIgnoreAcceleration = 64 + 128 + 256,
                     kIgnoreYaw = 1024, kIgnoreYawSpeed = 2048;

inline constexpr u8 kFrameLocalNed = 1, kFrameBodyFrd = 12;
inline constexpr u8 kEstimatorVision = 2;
inline constexpr u8 kGroupThrusters = 0,
                    kGroupWrench = 1;  // of SET_ACTUATOR_CONTROL_TARGET, patched firmware
inline constexpr u8 kParameterInt32 = 6, kParameterReal32 = 9;

// A thruster's output of a period that it is open throughout: 10 us ticks of a PWM of 10 Hz.
inline constexpr double kTicksPerPeriod = 10000.0;

// custom_mode of HEARTBEAT: main mode in bits 16 to 23. Numbers of PX4's main modes.
constexpr u8 main_mode(FlightMode mode) {
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

constexpr FlightMode mode_of(u8 main) {
  return main >= 1 && main <= 7 ? static_cast<FlightMode>(main) : FlightMode::kUnknown;
}
static_assert(mode_of(main_mode(FlightMode::kOffboard)) == FlightMode::kOffboard);
static_assert(mode_of(main_mode(FlightMode::kStabilized)) == FlightMode::kStabilized);

}  // namespace atmos::mavlink
