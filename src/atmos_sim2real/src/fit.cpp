#include "atmos_sim2real/fit.h"

#include <sys/mman.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <stdexcept>

#include "atmos_sim2real/floor_map.h"
#include "atmos_sim2real/laws.h"

namespace atmos {

namespace {

// Finds one number inside an effect by its name and element.
struct Finder {
  const FreeParameter& wanted;
  double* found = nullptr;

  void operator()(const ParameterInfo& info, double& value) {
    if (info.name == wanted.name) found = &value;
  }
  void operator()(const ParameterInfo& info, GridRows& rows) {
    if (info.name != wanted.name) return;
    const std::size_t width = rows.front().size();
    found = &rows.at(wanted.element / width).at(wanted.element % width);
  }
  void operator()(const ParameterInfo& info, std::vector<ImpulseEvent>& events) {
    if (info.name != wanted.name) return;
    ImpulseEvent& event = events.at(wanted.element / 4);
    double* const numbers[4] = {&event.time_s, &event.impulse_n_s.x(), &event.impulse_n_s.y(),
                                &event.impulse_yaw_n_m_s};
    found = numbers[wanted.element % 4];
  }
  void operator()(const ParameterInfo& info, std::map<std::string, Unmodelled::Coefficient>& coefficients) {
    if (info.name != wanted.name) return;
    found = &std::next(coefficients.begin(), static_cast<long>(wanted.element))->second.value;
  }
  template <class Other>
  void operator()(const ParameterInfo&, Other&) {}
};

// Sets every number of a map or law to 0; what places the map stays.
struct ZeroNumbers {
  void operator()(const ParameterInfo&, GridRows& rows) const {
    for (auto& row : rows) std::fill(row.begin(), row.end(), 0.0);
  }
  void operator()(const ParameterInfo&, std::map<std::string, Unmodelled::Coefficient>& coefficients) const {
    for (auto& [name, coefficient] : coefficients) coefficient.value = 0.0;
  }
  template <class Other>
  void operator()(const ParameterInfo&, Other&) const {}
};

Bounds bounds_of(const std::vector<Effect>& effects, const FreeParameter& free) {
  Bounds bounds;
  std::visit(
      [&](const auto& e) {
        e.parameters(e, [&](const ParameterInfo& info, const auto&) {
          // The bounds of an event are those of its impulse; when it happened is free.
          const bool event_time =
              std::is_same_v<std::decay_t<decltype(e)>, ExternalImpulse> && free.element % 4 == 0;
          if (info.name == free.name && !event_time) bounds = info.bounds;
        });
      },
      effects[free.effect]);
  bounds.min = std::max(bounds.min, free.least);
  bounds.max = std::min(bounds.max, free.most);
  return bounds;
}

double objective(const Fit& fit) {
  const Eigen::VectorXd away = from_prior_mean(fit.effects, fit.free);
  return fit.log_likelihood - 0.5 * away.dot(prior_precision(fit.free) * away);
}

}  // namespace

double& parameter(std::vector<Effect>& effects, const FreeParameter& free) {
  Finder finder{free};
  std::visit([&](auto& e) { e.parameters(e, finder); }, effects.at(free.effect));
  if (finder.found == nullptr) throw std::logic_error("no parameter " + free.name);
  return *finder.found;
}

double parameter(const std::vector<Effect>& effects, const FreeParameter& free) {
  return parameter(const_cast<std::vector<Effect>&>(effects), free);
}

Eigen::MatrixXd prior_precision(const std::vector<FreeParameter>& free) {
  const auto n = static_cast<Eigen::Index>(free.size());
  Eigen::MatrixXd precision = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index p = 0; p < n; ++p) {
    const FreeParameter& a = free[static_cast<std::size_t>(p)];
    if (a.joint == nullptr) {
      precision(p, p) = 1.0 / (a.prior_width * a.prior_width);
      continue;
    }
    for (Eigen::Index q = 0; q < n; ++q) {
      const FreeParameter& b = free[static_cast<std::size_t>(q)];
      if (b.joint == a.joint && b.name == a.name)
        precision(p, q) =
            (*a.joint)(static_cast<Eigen::Index>(a.element), static_cast<Eigen::Index>(b.element));
    }
  }
  return precision;
}

