// Joint maximum-a-posteriori fit of a list of effects to several flights, with the noise level as a nuisance
// parameter.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "atmos_model/effects.h"
#include "atmos_sim2real/likelihood.h"

namespace atmos {

// One number of one effect that the fit may change.
struct FreeParameter {
  std::size_t effect;   // index into the list of effects
  std::string name;     // as in model.yaml
  std::size_t element;  // of arrays and maps, else 0
  double prior_mean;    // the value at which the effect is absent, where there is one
  double prior_width;   // standard deviation of what is physically plausible, in the parameter's unit
  double step;          // for finite differences
  bool linear =
      false;  // the residual is linear in it and independent of the others: its column never changes
  // Maps: prior precision of all elements together, by element; prior_width is that of each by itself.
  std::shared_ptr<const Eigen::MatrixXd> joint = nullptr;
  // Where physics says more than the effect's own bounds.
  double least = -std::numeric_limits<double>::infinity(), most = std::numeric_limits<double>::infinity();
};

double& parameter(std::vector<Effect>& effects, const FreeParameter& free);
double parameter(const std::vector<Effect>& effects, const FreeParameter& free);

// Inverse covariance of the prior, and the parameters' distance from its mean.
Eigen::MatrixXd prior_precision(const std::vector<FreeParameter>& free);
Eigen::VectorXd from_prior_mean(const std::vector<Effect>& effects, const std::vector<FreeParameter>& free);
// 1/2 log of the prior's volume over the posterior's (Laplace): what fitting the parameters costs. [nats]
double occam_factor(const Eigen::MatrixXd& prior_precision, const Eigen::MatrixXd& posterior_precision,
                    const std::vector<FreeParameter>& free);

// Keeps the parameters within what their effects allow.
void clamp_to_bounds(std::vector<Effect>& effects, const std::vector<FreeParameter>& free);

// The innovations beside a fit, to first order in its free parameters.
struct Linearisation {
  std::vector<Eigen::MatrixXd> columns;  // per flight
  Eigen::MatrixXd information;           // sum of J' J
};

struct Fit {
  std::vector<Effect> effects;
  std::vector<FreeParameter> free;
  NoiseModel noise;
  double log_likelihood = 0.0;
  // log_likelihood + log prior - Occam factors (Laplace); comparable between fits to the same flights.
  double evidence = 0.0;
  // Of the free parameters, corrected for what correlation the residual has left; empty until
  // add_covariance().
  Eigen::MatrixXd covariance;
  std::vector<Eigen::VectorXd> innovations;  // per flight
  bool settled = true;                       // whether further steps at this noise would gain next to nothing
  // Fits have it, evaluations do not; a change of `free` must change it too.
  std::shared_ptr<const Linearisation> linearisation;

  // Without some of the free parameters; the effects stay as they are.
  void hold(const std::function<bool(const FreeParameter&)>& held);
  // Without an effect and its free parameters; not fitted again.
  void take_out(std::size_t effect);
};

// The flights with what all fits need of the vehicle.
struct Problem {
  const Vehicle* vehicle;
  std::vector<Effect> known;  // taken as part of the nominal model
  std::vector<Flight>* flights;

  Plant plant(const std::vector<Effect>& effects, std::size_t flight) const;
};

// Smooths the motion of every flight with the forces of these effects (Flight::smooth).
void smooth_all(const Problem& problem, const std::vector<Effect>& effects, const NoiseModel& noise,
                double looseness);

// Evaluates without fitting.
Fit evaluate(const Problem& problem, std::vector<Effect> effects, std::vector<FreeParameter> free,
             const NoiseModel& noise);

// That of a fit; of an evaluation by finite differences.
std::shared_ptr<const Linearisation> linearisation_of(const Problem& problem, const Fit& fit);

// Fills in the covariance of a fit.
void add_covariance(const Problem& problem, Fit& fit);

// Adds rows' rows to `sum`, quickly where most columns are 0 for most of the time, as those of a map's nodes
// are.
void add_products(const Eigen::Ref<const Eigen::MatrixXd>& rows, Eigen::MatrixXd& sum);

// The columns of one effect's parameters in one flight, whose innovations at `at` are given.
Eigen::MatrixXd column_block(const Problem& problem, const Fit& at, const Eigen::VectorXd& innovations_at,
                             const std::vector<FreeParameter>& free, std::size_t flight);

// Whether an effect pushes from outside, whatever the thrusters do and without a state of its own.
bool acts_from_outside(const Effect& effect);
// Whether it changes what the thrusters push, and nothing else.
bool acts_through_thrusters(const Effect& effect);

// The fit evaluated without what pushes from outside: beside it the columns of effects that act through
// thrusters are the same and cheaper. None where nothing pushes from outside, or where sloshing fuel answers
// to every push.
std::optional<Fit> without_outside(const Problem& problem, const Fit& fit);

// What a further effect, as it stands, changes of one flight's innovations.
Eigen::VectorXd presence_column(const Problem& problem, const Fit& at, const Effect& effect,
                                std::size_t flight);

// Gauss-Newton with step control from the given effects, at most `iterations` steps; bounds of the parameters
// hold. A linearisation that the start has, of all its parameters or the first of them, is believed for the
// linear ones.
Fit refine(const Problem& problem, Fit start, int iterations);

// The noise under which the flights are most likely, given these effects.
NoiseModel profile_noise(const Problem& problem, const std::vector<Effect>& effects, const NoiseModel& start,
                         bool thorough);

enum class FitEffort { kThorough, kQuick };
// A refined fit with its noise profiled and refined again: twice, or once where it is nearly right already.
Fit with_noise_refitted(const Problem& problem, Fit refined, FitEffort effort);
// Both in turn. `known`: a linearisation at this noise, believed as refine() does.
Fit fit(const Problem& problem, std::vector<Effect> effects, std::vector<FreeParameter> free,
        const NoiseModel& noise, FitEffort effort = FitEffort::kThorough,
        std::shared_ptr<const Linearisation> known = nullptr);

}  // namespace atmos
