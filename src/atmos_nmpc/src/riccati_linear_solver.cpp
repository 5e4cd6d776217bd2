#include "riccati_linear_solver.h"

#include <algorithm>
#include <limits>

#ifdef ATMOS_NMPC_RICCATI
#include <HSLLoader.h>
#endif

namespace atmos {

namespace {

thread_local RiccatiLinearSolver* in_use = nullptr;

}  // namespace

bool RiccatiLinearSolver::analyse(int size, int count, const int* rows, const int* columns) {
  if (size != kkt_.size()) return false;
  slots_.resize(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    const std::optional<int> slot = kkt_.slot(rows[i] - 1, columns[i] - 1);
    if (!slot) return false;
    slots_[static_cast<std::size_t>(i)] = *slot;
  }
  return true;
}

bool RiccatiLinearSolver::factorise(const double* values) {
  kkt_.set_zero();
  double* entries = kkt_.entries();
  for (const int slot : slots_) entries[slot] += *values++;
  factorised_ = kkt_.factorise();
  return factorised_;
}

void RiccatiLinearSolver::solve(double* rhs) {
  if (factorised_) {
    kkt_.solve(rhs);
  } else {
    std::fill_n(rhs, kkt_.size(), std::numeric_limits<double>::quiet_NaN());
  }
}

int RiccatiLinearSolver::negative_eigenvalues() const {
  // Every block that fails adds at least one, whatever the rest: too many is all that Ipopt needs to know.
  return kkt_.layout().constraints() + (factorised_ ? 0 : 1);
}

RiccatiInUse::RiccatiInUse(RiccatiLinearSolver* solver) { in_use = solver; }
RiccatiInUse::~RiccatiInUse() { in_use = nullptr; }

#ifdef ATMOS_NMPC_RICCATI

namespace {

// MA27's interface (HSL, ma27 specification): info[0] is the error flag, info[14] the number of negative
// eigenvalues, info[4] and info[5] the sizes wanted of the work arrays, which we do not use.
constexpr int kBadInput = 1;

void initialise(ipfint*, double*) {}

void analyse(ipfint* n, ipfint* nz, const ipfint* rows, const ipfint* columns, ipfint*, ipfint*, ipfint*,
             ipfint*, ipfint* steps, ipfint*, ipfint*, double*, ipfint* info, double* operations) {
  *steps = 1;
  *operations = 0.0;
  std::fill_n(info, 20, 0);
  info[4] = info[5] = 1;
  if (in_use == nullptr || !in_use->analyse(*n, *nz, rows, columns)) info[0] = kBadInput;
}

void factorise(ipfint*, ipfint*, const ipfint*, const ipfint*, double* values, ipfint*, ipfint*, ipfint*,
               ipfint*, ipfint*, ipfint* front, ipfint*, ipfint*, double*, ipfint* info) {
  *front = 1;
  std::fill_n(info, 20, 0);
  if (in_use == nullptr) {
    info[0] = kBadInput;
    return;
  }
  in_use->factorise(values);
  info[14] = in_use->negative_eigenvalues();
}

void solve(ipfint*, double*, ipfint*, ipfint*, ipfint*, double*, ipfint*, double* rhs, ipfint*, ipfint*,
           ipfint*, double*) {
  if (in_use != nullptr) in_use->solve(rhs);
}

}  // namespace

bool riccati_seam_available() { return true; }
void install_riccati_seam() { LSL_setMA27(analyse, factorise, solve, initialise); }

#else

bool riccati_seam_available() { return false; }
void install_riccati_seam() {}

#endif

}  // namespace atmos