Eigen::VectorXd from_prior_mean(const std::vector<Effect>& effects, const std::vector<FreeParameter>& free) {
  Eigen::VectorXd away(static_cast<Eigen::Index>(free.size()));
  for (std::size_t p = 0; p < free.size(); ++p)
    away[static_cast<Eigen::Index>(p)] = parameter(effects, free[p]) - free[p].prior_mean;
  return away;
}

double occam_factor(const Eigen::MatrixXd& prior, const Eigen::MatrixXd& posterior,
                    const std::vector<FreeParameter>& free) {
  Eigen::VectorXd width(static_cast<Eigen::Index>(free.size()));  // makes numbers of parameters in any unit
  for (std::size_t p = 0; p < free.size(); ++p) width[static_cast<Eigen::Index>(p)] = free[p].prior_width;
  const auto half_log_determinant = [&](const Eigen::MatrixXd& precision) {
    const Eigen::LLT<Eigen::MatrixXd> factor(width.asDiagonal() * precision * width.asDiagonal());
    return factor.matrixL().toDenseMatrix().diagonal().array().log().sum();
  };
  return half_log_determinant(posterior) - half_log_determinant(prior);
}

void clamp_to_bounds(std::vector<Effect>& effects, const std::vector<FreeParameter>& free) {
  for (const FreeParameter& f : free) {
    const Bounds bounds = bounds_of(effects, f);
    double& value = parameter(effects, f);
    value = std::min(bounds.max, std::max(bounds.min, value));
  }
}

Plant Problem::plant(const std::vector<Effect>& effects, std::size_t flight) const {
  std::vector<Effect> all = known;
  all.insert(all.end(), effects.begin(), effects.end());
  return Plant(*vehicle, std::move(all), (*flights)[flight].recording().start_s());
}

Fit evaluate(const Problem& problem, std::vector<Effect> effects, std::vector<FreeParameter> free,
             const NoiseModel& noise) {
  Fit fit;
  fit.effects = std::move(effects);
  fit.free = std::move(free);
  fit.noise = noise;
  const std::size_t count = problem.flights->size();
  fit.innovations.resize(count);
  std::vector<double> determinants(count);
  in_parallel(count, [&](std::size_t f) {
    const Flight& flight = (*problem.flights)[f];
    const ForceIntegrals forces = flight.integrate(problem.plant(fit.effects, f));
    fit.innovations[f] = innovations(flight, forces, noise, &determinants[f]);
  });
  for (std::size_t f = 0; f < count; ++f)
    fit.log_likelihood += log_likelihood(fit.innovations[f], determinants[f]);
  fit.evidence = fit.log_likelihood;
  return fit;
}

void add_products(const Eigen::Ref<const Eigen::MatrixXd>& rows, Eigen::MatrixXd& sum) {
  constexpr Eigen::Index kTile = 256;  // rows
  const Eigen::Index n = rows.cols();
  std::vector<Eigen::Index> there;
  Eigen::MatrixXd packed, products;
  for (Eigen::Index begin = 0; begin < rows.rows(); begin += kTile) {
    const Eigen::Index size = std::min(kTile, rows.rows() - begin);
    there.clear();
    for (Eigen::Index p = 0; p < n; ++p) {
      if ((rows.col(p).segment(begin, size).array() != 0.0).any()) there.push_back(p);
    }
    const auto k = static_cast<Eigen::Index>(there.size());
    packed.resize(k, size);
    for (Eigen::Index p = 0; p < k; ++p)
      packed.row(p) = rows.col(there[static_cast<std::size_t>(p)]).segment(begin, size).transpose();
    products.setZero(k, k);
    products.selfadjointView<Eigen::Lower>().rankUpdate(packed);
    for (Eigen::Index q = 0; q < k; ++q) {
      for (Eigen::Index p = q; p < k; ++p)
        sum(there[static_cast<std::size_t>(p)], there[static_cast<std::size_t>(q)]) += products(p, q);
    }
  }
  sum.triangularView<Eigen::StrictlyUpper>() = sum.transpose();
}

