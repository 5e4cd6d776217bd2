#include "ode_body.h"

#include <cstdarg>
#include <cstdio>
#include <stdexcept>
#include <string>

namespace atmos {

namespace {

// ODE's handlers are process-wide and get no context: what the last step of this thread reported is left
// here.
thread_local std::string ode_report;

void take_report(int number, const char* text, va_list arguments) {
  char line[256];
  std::vsnprintf(line, sizeof line, text, arguments);
  ode_report = "ODE message " + std::to_string(number) + ": " + line;
}

// ODE ends the process when this returns, so it must not.
[[noreturn]] void refuse(int number, const char* text, va_list arguments) {
  take_report(number, text, arguments);
  throw std::runtime_error(ode_report);
}

struct OdeLibrary {
  OdeLibrary() {
    dInitODE2(0);
    dSetMessageHandler(take_report);
    dSetErrorHandler(refuse);
    dSetDebugHandler(refuse);
  }
  ~OdeLibrary() { dCloseODE(); }
};

void place(dBodyID body, const PlanarState<double>& state) {
  dBodySetPosition(body, state.p_WC.x(), state.p_WC.y(), 0.0);
  const dQuaternion q = {std::cos(0.5 * state.yaw), 0.0, 0.0, std::sin(0.5 * state.yaw)};
  dBodySetQuaternion(body, q);
}

}  // namespace

Simulation::OdeBody::OdeBody(double mass_kg, double inertia_kg_m2, const PlanarState<double>& state)
    : inertia_kg_m2_(inertia_kg_m2) {
  static const OdeLibrary library;
  dAllocateODEDataForThread(dAllocateMaskAll);
  world_ = dWorldCreate();
  // Worlds that share ODE's default threading abort when two threads step them.
  threading_ = dThreadingAllocateSelfThreadedImplementation();
  dWorldSetStepThreadingImplementation(world_, dThreadingImplementationGetFunctions(threading_), threading_);
  body_ = dBodyCreate(world_);
  set_mass(mass_kg);
  dJointAttach(dJointCreatePlane2D(world_, nullptr), body_, nullptr);
  set_state(state);
}

void Simulation::OdeBody::set_state(const PlanarState<double>& state) {
  place(body_, state);
  dBodySetLinearVel(body_, state.v_WC.x(), state.v_WC.y(), 0.0);
  dBodySetAngularVel(body_, 0.0, 0.0, state.yaw_rate);
}

Simulation::OdeBody::~OdeBody() {
  dWorldDestroy(world_);
  dThreadingFreeImplementation(threading_);
}

void Simulation::OdeBody::set_mass(double mass_kg) {
  mass_kg_ = mass_kg;
  dMass mass;
  dMassSetParameters(&mass, mass_kg, 0.0, 0.0, 0.0, inertia_kg_m2_, inertia_kg_m2_, inertia_kg_m2_, 0.0, 0.0,
                     0.0);
  dBodySetMass(body_, &mass);
}

void Simulation::OdeBody::step(const PlanarAcceleration<double>& acceleration, double dt,
                               PlanarState<double>& state) {
  const Vec2<double> force = mass_kg_ * acceleration.a_WC;
  dBodyAddForce(body_, force.x(), force.y(), 0.0);
  dBodyAddTorque(body_, 0.0, 0.0, inertia_kg_m2_ * acceleration.yaw_acceleration);
  ode_report.clear();
  dWorldStep(world_, dt);
  if (!ode_report.empty()) throw std::runtime_error(ode_report);

  // ODE moves the body with the new velocity over the whole step (semi-implicit Euler). Half of the change of
  // velocity taken back makes it the trapezoid, exact under a constant force.
  const dReal* p = dBodyGetPosition(body_);
  const dReal* v = dBodyGetLinearVel(body_);
  const Vec2<double> v_new(v[0], v[1]);
  const double yaw_rate_new = dBodyGetAngularVel(body_)[2];
  state.p_WC = Vec2<double>(p[0], p[1]) - 0.5 * dt * (v_new - state.v_WC);
  state.yaw += 0.5 * dt * (state.yaw_rate + yaw_rate_new);
  state.v_WC = v_new;
  state.yaw_rate = yaw_rate_new;
  place(body_, state);
}

}  // namespace atmos
