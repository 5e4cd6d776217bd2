// The Riccati factorisation as Ipopt's linear solver (docs/nmpc_solver.md).
//
// Ipopt can take its linear solver MA27 from outside, as function pointers of a documented Fortran interface
// (HSLLoader.h, part of its installed headers). We hand it our own functions: they recognise the stage
// structure in the triplets and factorise by StageKkt.
#pragma once

#include "atmos_nmpc/stage_kkt.h"

namespace atmos {

// False where this build's Ipopt cannot take a linear solver from outside.
bool riccati_seam_available();
// Hands the functions to Ipopt, whose option linear_solver = ma27 then means them, in the whole process.
void install_riccati_seam();

// One solver's factorisation, fed with triplets.
class RiccatiLinearSolver {
 public:
  explicit RiccatiLinearSolver(const StageLayout& layout) : kkt_(layout) {}

  // Positions of the non-zeros, counted from 1; false if one lies outside of the stage structure.
  bool analyse(int size, int count, const int* rows, const int* columns);
  // False: wrong inertia.
  bool factorise(const double* values);
  void solve(double* rhs);

  int negative_eigenvalues() const;

 private:
  StageKkt kkt_;
  std::vector<int> slots_;
  bool factorised_ = false;
};

// Ipopt's calls on this thread go to `solver` while this object lives: the interface has no place for it.
class RiccatiInUse {
 public:
  explicit RiccatiInUse(RiccatiLinearSolver* solver);
  ~RiccatiInUse();
  RiccatiInUse(const RiccatiInUse&) = delete;
  RiccatiInUse& operator=(const RiccatiInUse&) = delete;
};

}  // namespace atmos