namespace {

// Uninitialised. Tens of megabytes come and go with every map that is fitted: in large pages that costs
// little.
Eigen::MatrixXd in_large_pages(Eigen::Index rows, Eigen::Index cols) {
  constexpr std::size_t kPage = 2 << 20;
  Eigen::MatrixXd made(rows, cols);
  void* first = made.data();
  std::size_t size = sizeof(double) * static_cast<std::size_t>(made.size());
  if (std::align(kPage, kPage, first, size) != nullptr) madvise(first, size / kPage * kPage, MADV_HUGEPAGE);
  return made;
}

// Effects that decide how a force becomes a measured motion, but push nothing themselves.
bool shapes_response(const Effect& effect) {
  return std::holds_alternative<MassError>(effect) || std::holds_alternative<InertiaError>(effect) ||
         std::holds_alternative<ComOffset>(effect) || std::holds_alternative<MarkerOffset>(effect) ||
         std::holds_alternative<YawMisalignment>(effect) || std::holds_alternative<MocapLatency>(effect) ||
         std::holds_alternative<ClockSkew>(effect);
}

// Of what acts from outside, what changes over the few millimetres of motion between frames not at all, or
// little.
bool acts_slowly(const Effect& effect) {
  if (const Unmodelled* law = std::get_if<Unmodelled>(&effect)) return changes_slowly(*law);
  return acts_from_outside(effect) && !std::holds_alternative<ExternalImpulse>(effect) &&
         !std::holds_alternative<FloorVibration>(effect);
}

// Where the centre of mass must be for one node of a map to push.
Reach reach_of_node(const Effect& map, std::size_t node, const Vehicle& vehicle) {
  const Lattice lattice = lattice_of(map);
  double bearing = 0.0;
  const Plant plant(vehicle, {}, 0.0);
  for (const Eigen::Vector2d& at : plant.properties().bearings_m) bearing = std::max(bearing, at.norm());
  return {lattice.place(node), 2.0 * std::sqrt(2.0) * lattice.grid.spacing_m + bearing + 0.05};
}

// The motion that an effect from outside makes by itself, whitened: needs no thrusters and no valve edges.
Eigen::VectorXd own_motion(const Problem& problem, const Effect& effect, const std::vector<Effect>& others,
                           std::size_t flight_index, const NoiseModel& noise, const Reach* reach = nullptr) {
  const Flight& flight = (*problem.flights)[flight_index];
  Vehicle coasting = *problem.vehicle;
  coasting.thrusters.clear();
  std::vector<Effect> acting;
  for (const std::vector<Effect>* list : {&problem.known, &others}) {
    for (const Effect& other : *list) {
      if (shapes_response(other)) acting.push_back(other);
    }
  }
  const bool slow = acts_slowly(effect);
  acting.push_back(effect);
  const Plant plant(coasting, std::move(acting), flight.recording().start_s());
  ForceIntegrals forces = slow ? flight.integrate_slow(plant, reach) : flight.integrate(plant);
  for (auto& measured : forces.measured) std::fill(measured.begin(), measured.end(), 0.0);
  return innovations(flight, forces, noise);
}

// Sum of J' J over the flights; the axes of a flight are worked on side by side. `known`: the same sum for an
// earlier J, of which all but the columns that have `moved` still holds.
Eigen::MatrixXd information(const std::vector<Eigen::MatrixXd>& J, const std::vector<Eigen::Index>& moved,
                            const Eigen::MatrixXd& known) {
  const Eigen::Index n = J.front().cols();
  const auto m = static_cast<Eigen::Index>(moved.size());
  constexpr Eigen::Index kStretches = 2;  // of an axis, so that no core waits for the last one
  std::vector<Eigen::MatrixXd> parts(J.size() * kAxes * kStretches, Eigen::MatrixXd::Zero(n, m));
  in_parallel(parts.size(), [&](std::size_t job) {
    const Eigen::MatrixXd& j = J[job / (kAxes * kStretches)];
    const Eigen::Index frames = j.rows() / kAxes;
    const auto stretch = static_cast<Eigen::Index>(job % (kAxes * kStretches));
    const Eigen::Index first = stretch % kStretches * frames / kStretches;
    const Eigen::Index count = (stretch % kStretches + 1) * frames / kStretches - first;
    const auto rows = j.middleRows(stretch / kStretches * frames + first, count);
    if (m == n)
      add_products(rows, parts[job]);
    else
      parts[job].noalias() = rows.transpose() * Eigen::MatrixXd(rows(Eigen::all, moved));
  });
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(n, n);
  sum.topLeftCorner(known.rows(), known.cols()) = known;
  for (Eigen::Index k = 0; k < m; ++k) {
    const Eigen::Index p = moved[static_cast<std::size_t>(k)];
    sum.col(p).setZero();
    for (const Eigen::MatrixXd& part : parts) sum.col(p) += part.col(k);
    sum.row(p) = sum.col(p).transpose();
  }
  return sum;
}

// `own_at`: the effect's own motion at `at`, where it is known.
Eigen::VectorXd column(const Problem& problem, const Fit& at, const Eigen::VectorXd& innovations_at,
                       const FreeParameter& free, std::size_t f, const Eigen::VectorXd* own_at = nullptr) {
  std::vector<Effect> moved = at.effects;
  if (free.linear) {
    std::visit([](auto& e) { e.parameters(e, ZeroNumbers{}); }, moved[free.effect]);
    parameter(moved, free) = 1.0;
    std::optional<Reach> reach;
    if (over_the_floor(moved[free.effect]))
      reach = reach_of_node(moved[free.effect], free.element, *problem.vehicle);
    return own_motion(problem, moved[free.effect], at.effects, f, at.noise, reach ? &*reach : nullptr);
  }
  double& value = parameter(moved, free);
  const Bounds bounds = bounds_of(moved, free);
  // Step away from the nearer bound.
  const double step = value + free.step > bounds.max ? -free.step : free.step;
  // From both sides what is far from linear and nearly cancels: what ends at an edge, anchor and slack of a
  // tether; delays of opening and of closing, between which pulses vanish.
  const double other_side = value - step;
  const bool outside = acts_from_outside(moved[free.effect]);
  const bool both_sides = (outside || std::holds_alternative<ValveDelay>(moved[free.effect])) &&
                          bounds.min <= other_side && other_side <= bounds.max;
  const Flight& flight = (*problem.flights)[f];
  const auto motion_of = [&](const std::vector<Effect>& effects) {
    return outside ? own_motion(problem, effects[free.effect], at.effects, f, at.noise)
                   : innovations(flight, flight.integrate(problem.plant(effects, f)), at.noise);
  };
  value += step;
  Eigen::VectorXd change = motion_of(moved);
  if (both_sides) {
    value = other_side;
    change -= motion_of(moved);
    return change / (2.0 * step);
  }
  if (!outside)
    change -= innovations_at;
  else if (own_at != nullptr)
    change -= *own_at;
  else
    change -= motion_of(at.effects);
  return change / step;
}

}  // namespace

