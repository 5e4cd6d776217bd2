// Every hypothesis scored beside a model by its linearisation: cheap enough for hundreds of starts.
#pragma once

#include <memory>
#include <vector>

#include "atmos_sim2real/library.h"
#include "atmos_sim2real/noise_alone.h"

namespace atmos {

// One hypothesis at one start, scored by the linearised likelihood gain over the current model.
struct Screened {
  const Hypothesis* hypothesis = nullptr;
  Start start;
  double score = 0.0;         // nats, Occam factor and penalty taken off
  Eigen::VectorXd amplitude;  // of the start's linear parameters, from neutral
  Eigen::VectorXd
      deviation;  // what the flights would leave of each linear parameter's uncertainty, alone in its effect
  Eigen::VectorXd widths;  // prior widths of the same
  double gain = 0.0;       // nats, without prior, Occam factor and penalty
  double chance = 0.0;     // nats that it would gain if it were absent: half its effective parameters
  double presence = 0.0;   // nats that an effect which is there or not would bring if it were all there
  std::vector<double> score_of_noise;  // per draw; of onsets none
  Eigen::VectorXd information;         // maps: what the flights know of the field over what its prior does
};

// The columns of all hypotheses beside one model: computed once, asked in several ways. Problem, fit, library
// and noise must live as long.
class Screening {
 public:
  // `imagined`: where given, it is also scored what noise alone would score.
  Screening(const Problem& problem, const Fit& fit, const std::vector<Hypothesis>& library,
            const NoiseAlone* imagined = nullptr);
  ~Screening();

  // Every start of every hypothesis beside the model, best first.
  std::vector<Screened> beside() const;
  // The same in the place of one effect of the model, to first order: the others make room.
  std::vector<Screened> in_place_of(std::size_t effect) const;
  // What the effect itself gains there, prior and Occam factor not taken off. [nats]
  double worth(std::size_t effect) const;

 private:
  struct Made;
  std::unique_ptr<Made> made_;
};

// Scores all hypotheses beside `base`, best first; where given, also what they would score on noise alone.
std::vector<Screened> screen(const Problem& problem, const Fit& base, const std::vector<Hypothesis>& library,
                             const NoiseAlone* imagined = nullptr);

// Nats for the choices that no prior width expresses.
double choices_of(const Hypothesis& hypothesis);

// The free parameters as those of effect `index` of a list.
std::vector<FreeParameter> at_effect(std::vector<FreeParameter> free, std::size_t index);
// Which of a hypothesis' free parameters carry one of the names.
std::vector<FreeParameter> named(const std::vector<FreeParameter>& all,
                                 const std::vector<std::string>& names);

}  // namespace atmos
