#include "atmos_sim2real/report.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>

#include "atmos_sim2real/statement.h"

namespace atmos {

namespace {

using json = nlohmann::ordered_json;

// Not-a-number and infinity have no place in JSON.
json finite(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }

json events_of(const std::vector<ImpulseEvent>& events) {
  json list = json::array();
  for (const ImpulseEvent& event : events) {
    list.push_back({{"time_s", event.time_s},
                    {"impulse_x_n_s", event.impulse_n_s.x()},
                    {"impulse_y_n_s", event.impulse_n_s.y()},
                    {"impulse_yaw_n_m_s", event.impulse_yaw_n_m_s}});
  }
  return list;
}

// {value, std, unit} of each parameter. Only single numbers that were fitted have a standard deviation.
struct ParameterReport {
  const Fit& fit;
  std::size_t effect;
  json& parameters;

  json deviation(const std::string& name, std::size_t element = 0) const {
    for (std::size_t p = 0; p < fit.free.size(); ++p) {
      const auto at = static_cast<Eigen::Index>(p);
      if (fit.free[p].effect == effect && fit.free[p].name == name && fit.free[p].element == element &&
          at < fit.covariance.rows())
        return finite(std::sqrt(fit.covariance(at, at)));
    }
    return nullptr;
  }
  void operator()(const ParameterInfo& info, double value) const {
    parameters[info.name] = {{"value", value}, {"std", deviation(info.name)}, {"unit", info.unit}};
  }
  void operator()(const ParameterInfo& info, const std::vector<ImpulseEvent>& events) const {
    parameters[info.name] = {{"value", events_of(events)}, {"std", nullptr}, {"unit", info.unit}};
  }
  void operator()(const ParameterInfo& info,
                  const std::map<std::string, Unmodelled::Coefficient>& coefficients) const {
    json values = json::object(), deviations = json::object();
    std::size_t element = 0;
    for (const auto& [name, c] : coefficients) {
      values[name] = {{"value", c.value}, {"unit", c.unit}};
      deviations[name] = deviation(info.name, element++);
    }
    parameters[info.name] = {{"value", values}, {"std", deviations}, {"unit", info.unit}};
  }
  template <class Other>
  void operator()(const ParameterInfo& info, const Other& value) const {
    parameters[info.name] = {{"value", value}, {"std", nullptr}, {"unit", info.unit}};
  }
};

json parameters_of(const Fit& fit, std::size_t effect) {
  json parameters = json::object();
  std::visit(
      [&](const auto& e) {
        e.parameters(e, ParameterReport{fit, effect, parameters});
      },
      fit.effects[effect]);
  return parameters;
}

// Indices of the final model's effects in table order, in which model.yaml lists them.
std::vector<std::size_t> table_order(const std::vector<Effect>& effects) {
  std::vector<std::size_t> order(effects.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return effects[a].index() < effects[b].index(); });
  return order;
}

json placebo_of(const Placebo& placebo) {
  const auto nats = [](const std::optional<double>& gain) { return gain ? finite(*gain) : json(nullptr); };
  return {{"as_claimed_nats", finite(placebo.as_claimed)},
          {"shuffled_commands_nats", nats(placebo.shuffled_commands)},
          {"wrong_thruster_nats", nats(placebo.wrong_thruster)},
          {"wrong_thruster", placebo.wrong_thruster ? json(placebo.best_wrong_thruster) : json(nullptr)}};
}

json effects_of(const Diagnosis& diagnosis, const std::vector<Began>& recordings) {
  const Fit& final = diagnosis.search.final;
  json effects = json::array();
  for (const std::size_t i : table_order(final.effects)) {
    const Claim& claim = diagnosis.search.claims.at(i);
    const std::string kind = kind_of(final.effects[i]);
    const std::vector<std::string>& same = diagnosis.indistinguishable.at(i);
    std::string next;
    for (const std::string& rival : same) {
      const std::string advice = experiment_against(kind, rival);
      if (!advice.empty() && next.find(advice) == std::string::npos)
        next += (next.empty() ? "" : " ") + advice;
    }
    json parameters = parameters_of(final, i);
    if (claim.onset_deviation_s > 0.0) parameters["since_s"]["std"] = claim.onset_deviation_s;
    effects.push_back({{"kind", kind},
                       {"statement", statement_of(final.effects[i], recordings, claim.onset_deviation_s)},
                       {"parameters", parameters},
                       {"evidence",
                        {{"log_likelihood_gain", finite(claim.gain)},
                         {"heldout_log_likelihood_gain", finite(claim.heldout_gain)},
                         {"inclusion", finite(claim.inclusion)}}},
                       {"placebo", placebo_of(diagnosis.placebo.at(i))},
                       {"indistinguishable_from", same},
                       {"next_experiment", next}});
  }
  return effects;
}

// What was tried and not claimed: in place of each claim, then beside the final model.
json rivals_of(const Diagnosis& diagnosis, const std::vector<Began>& recordings) {
  constexpr std::size_t kMost = 5;  // per place
  json rivals = json::array();
  const auto add = [&](const std::vector<Tried>& tried, const std::string& against, double reference) {
    std::vector<std::string> seen;
    for (const Tried& rival : tried) {
      const std::string name =
          rival.hypothesis.kind + std::to_string(rival.hypothesis.thruster) + rival.hypothesis.law;
      if (seen.size() == kMost || is_claimed(diagnosis.search.claims, rival.hypothesis) ||
          rival.fit.effects.empty() || std::find(seen.begin(), seen.end(), name) != seen.end())
        continue;
      seen.push_back(name);
      rivals.push_back({{"kind", rival.hypothesis.kind},
                        {"statement", statement_of(rival.fit.effects.back(), recordings)},
                        {"instead_of", against.empty() ? json(nullptr) : json(against)},
                        {"evidence_gain", finite(rival.gain)},
                        {"evidence_gain_of_claim", against.empty() ? json(nullptr) : finite(reference)},
                        {"parameters", parameters_of(rival.fit, rival.fit.effects.size() - 1)}});
    }
  };
  for (const Claim& claim : diagnosis.search.claims)
    add(claim.rivals, claim.hypothesis.kind, claim.rival_reference);
  add(diagnosis.search.rejected, "", 0.0);
  return rivals;
}

json error_of(const PredictionError& error, const PredictionError& nominal) {
  if (nominal.windows == 0)
    return {{"position_rms_m", nullptr}, {"yaw_rms_rad", nullptr}, {"position_fit_percent", nullptr}};
  return {{"position_rms_m", finite(error.position_rms_m)},
          {"yaw_rms_rad", finite(error.yaw_rms_rad)},
          {"position_fit_percent", finite(error.position_fit_percent)}};
}

json horizon_of(const HorizonProof& proof) {
  return {{"horizon_s", proof.horizon_s},
          {"windows", proof.nominal.windows},
          {"nominal", error_of(proof.nominal, proof.nominal)},
          {"fitted", error_of(proof.fitted, proof.nominal)},
          {"noise_floor", error_of(proof.noise_floor, proof.nominal)}};
}

json fit_of(const Proof& proof) {
  json fit = horizon_of(proof.horizons.front());
  fit["on"] = proof.on;
  fit["other_horizons"] = json::array();
  for (std::size_t h = 1; h < proof.horizons.size(); ++h)
    fit["other_horizons"].push_back(horizon_of(proof.horizons[h]));
  return fit;
}

json noise_of(const NoiseModel& noise) {
  return {{"mocap_position_m", noise.mocap[kX]},
          {"mocap_yaw_rad", noise.mocap[kYaw]},
          {"mocap_rough_m", noise.rough[kX]},
          {"mocap_distortion_m", noise.distortion[kX]},
          {"slow_acceleration_m_s2", noise.slow[kX]},
          {"slow_yaw_acceleration_rad_s2", noise.slow[kYaw]},
          {"thrust_scatter", noise.scatter},
          {"thrust_scatters_by", noise.joins_pulses ? "opening" : "command"}};
}

// Error of each row of prediction windows against the poses: [time since the first pose, position error].
json window_errors(const Recording& recording, const std::vector<PredictedPose>& rows) {
  json series = {{"time_s", json::array()}, {"position_m", json::array()}, {"yaw_rad", json::array()}};
  const double begin = recording.poses.front().time_s;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const PredictedPose& row = rows[i];
    if (i > 0 && row.window_start_s != rows[i - 1].window_start_s) {
      for (auto& column : series) column.push_back(nullptr);  // a gap in the line
    }
    const auto pose = std::lower_bound(recording.poses.begin(), recording.poses.end(), row.stamp_s,
                                       [](const PoseSample& p, double t) { return p.time_s < t; });
    if (pose == recording.poses.end() || pose->time_s - row.stamp_s > 0.02) continue;
    series["time_s"].push_back(row.stamp_s - begin);
    series["position_m"].push_back(std::hypot(pose->x_m - row.x_m, pose->y_m - row.y_m));
    series["yaw_rad"].push_back(std::abs(wrap_angle(pose->yaw_rad - row.yaw_rad)));
  }
  return series;
}