bool acts_from_outside(const Effect& effect) {
  if (const Unmodelled* law = std::get_if<Unmodelled>(&effect)) return !depends_on_valves(*law);
  return std::holds_alternative<FloorTilt>(effect) || std::holds_alternative<FloorUnevenness>(effect) ||
         std::holds_alternative<Airflow>(effect) || std::holds_alternative<Tether>(effect) ||
         std::holds_alternative<ViscousDrag>(effect) || std::holds_alternative<QuadraticDrag>(effect) ||
         std::holds_alternative<CoulombFriction>(effect) || std::holds_alternative<FrictionPatch>(effect) ||
         std::holds_alternative<ExternalImpulse>(effect) || std::holds_alternative<FloorVibration>(effect);
}

bool acts_through_thrusters(const Effect& effect) {
  return !acts_from_outside(effect) && !shapes_response(effect) &&
         !std::holds_alternative<MassDepletion>(effect) && !std::holds_alternative<Slosh>(effect) &&
         !std::holds_alternative<BearingDown>(effect);
}

std::optional<Fit> without_outside(const Problem& problem, const Fit& fit) {
  std::vector<Effect> rest;
  for (const Effect& effect : fit.effects) {
    if (std::holds_alternative<Slosh>(effect)) return std::nullopt;
    if (!acts_from_outside(effect)) rest.push_back(effect);
  }
  if (rest.size() == fit.effects.size()) return std::nullopt;
  return evaluate(problem, std::move(rest), {}, fit.noise);
}

