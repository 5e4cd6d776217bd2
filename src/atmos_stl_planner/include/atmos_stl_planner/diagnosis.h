// Why there is no plan, and how little would have to be given up to get one.
#pragma once

#include <string>
#include <vector>

#include "atmos_stl_planner/planner.h"

namespace atmos::stl {

// Parts of a specification that cannot hold together, though any of them left out makes a plan possible.
struct Conflict {
  std::vector<std::string> parts;  // clauses as text; "end of R1", "velocity limit", "keeping apart", ...
  bool minimal = false;            // false: the time limit came before every part had been tried
};

// One way out: a single part eased just enough.
struct Relaxation {
  std::string statement;  // "F[0,24.6] atmos.in(D) instead of F[0,20] atmos.in(D)"
  double cost = 0.0;      // relative change
};

class Diagnosis {
 public:
  // Specification and solver must outlive the diagnosis.
  Diagnosis(const Specification& specification, MilpSolver& solver, Clock clock);

  // Of a specification without a plan of its least robustness. Empty parts: there is one after all.
  Conflict conflict(double limit_s);

  // Ways to ease one part of the conflict, the smallest relative change first: a later end of an eventually,
  // an earlier end of an always, higher limits of velocity or acceleration.
  std::vector<Relaxation> relaxations(const Conflict& conflict, double limit_s);

 private:
  struct Part;
  std::vector<Part> parts() const;
  Conflict filtered(Scope& scope, double end, bool coarsest_alone);
  bool possible(const Scope& scope, double limit_s, bool coarsest_alone);

  const Specification& spec_;
  MilpSolver& solver_;
  Clock clock_;
};

// The conflict and the ways out in sentences, one a line.
std::string explanation(const Conflict& conflict, const std::vector<Relaxation>& relaxations);

}  // namespace atmos::stl