// Root mean square of the whitened innovations per second and axis: 1 is what noise alone gives.
json mismatch_over_time(const Flight& flight, const Eigen::VectorXd& innovations) {
  constexpr double kBin = 2.0;  // s
  const Eigen::Index n = innovations.size() / kAxes;
  const double begin = flight.times().front();
  const auto bins = static_cast<std::size_t>((flight.times().back() - begin) / kBin) + 1;
  json axes = json::object();
  const char* const names[kAxes] = {"x", "y", "yaw"};
  for (int axis = 0; axis < kAxes; ++axis) {
    std::vector<double> sum(bins, 0.0), count(bins, 0.0);
    for (Eigen::Index i = 0; i < n; ++i) {
      const double e = innovations[axis * n + i];
      const auto bin = static_cast<std::size_t>((flight.times()[static_cast<std::size_t>(i)] - begin) / kBin);
      sum[bin] += e * e;
      count[bin] += 1.0;
    }
    json values = json::array();
    for (std::size_t b = 0; b < bins; ++b)
      values.push_back(count[b] > 0.0 ? json(std::sqrt(sum[b] / count[b])) : json(nullptr));
    axes[names[axis]] = values;
  }
  return {{"bin_s", kBin}, {"axes", axes}};
}

}  // namespace

std::size_t place_in_report(const Diagnosis& diagnosis, std::size_t claim) {
  const std::vector<std::size_t> order = table_order(diagnosis.search.final.effects);
  return static_cast<std::size_t>(std::find(order.begin(), order.end(), claim) - order.begin());
}