Eigen::VectorXd presence_column(const Problem& problem, const Fit& at, const Effect& effect,
                                std::size_t flight) {
  if (acts_from_outside(effect)) return own_motion(problem, effect, at.effects, flight, at.noise);
  std::vector<Effect> more = at.effects;
  more.push_back(effect);
  const ForceIntegrals forces = (*problem.flights)[flight].integrate(problem.plant(more, flight));
  return innovations((*problem.flights)[flight], forces, at.noise) - at.innovations[flight];
}

Eigen::MatrixXd column_block(const Problem& problem, const Fit& at, const Eigen::VectorXd& innovations_at,
                             const std::vector<FreeParameter>& free, std::size_t flight) {
  Eigen::MatrixXd columns = in_large_pages(innovations_at.size(), static_cast<Eigen::Index>(free.size()));
  const Effect& effect = at.effects[free.front().effect];
  Eigen::VectorXd own;
  if (acts_from_outside(effect) && !free.front().linear)
    own = own_motion(problem, effect, at.effects, flight, at.noise);
  for (std::size_t p = 0; p < free.size(); ++p)
    columns.col(static_cast<Eigen::Index>(p)) =
        column(problem, at, innovations_at, free[p], flight, own.size() > 0 ? &own : nullptr);
  return columns;
}

namespace {

std::vector<Eigen::MatrixXd> empty_columns(const Fit& fit) {
  std::vector<Eigen::MatrixXd> columns;
  for (const Eigen::VectorXd& innovations : fit.innovations)
    columns.push_back(in_large_pages(innovations.size(), static_cast<Eigen::Index>(fit.free.size())));
  return columns;
}

// Computes the columns of `wanted` parameters, in place.
void fill_columns(const Problem& problem, const Fit& at, const std::vector<Eigen::Index>& wanted,
                  std::vector<Eigen::MatrixXd>& columns) {
  const std::size_t flights = columns.size();
  in_parallel(flights * wanted.size(), [&](std::size_t job) {
    const std::size_t f = job % flights;
    const Eigen::Index p = wanted[job / flights];
    columns[f].col(p) = column(problem, at, at.innovations[f], at.free[static_cast<std::size_t>(p)], f);
  });
}

// Of a fit's parameters those whose columns change with it, and from the `known`th on all.
std::vector<Eigen::Index> unknown_columns(const Fit& fit, Eigen::Index known) {
  std::vector<Eigen::Index> unknown;
  for (std::size_t p = 0; p < fit.free.size(); ++p) {
    const auto index = static_cast<Eigen::Index>(p);
    if (index >= known || !fit.free[p].linear) unknown.push_back(index);
  }
  return unknown;
}

}  // namespace

std::shared_ptr<const Linearisation> linearisation_of(const Problem& problem, const Fit& fit) {
  if (fit.linearisation != nullptr) return fit.linearisation;
  auto made = std::make_shared<Linearisation>();
  made->columns = empty_columns(fit);
  const std::vector<Eigen::Index> all = unknown_columns(fit, 0);
  fill_columns(problem, fit, all, made->columns);
  made->information = information(made->columns, all, Eigen::MatrixXd());
  return made;
}

