#include "atmos_model/predictor.h"

#include <algorithm>
#include <cmath>

#include "atmos_model/rigid_body.h"

namespace atmos {

namespace {

// [x, y, yaw, vx, vy, yaw rate, hidden...] as one vector, as the integrator wants it.
VecX<double> pack(const PlantState& state) {
  VecX<double> x(6 + state.hidden.size());
  x << state.body.p_WC, state.body.yaw, state.body.v_WC, state.body.yaw_rate, state.hidden;
  return x;
}

PlanarState<double> body_of(const VecX<double>& x) { return {x.segment<2>(0), x[2], x.segment<2>(3), x[5]}; }

}  // namespace

void advance(const Plant& plant, const ValveSchedule& valves, double until_s, PlantState& state,
             double max_step_s) {
  VecX<double> openings(plant.thruster_count());
  max_step_s = std::min(max_step_s, plant.max_step_s());
  const std::vector<double>& jumps = plant.edges();
  while (state.time_s < until_s) {
    const double t = state.time_s;
    double end = std::min(until_s, valves.next_edge(t));
    const auto jump = std::upper_bound(jumps.begin(), jumps.end(), t);
    if (jump != jumps.end()) end = std::min(end, *jump);
    valves.openings(t, openings.data());

    const int steps = std::max(1, static_cast<int>(std::ceil((end - t) / max_step_s - 1e-9)));
    const double dt = (end - t) / steps;
    const double before_end = std::nextafter(end, t);
    VecX<double> x = pack(state);
    for (int k = 0; k < steps; ++k) {
      const double step_start = t + k * dt;
      int stage = 0;
      x = rk4_step(x, dt, [&](const VecX<double>& at) {
        // The classical scheme evaluates at t, twice at t + dt/2, and at t + dt: there just before the jump
        // that may lie at the end.
        const double offset = stage == 0 ? 0.0 : stage < 3 ? 0.5 * dt : dt;
        const double now = std::min(step_start + offset, before_end);
        ++stage;
        const PlanarState<double> body = body_of(at);
        const PlantRate<double> rate = plant.rate<double>(now, body, at.tail(at.size() - 6), openings);
        VecX<double> derivative(at.size());
        derivative << body.v_WC, body.yaw_rate, rate.body.a_WC, rate.body.yaw_acceleration, rate.hidden;
        return derivative;
      });
    }
    state.time_s = end;
    state.body = body_of(x);
    state.hidden = x.tail(x.size() - 6);
  }
}

}  // namespace atmos