std::vector<Effect> claimed_effects(const Diagnosis& diagnosis) {
  std::vector<Effect> effects;
  for (const std::size_t i : table_order(diagnosis.search.final.effects))
    effects.push_back(diagnosis.search.final.effects[i]);
  return effects;
}

nlohmann::ordered_json report(const Diagnosis& diagnosis, const Problem& problem, const Proof& proof) {
  json where = json::array();
  for (const Place& place : diagnosis.where)
    where.push_back({{"what", place.what},
                     {"statement", place.statement},
                     {"share", finite(place.share)},
                     {"even_share", finite(place.even_share)}});
  json detectable = json::object();
  for (const auto& [kind, smallest] : diagnosis.smallest_detectable) {
    detectable[kind] = {
        {"parameter", smallest.parameter}, {"value", finite(smallest.value)}, {"unit", smallest.unit}};
  }
  json recordings = json::array();
  std::vector<Began> began;
  for (const Flight& flight : *problem.flights) {
    const Recording& recording = flight.recording();
    began.push_back({recording.name, recording.start_s()});
    recordings.push_back({{"name", recording.name},
                          {"start_s", recording.start_s()},
                          {"duration_s", recording.duration_s()},
                          {"poses", recording.poses.size()},
                          {"commands", recording.commands.size()},
                          {"warnings", recording.warnings}});
  }
  return {{"schema", 1},
          {"verdict", text_of(diagnosis.verdict)},
          {"mismatch",
           {{"p_value", finite(diagnosis.p_value)},
            {"axes",
             {{"x", finite(diagnosis.axis_share[kX])},
              {"y", finite(diagnosis.axis_share[kY])},
              {"yaw", finite(diagnosis.axis_share[kYaw])}}},
            {"where", where},
            {"smallest_detectable", detectable}}},
          {"effects", effects_of(diagnosis, began)},
          {"rivals", rivals_of(diagnosis, began)},
          {"unexplained",
           {{"acceleration_rms_m_s2", finite(diagnosis.unexplained_acceleration_rms)},
            {"where", diagnosis.unexplained_where}}},
          {"fit", fit_of(proof)},
          {"noise", noise_of(diagnosis.search.final.noise)},
          {"recordings", recordings}};
}