void Fit::hold(const std::function<bool(const FreeParameter&)>& held) {
  std::vector<Eigen::Index> kept;
  std::vector<FreeParameter> left;
  for (std::size_t p = 0; p < free.size(); ++p) {
    if (held(free[p])) continue;
    kept.push_back(static_cast<Eigen::Index>(p));
    left.push_back(free[p]);
  }
  if (left.size() == free.size()) return;
  free = std::move(left);
  if (covariance.size() > 0) covariance = Eigen::MatrixXd(covariance(kept, kept));
  if (linearisation == nullptr) return;
  auto fewer = std::make_shared<Linearisation>();
  for (const Eigen::MatrixXd& all : linearisation->columns)
    fewer->columns.emplace_back(all(Eigen::all, kept));
  fewer->information = linearisation->information(kept, kept);
  linearisation = std::move(fewer);
}

void Fit::take_out(std::size_t effect) {
  hold([&](const FreeParameter& parameter) { return parameter.effect == effect; });
  for (FreeParameter& parameter : free) {
    if (parameter.effect > effect) --parameter.effect;
  }
  effects.erase(effects.begin() + static_cast<long>(effect));
}

Fit refine(const Problem& problem, Fit current, int iterations) {
  const auto n = static_cast<Eigen::Index>(current.free.size());
  if (n == 0) return current;
  const Eigen::MatrixXd prior = prior_precision(current.free);
  std::vector<Eigen::MatrixXd> J;
  Eigen::MatrixXd H, data;
  if (current.linearisation != nullptr) data = current.linearisation->information;
  if (data.rows() == n && current.linearisation.use_count() == 1) {
    J = std::move(std::const_pointer_cast<Linearisation>(current.linearisation)->columns);  // nobody else's
  } else {
    J = empty_columns(current);
    for (std::size_t f = 0; f < J.size() && data.rows() > 0; ++f)
      J[f].leftCols(data.cols()) = current.linearisation->columns[f];
  }
  current.linearisation.reset();
  constexpr double kNothing = 1e-4;  // nats
  double damping = 1e-6;
  for (int iteration = 0; iteration <= iterations; ++iteration) {
    const std::vector<Eigen::Index> unknown = unknown_columns(current, data.cols());
    fill_columns(problem, current, unknown, J);
    data = information(J, unknown, data);
    H = prior + data;
    Eigen::VectorXd g = -prior * from_prior_mean(current.effects, current.free);
    for (std::size_t f = 0; f < J.size(); ++f) g.noalias() -= J[f].transpose() * current.innovations[f];
    if (iteration == iterations) break;
    current.settled = false;

    bool improved = false;
    double gain = 0.0;
    for (int attempt = 0; attempt < 6 && !improved; ++attempt) {
      Eigen::MatrixXd damped = H;
      damped.diagonal() *= 1.0 + damping;
      const Eigen::VectorXd step = damped.ldlt().solve(g);
      if (0.5 * step.dot(g) < kNothing) break;
      std::vector<Effect> moved = current.effects;
      for (Eigen::Index p = 0; p < n; ++p) {
        const FreeParameter& free = current.free[static_cast<std::size_t>(p)];
        parameter(moved, free) += step[p];
      }
      clamp_to_bounds(moved, current.free);
      Fit trial = evaluate(problem, std::move(moved), current.free, current.noise);
      gain = objective(trial) - objective(current);
      if (gain > 0.0) {
        current = std::move(trial);
        damping = std::max(1e-9, damping * 0.1);
        improved = true;
      } else {
        damping = std::max(1e-3, damping * 30.0);
      }
    }
    current.settled = !improved || gain < kNothing;
    if (!improved) break;
    if (gain < 1e-2) iteration = iterations - 1;  // one more pass for the matrices at the optimum
  }

  current.evidence = objective(current) - occam_factor(prior, H, current.free);
  current.linearisation = std::make_shared<Linearisation>(Linearisation{std::move(J), std::move(data)});
  return current;
}

