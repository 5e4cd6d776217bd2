// One rigid body in the plane in an ODE world of its own.
#pragma once

#include <ode/ode.h>

#include "atmos_model/planar.h"
#include "atmos_sim/simulation.h"

namespace atmos {

class Simulation::OdeBody {
 public:
  OdeBody(double mass_kg, double inertia_kg_m2, const PlanarState<double>& state);
  ~OdeBody();
  OdeBody(const OdeBody&) = delete;
  OdeBody& operator=(const OdeBody&) = delete;

  void set_mass(double mass_kg);
  void set_state(const PlanarState<double>& state);
  // One step under accelerations [m/s^2, rad/s^2] that are constant over it; `state` is moved along. Throws
  // std::runtime_error when ODE reports a fault.
  void step(const PlanarAcceleration<double>& acceleration, double dt, PlanarState<double>& state);

 private:
  double mass_kg_;
  double inertia_kg_m2_;
  dThreadingImplementationID threading_;
  dWorldID world_;
  dBodyID body_;
};

}  // namespace atmos
