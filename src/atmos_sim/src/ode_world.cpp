#include "ode_world.h"

#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <stdexcept>
#include <string>

namespace atmos {

namespace {

constexpr double kObstacleHeight = 2.0;      // m: only their section at z = 0 is touched
constexpr double kLeastBounceSpeed = 5e-3;   // m/s: slower contacts do not bounce
constexpr double kErrorReduction = 0.1;      // share of a penetration that is pushed out per step
constexpr double kConstraintMixing = 1e-10;  // keeps contacts that share a body solvable

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
  dBodySetLinearVel(body, state.v_WC.x(), state.v_WC.y(), 0.0);
  dBodySetAngularVel(body, 0.0, 0.0, state.yaw_rate);
}

}  // namespace

OdeWorld::OdeWorld(const WorldSettings& settings, const std::vector<Robot>& robots) : settings_(settings) {
  static const OdeLibrary library;
  dAllocateODEDataForThread(dAllocateMaskAll);
  world_ = dWorldCreate();
  dWorldSetERP(world_, kErrorReduction);
  dWorldSetCFM(world_, kConstraintMixing);
  // Worlds that share ODE's default threading abort when two threads step them.
  threading_ = dThreadingAllocateSelfThreadedImplementation();
  dWorldSetStepThreadingImplementation(world_, dThreadingImplementationGetFunctions(threading_), threading_);
  joints_ = dJointGroupCreate(0);

  const bool empty = !settings.walls && settings.boxes.empty() && settings.cylinders.empty();
  if (!empty || robots.size() > 1) space_ = dSimpleSpaceCreate(nullptr);
  if (settings.walls) {
    const Eigen::Vector2d &low = settings.walls->min_m, &high = settings.walls->max_m;
    dCreatePlane(space_, 1.0, 0.0, 0.0, low.x());
    dCreatePlane(space_, 0.0, 1.0, 0.0, low.y());
    dCreatePlane(space_, -1.0, 0.0, 0.0, -high.x());
    dCreatePlane(space_, 0.0, -1.0, 0.0, -high.y());
  }
  for (const Box& box : settings.boxes) {
    const dGeomID geom = dCreateBox(space_, box.size_m.x(), box.size_m.y(), kObstacleHeight);
    dGeomSetPosition(geom, box.center_m.x(), box.center_m.y(), 0.0);
    const dQuaternion q = {std::cos(0.5 * box.yaw_rad), 0.0, 0.0, std::sin(0.5 * box.yaw_rad)};
    dGeomSetQuaternion(geom, q);
  }
  for (const Cylinder& cylinder : settings.cylinders)
    dGeomSetPosition(dCreateSphere(space_, cylinder.radius_m), cylinder.center_m.x(), cylinder.center_m.y(),
                     0.0);
  for (const Robot& robot : robots) add_robot(robot);
}

OdeWorld::~OdeWorld() {
  dJointGroupDestroy(joints_);
  if (space_ != nullptr) dSpaceDestroy(space_);
  dWorldDestroy(world_);
  dThreadingFreeImplementation(threading_);
}

void OdeWorld::add_robot(const Robot& robot) {
  const dBodyID body = dBodyCreate(world_);
  bodies_.push_back({body, 0.0, robot.plant().properties().inertia_kg_m2});
  set_mass(bodies_.size() - 1, robot.mass_kg());
  dJointAttach(dJointCreatePlane2D(world_, nullptr), body, nullptr);
  place(body, robot.center_of_mass());
  if (space_ == nullptr) return;
  const dGeomID geom = dCreateSphere(space_, robot.vehicle().radius_m);
  dGeomSetBody(geom, body);
  const Eigen::Vector2d& com_B = robot.plant().properties().com_B;
  dGeomSetOffsetPosition(geom, -com_B.x(), -com_B.y(), 0.0);
}

void OdeWorld::set_mass(std::size_t robot, double mass_kg) {
  Body& body = bodies_[robot];
  if (body.mass_kg == mass_kg) return;
  body.mass_kg = mass_kg;
  dMass mass;
  dMassSetParameters(&mass, mass_kg, 0.0, 0.0, 0.0, body.inertia_kg_m2, body.inertia_kg_m2,
                     body.inertia_kg_m2, 0.0, 0.0, 0.0);
  dBodySetMass(body.id, &mass);
}

void OdeWorld::collide(dGeomID a, dGeomID b) {
  const dBodyID body_a = dGeomGetBody(a), body_b = dGeomGetBody(b);
  if (body_a == nullptr && body_b == nullptr) return;
  dContact contact{};
  if (dCollide(a, b, 1, &contact.geom, sizeof(dContact)) == 0) return;
  contact.surface.mode = dContactBounce | dContactApprox1;
  contact.surface.mu = settings_.friction;
  contact.surface.bounce = settings_.restitution;
  contact.surface.bounce_vel = kLeastBounceSpeed;
  dJointAttach(dJointCreateContact(world_, joints_, &contact), body_a, body_b);
  for (Body& body : bodies_) body.touched |= body.id == body_a || body.id == body_b;
  ++contacts_;
}

void OdeWorld::step(const std::vector<PlanarState<double>>& before, double dt, std::vector<Robot>& robots) {
  for (std::size_t i = 0; i < robots.size(); ++i) {
    Body& body = bodies_[i];
    body.touched = false;
    const PlanarState<double>& free = robots[i].center_of_mass();
    place(body.id, before[i]);
    const Vec2<double> force = body.mass_kg / dt * (free.v_WC - before[i].v_WC);
    dBodyAddForce(body.id, force.x(), force.y(), 0.0);
    dBodyAddTorque(body.id, 0.0, 0.0, body.inertia_kg_m2 / dt * (free.yaw_rate - before[i].yaw_rate));
  }
  ode_report.clear();
  if (space_ != nullptr) {
    dSpaceCollide(space_, this,
                  [](void* world, dGeomID a, dGeomID b) { static_cast<OdeWorld*>(world)->collide(a, b); });
  }
  dWorldStep(world_, dt);
  dJointGroupEmpty(joints_);
  if (!ode_report.empty()) throw std::runtime_error(ode_report);

  for (std::size_t i = 0; i < robots.size(); ++i) {
    PlanarState<double> state = robots[i].center_of_mass();
    const dReal* v = dBodyGetLinearVel(bodies_[i].id);
    const Vec2<double> v_new(v[0], v[1]);
    const double yaw_rate_new = dBodyGetAngularVel(bodies_[i].id)[2];
    if (bodies_[i].touched) {
      state.p_WC += dt * (v_new - state.v_WC);
      state.yaw += dt * (yaw_rate_new - state.yaw_rate);
    }
    state.v_WC = v_new;
    state.yaw_rate = yaw_rate_new;
    robots[i].settle(state);
  }
}

}  // namespace atmos
