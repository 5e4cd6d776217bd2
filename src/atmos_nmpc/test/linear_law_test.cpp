#include "atmos_nmpc/linear_law.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <string>

namespace atmos {
namespace {

class Baselines : public ::testing::Test {
 protected:
  ControllerConfig config(const std::string& name) const {
    return load_controller(ATMOS_CONFIG_DIR "/controller/" + name + ".yaml", vehicle_);
  }
  ControlTask task(double yaw) const {
    ControlTask task;
    task.x0[state13::kQuaternion] = std::cos(0.5 * yaw);
    task.x0[state13::kQuaternion + 3] = std::sin(0.5 * yaw);
    task.reference = {at_rest({0, 0, 0}, task.x0.segment<4>(state13::kQuaternion))};
    task.disturbance = {{}};
    return task;
  }
  BodyWrench answer(LinearLaw& law, const ControlTask& task) const {
    EXPECT_EQ(law.solve(task).status, SolverStatus::kSolved);
    ActuatorInput input;
    law.input(0, input);
    return input.wrench;
  }
  const Vehicle vehicle_ = load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml");
};

TEST_F(Baselines, PdIsItsGainsInBodyAxes) {
  LinearLaw law(vehicle_, config("pd"));
  ControlTask at = task(M_PI / 2.0);
  at.x0[state13::kPosition] = 0.2;       // world x is body -y
  at.x0[state13::kVelocity + 1] = 0.05;  // world y is body x
  at.x0[state13::kAngularVelocity + 2] = 0.1;
  const BodyWrench wrench = answer(law, at);
  EXPECT_NEAR(wrench[0], -8.0 * 0.05, 1e-12);
  EXPECT_NEAR(wrench[1], 1.5 * 0.2, 1e-12);
  EXPECT_NEAR(wrench[2], -0.5 * 0.1, 1e-12);
}

TEST_F(Baselines, WrenchStaysInItsBoundsAndSaysSo) {
  for (const char* name : {"pd", "lqr"}) {
    LinearLaw law(vehicle_, config(name));
    ControlTask far = task(0.3);
    far.x0.head<2>() << 50.0, -50.0;
    const BodyWrench wrench = answer(law, far);
    EXPECT_DOUBLE_EQ(wrench.head<2>().cwiseAbs().maxCoeff(), 1.5) << name;
    EXPECT_GE(law.active_bounds().inputs, 1) << name;
    EXPECT_EQ(law.stages(), 1);
  }
}

TEST_F(Baselines, LqrGainStabilisesEveryAxis) {
  const LinearGain gain = linear_gain(vehicle_, config("lqr"));
  for (int axis = 0; axis < 3; ++axis) {
    const double response = axis < 2 ? 1.0 / vehicle_.mass_kg : 1.0 / vehicle_.inertia_kg_m2.z();
    Eigen::Matrix2d closed;
    closed << 1.0 - 0.005 * response * gain(axis, axis), 0.1 - 0.005 * response * gain(axis, axis + 3),
        -0.1 * response * gain(axis, axis), 1.0 - 0.1 * response * gain(axis, axis + 3);
    EXPECT_LT(closed.eigenvalues().cwiseAbs().maxCoeff(), 0.98) << axis;
  }
}

TEST_F(Baselines, DisturbanceIsHeldAgainst) {
  LinearLaw law(vehicle_, config("pd"));
  ControlTask at = task(0.0);
  at.disturbance = {{{0.02, 0.0, 0.0}, {0.0, 0.0, 0.1}}};
  const BodyWrench wrench = answer(law, at);
  EXPECT_NEAR(wrench[0], -0.02 * vehicle_.mass_kg, 1e-12);
  EXPECT_NEAR(wrench[2], -0.1 * vehicle_.inertia_kg_m2.z(), 1e-12);
}

}  // namespace
}  // namespace atmos