nlohmann::ordered_json plot_data(const Diagnosis& diagnosis, const Problem& problem, const Proof& proof) {
  const Fit& final = diagnosis.search.final;
  const Fit before = evaluate(problem, diagnosis.search.nominal.effects, {}, final.noise);
  json flights = json::array();
  for (std::size_t f = 0; f < problem.flights->size(); ++f) {
    const Flight& flight = (*problem.flights)[f];
    json time = json::array(), x = json::array(), y = json::array();
    for (std::size_t i = 0; i < flight.frames(); i += 5) {
      time.push_back(flight.times()[i] - flight.times().front());
      x.push_back(flight.poses()[i].x_m);
      y.push_back(flight.poses()[i].y_m);
    }
    flights.push_back({{"name", flight.recording().name},
                       {"time_s", time},
                       {"x_m", x},
                       {"y_m", y},
                       {"nominal", mismatch_over_time(flight, before.innovations[f])},
                       {"fitted", mismatch_over_time(flight, final.innovations[f])}});
  }
  json predicted = json::array();
  for (const PredictedRecording& recording : proof.predicted) {
    predicted.push_back({{"name", recording.recording.name},
                         {"nominal", window_errors(recording.recording, recording.nominal)},
                         {"fitted", window_errors(recording.recording, recording.fitted)}});
  }
  json thrusters = json::array();
  std::vector<Effect> steady = final.effects;  // the bars show thrust once it has risen
  steady.erase(std::remove_if(steady.begin(), steady.end(),
                              [](const Effect& e) { return std::holds_alternative<ThrustRise>(e); }),
               steady.end());
  const Plant nominal = problem.plant({}, 0), plant = problem.plant(steady, 0);
  const double late = problem.flights->front().times().back();
  const auto since = [late](const std::vector<double>& valves, int k) {
    return !valves.empty() && valves[static_cast<std::size_t>(k)] <= late;
  };
  for (int k = 0; k < plant.thruster_count(); ++k) {
    // Of one thruster with the other valves shut.
    const auto force = [&](const Plant& p, bool told_open) {
      const ValveTiming& timing = p.properties().timing;
      VecX<double> alone = VecX<double>::Zero(plant.thruster_count());
      if (!since(timing.dead_since_s, k) && (told_open || since(timing.stuck_open_since_s, k)))
        alone[k] = 1.0;
      return p.thrust<double>(late, PlanarState<double>{}, p.initial_hidden(), alone)[k];
    };
    thrusters.push_back({{"number", k + 1},
                         {"nominal_n", force(nominal, true)},
                         {"fitted_n", force(plant, true)},
                         {"fitted_shut_n", force(plant, false)}});
  }
  return {{"flights", flights}, {"predicted", predicted}, {"thrusters", thrusters}};
}

}  // namespace atmos
