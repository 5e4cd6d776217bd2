// Numbers of PX4 and of the common dialect that link and emulator share.
#pragma once

#include "atmos_px4_bridge/mavlink/messages.h"
#include "atmos_px4_bridge/px4_modes.h"

namespace atmos::mavlink {

inline constexpr u8 kTypeOnboardController = 18, kTypeSpacecraft = 45;
inline constexpr u8 kAutopilotInvalid = 8, kAutopilotPx4 = 12;
inline constexpr u8 kStateActive = 4, kStateStandby = 3;
inline constexpr u8 kFlagArmed = 0x80, kFlagCustomMode = 0x01;
inline constexpr u8 kComponentAutopilot = 1, kComponentOnboardComputer = 191;

inline constexpr u16 kCommandActuatorTest = 310, kCommandMessageInterval = 511;

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

}  // namespace atmos::mavlink
