// Functions compiled for the machine's vector units too, chosen when the program starts: the binary stays
// portable.
#pragma once

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define ATMOS_VECTORISED __attribute__((target_clones("arch=x86-64-v3", "default")))
#else
#define ATMOS_VECTORISED
#endif
// What they call must become a part of them.
#define ATMOS_INLINED inline __attribute__((always_inline))

namespace atmos {

constexpr int kWidth = 4;  // doubles in a vector
using Vector =
    double __attribute__((vector_size(kWidth * sizeof(double)), aligned(sizeof(double)), may_alias));

}  // namespace atmos
