#include "atmos_nmpc/prediction.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace atmos {

State13<double> predict(const Vehicle& vehicle, const AllocationMatrices& thrusters,
                        const ValveSchedule& valves, State13<double> x, double from_s, double until_s) {
  if (until_s <= from_s) return x;
  constexpr double kMaxStep = 0.02;
  Openings force(valves.valve_count());
  double t = from_s;
  while (t < until_s) {
    const double end = std::min(until_s, valves.next_edge(t));
    valves.openings(t, force.data());
    for (Eigen::Index i = 0; i < force.size(); ++i)
      force[i] *= vehicle.thrusters[static_cast<std::size_t>(i)].force_n;
    const Vec3<double> force_B = thrusters.D * force;
    const Vec3<double> torque_B = thrusters.L * force;
    const int steps = std::max(1, static_cast<int>(std::ceil((end - t) / kMaxStep - 1e-9)));
    for (int k = 0; k < steps; ++k) {
      x = rk4_step(x, (end - t) / steps, [&](const State13<double>& at) {
        return rigid_body_rate<double>(at, force_B, torque_B, vehicle.mass_kg, vehicle.inertia_kg_m2);
      });
    }
    t = end;
  }
  x.segment<4>(state13::kQuaternion).normalize();
  return x;
}

}  // namespace atmos