void add_covariance(const Problem& problem, Fit& fit) {
  const auto n = static_cast<Eigen::Index>(fit.free.size());
  if (n == 0) return;
  const std::shared_ptr<const Linearisation> linearisation = linearisation_of(problem, fit);
  const Eigen::MatrixXd prior = prior_precision(fit.free);
  const Eigen::MatrixXd H = prior + linearisation->information;
  const Eigen::MatrixXd inverse = H.ldlt().solve(Eigen::MatrixXd::Identity(n, n));
  // From blocks: honest about correlation that the residual has left. A block's own part in the fit made its
  // residual smaller; of many parameters, as maps have, blocks are too few to say so.
  Eigen::MatrixXd meat = prior;
  constexpr Eigen::Index kBlock = 250;  // frames: about 5 s
  constexpr Eigen::Index kMany = 40;    // parameters
  for (std::size_t f = 0; f < fit.innovations.size(); ++f) {
    const Eigen::MatrixXd& J = linearisation->columns[f];
    const Eigen::Index frames = J.rows() / kAxes;
    for (Eigen::Index begin = 0; begin < frames; begin += kBlock) {
      const Eigen::Index size = std::min(kBlock, frames - begin);
      Eigen::VectorXd score = Eigen::VectorXd::Zero(n);
      Eigen::MatrixXd rest;
      if (n <= kMany) rest = H;
      for (int axis = 0; axis < kAxes; ++axis) {
        const auto rows = J.middleRows(axis * frames + begin, size);
        score += rows.transpose() * fit.innovations[f].segment(axis * frames + begin, size);
        if (n <= kMany) rest -= rows.transpose() * rows;
      }
      if (n <= kMany) score = H * rest.ldlt().solve(score);
      meat.noalias() += score * score.transpose();
    }
  }
  const Eigen::MatrixXd sandwich = inverse * meat * inverse;
  // Blocks are few: never claim less than the information says.
  fit.covariance = inverse;
  for (Eigen::Index p = 0; p < n; ++p) {
    const double ratio = std::sqrt(std::max(1.0, sandwich(p, p) / inverse(p, p)));
    fit.covariance.row(p) *= ratio;
    fit.covariance.col(p) *= ratio;
  }
}

void smooth_all(const Problem& problem, const std::vector<Effect>& effects, const NoiseModel& noise,
                double looseness) {
  in_parallel(problem.flights->size(), [&](std::size_t f) {
    (*problem.flights)[f].smooth(problem.plant(effects, f), noise, looseness);
  });
}

NoiseModel profile_noise(const Problem& problem, const std::vector<Effect>& effects, const NoiseModel& start,
                         bool thorough) {
  std::vector<ForceIntegrals> forces(problem.flights->size());
  in_parallel(forces.size(),
              [&](std::size_t f) { forces[f] = (*problem.flights)[f].integrate(problem.plant(effects, f)); });
  return fit_noise(*problem.flights, forces, start, thorough);
}

Fit with_noise_refitted(const Problem& problem, Fit best, FitEffort effort) {
  const bool thorough = effort == FitEffort::kThorough;
  for (int round = 0; round < (thorough ? 2 : 1); ++round) {
    const NoiseModel level = profile_noise(problem, best.effects, best.noise, round == 0);
    const bool same_noise = level == best.noise;
    if (best.settled && same_noise) continue;
    Fit again = evaluate(problem, best.effects, best.free, level);
    if (same_noise) again.linearisation = std::move(best.linearisation);
    best = refine(problem, std::move(again), 3);
  }
  return best;
}

Fit fit(const Problem& problem, std::vector<Effect> effects, std::vector<FreeParameter> free,
        const NoiseModel& noise, FitEffort effort, std::shared_ptr<const Linearisation> known) {
  Fit start = evaluate(problem, std::move(effects), std::move(free), noise);
  start.linearisation = std::move(known);
  const int iterations = effort == FitEffort::kThorough ? 4 : 2;
  return with_noise_refitted(problem, refine(problem, std::move(start), iterations), effort);
}

}  // namespace atmos
