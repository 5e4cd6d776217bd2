#include "atmos_model/predictor.h"

#include <algorithm>
#include <cmath>

namespace atmos {

namespace {

// Longest step, as a share of the shortest time scale of an effect: a first-order lag is then right to 1e-5.
constexpr double kStepOfTimeScale = 0.25;

// Classical Runge-Kutta steps of everything that moves, in storage that is used for every step.
class Integrator {
 public:
  Integrator(const Plant& plant, const PlantState& start) : plant_(plant), at_(start) {
    openings.resize(plant.thruster_count());
  }

  VecX<double> openings;

  // One step of `dt` from t. Forces may jump at its end: the last stage looks just before `before_end`.
  void step(double t, double dt, double before_end, PlantState& state) {
    evaluate(t, state, rate_[0]);
    offset(state, rate_[0], 0.5 * dt);
    evaluate(std::min(t + 0.5 * dt, before_end), at_, rate_[1]);
    offset(state, rate_[1], 0.5 * dt);
    evaluate(std::min(t + 0.5 * dt, before_end), at_, rate_[2]);
    offset(state, rate_[2], dt);
    evaluate(std::min(t + dt, before_end), at_, rate_[3]);
    for (int k = 0; k < 4; ++k) add(state, rate_[k], dt * (k == 0 || k == 3 ? 1.0 : 2.0) / 6.0);
  }

 private:
  struct Rate {
    Vec2<double> v_WC;
    double yaw_rate;
    PlantRate<double> plant;
  };

  void evaluate(double t, const PlantState& state, Rate& rate) {
    rate.v_WC = state.body.v_WC;
    rate.yaw_rate = state.body.yaw_rate;
    plant_.rate(t, state.body, state.hidden, openings, rate.plant);
  }
  void offset(const PlantState& from, const Rate& rate, double dt) {
    at_.body = from.body;
    at_.hidden = from.hidden;
    add(at_, rate, dt);
  }
  static void add(PlantState& state, const Rate& rate, double dt) {
    state.body.p_WC += dt * rate.v_WC;
    state.body.yaw += dt * rate.yaw_rate;
    state.body.v_WC += dt * rate.plant.body.a_WC;
    state.body.yaw_rate += dt * rate.plant.body.yaw_acceleration;
    state.hidden += dt * rate.plant.hidden;
  }

  const Plant& plant_;
  PlantState at_;
  Rate rate_[4];
};

}  // namespace

void advance(const Plant& plant, const ValveSchedule& valves, double until_s, PlantState& state,
             double max_step_s) {
  max_step_s = std::min(max_step_s, kStepOfTimeScale * plant.max_step_s());
  const std::vector<double>& jumps = plant.edges();
  Integrator integrator(plant, state);
  while (state.time_s < until_s) {
    const double t = state.time_s;
    double end = std::min(until_s, valves.next_edge(t));
    const auto jump = std::upper_bound(jumps.begin(), jumps.end(), t);
    if (jump != jumps.end()) end = std::min(end, *jump);
    valves.openings(t, integrator.openings.data());

    const int steps = std::max(1, static_cast<int>(std::ceil((end - t) / max_step_s - 1e-9)));
    const double dt = (end - t) / steps;
    for (int k = 0; k < steps; ++k) integrator.step(t + k * dt, dt, std::nextafter(end, t), state);
    state.time_s = end;
  }
}

}  // namespace atmos
