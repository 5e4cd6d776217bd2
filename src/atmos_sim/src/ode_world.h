// Robots, walls and obstacles in an ODE world of their own. Seen from above an upright cylinder is a circle,
// so that spheres at floor height collide as the robots do, with one contact point and an exact normal.
#pragma once

#include <ode/ode.h>

#include <cstdint>
#include <vector>

#include "atmos_model/scenario.h"
#include "atmos_sim/robot.h"

namespace atmos {

class OdeWorld {
 public:
  OdeWorld(const WorldSettings& settings, const std::vector<Robot>& robots);
  ~OdeWorld();
  OdeWorld(const OdeWorld&) = delete;
  OdeWorld& operator=(const OdeWorld&) = delete;

  void set_mass(std::size_t robot, double mass_kg);
  // One step of all bodies: from `before` they have moved freely to where `robots` are; their contacts are
  // added. Throws std::runtime_error when ODE reports a fault.
  void step(const std::vector<PlanarState<double>>& before, double dt, std::vector<Robot>& robots);

  std::uint64_t contacts() const { return contacts_; }

 private:
  struct Body {
    dBodyID id;
    double mass_kg;
    double inertia_kg_m2;
    bool touched = false;  // in this step
  };

  void add_robot(const Robot& robot);
  void collide(dGeomID a, dGeomID b);

  WorldSettings settings_;
  dThreadingImplementationID threading_;
  dWorldID world_;
  dSpaceID space_ = nullptr;  // none: nothing to bump into
  dJointGroupID joints_;
  std::vector<Body> bodies_;
  std::uint64_t contacts_ = 0;
};

}  // namespace atmos
