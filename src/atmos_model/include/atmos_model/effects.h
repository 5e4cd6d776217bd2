// The registry of effects: the one place that lists them, in the order in which they compose
// (docs/effects.md).
#pragma once

#include <string>
#include <variant>
#include <vector>

#include "atmos_model/effects/airflow.h"
#include "atmos_model/effects/bearing_down.h"
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
#include "atmos_model/effects/thruster_leak_since.h"
#include "atmos_model/effects/thruster_misalignment.h"
#include "atmos_model/effects/thruster_stuck_open.h"
#include "atmos_model/effects/thruster_weak_since.h"
#include "atmos_model/effects/unmodelled.h"
#include "atmos_model/effects/valve_delay.h"
#include "atmos_model/effects/viscous_drag.h"
#include "atmos_model/effects/yaw_misalignment.h"

namespace atmos {

// In table order: effects of a list are applied in this order however a file lists them.
using Effect =
    std::variant<ThrustScale, ThrusterEfficiency, ThrusterWeakSince, ThrusterDead, ThrusterStuckOpen,
                 CommandDelay, ValveDelay, ThrustRise, SupplyCoupling, SupplyDroop, PressureDecay,
                 ThrusterLeak, ThrusterLeakSince, ThrusterMisalignment, MassError, InertiaError,
                 MassDepletion, ComOffset, Slosh, FloorTilt, FloorUnevenness, Airflow, Tether, ViscousDrag,
                 QuadraticDrag, CoulombFriction, FrictionPatch, BearingDown, ExternalImpulse, FloorVibration,
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
// The thruster that an effect is about, counted from 1; 0: none.
int thruster_of(const Effect& effect);
// Makes it about another one; without effect where it is about none.
void set_thruster(Effect& effect, int thruster);

// Why an effect cannot act on a vehicle (a thruster it does not have, more sloshing mass than there is), as a
// rule; empty when it can.
std::string misfit(const Effect& effect, const Vehicle& vehicle);

// Reads `effects:` of an open scenario or model file (absent: none) for a vehicle; faults are recorded in the
// file. Without a vehicle, what depends on it is left to the Plant. The result is in table order. A kind may
// stand more than once only where it names a thruster, each time another one, or a place.
std::vector<Effect> read_effects(const ConfigMap& root, const Vehicle* vehicle);
// Reads a model.yaml for a vehicle. Throws ConfigError with every fault.
std::vector<Effect> load_model(const std::string& path, const Vehicle& vehicle);
// The text of a model.yaml that load_model reads back to the same effects.
std::string write_model(const std::vector<Effect>& effects);

}  // namespace atmos
