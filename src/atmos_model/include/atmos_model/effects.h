// The registry of effects: the one place that lists them, in the order in which they compose
// (docs/effects.md).
#pragma once

#include <string>
#include <variant>
#include <vector>

#include "atmos_model/effects/airflow.h"
#include "atmos_model/effects/clock_skew.h"
#include "atmos_model/effects/com_offset.h"
#include "atmos_model/effects/command_delay.h"
#include "atmos_model/effects/coulomb_friction.h"
#include "atmos_model/effects/external_impulse.h"
#include "atmos_model/effects/floor_tilt.h"
#include "atmos_model/effects/floor_unevenness.h"
#include "atmos_model/effects/floor_vibration.h"
#include "atmos_model/effects/friction_patch.h"
#include "atmos_model/effects/inertia_error.h"
#include "atmos_model/effects/marker_offset.h"
#include "atmos_model/effects/mass_depletion.h"
#include "atmos_model/effects/mass_error.h"
#include "atmos_model/effects/mocap_latency.h"
#include "atmos_model/effects/pressure_decay.h"
#include "atmos_model/effects/quadratic_drag.h"
#include "atmos_model/effects/slosh.h"
#include "atmos_model/effects/supply_coupling.h"
#include "atmos_model/effects/supply_droop.h"
#include "atmos_model/effects/tether.h"
#include "atmos_model/effects/thrust_rise.h"
#include "atmos_model/effects/thrust_scale.h"
#include "atmos_model/effects/thruster_dead.h"
#include "atmos_model/effects/thruster_efficiency.h"
#include "atmos_model/effects/thruster_leak.h"
#include "atmos_model/effects/thruster_misalignment.h"
#include "atmos_model/effects/unmodelled.h"
#include "atmos_model/effects/valve_delay.h"
#include "atmos_model/effects/viscous_drag.h"
#include "atmos_model/effects/yaw_misalignment.h"

namespace atmos {

// In table order: effects of a list are applied in this order however a file lists them.
using Effect =
    std::variant<ThrustScale, ThrusterEfficiency, ThrusterDead, CommandDelay, ValveDelay, ThrustRise,
                 SupplyCoupling, SupplyDroop, PressureDecay, ThrusterLeak, ThrusterMisalignment, MassError,
                 InertiaError, MassDepletion, ComOffset, Slosh, FloorTilt, FloorUnevenness, Airflow, Tether,
                 ViscousDrag, QuadraticDrag, CoulombFriction, FrictionPatch, ExternalImpulse, FloorVibration,
                 MocapLatency, MarkerOffset, YawMisalignment, ClockSkew, Unmodelled>;

struct EffectInfo {
  std::string kind;
  std::string equation;
  std::vector<ParameterInfo> parameters;
};

// Every registered kind, in table order, with its equation and parameters.
const std::vector<EffectInfo>& registered_effects();
// "supply_coupling".
std::string kind_of(const Effect& effect);

// Reads `effects:` of an open scenario or model file (absent: none); faults are recorded in the file. The
// result is in table order. A kind may stand more than once only where it names a thruster or a place.
std::vector<Effect> read_effects(const ConfigMap& root);
// Reads a model.yaml. Throws ConfigError with every fault.
std::vector<Effect> load_model(const std::string& path);
// The text of a model.yaml that load_model reads back to the same effects.
std::string write_model(const std::vector<Effect>& effects);

}  // namespace atmos
