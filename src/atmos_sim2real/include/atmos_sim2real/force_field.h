// What a force field over the floor says of its cause.
#pragma once

#include "atmos_model/effects/airflow.h"

namespace atmos {

// Of what varies over the floor, the share of its square that no height explains: what is left when the
// nearest gradient is taken off. 0: all of it may be gravity; 1: all of it turns in circles. The mean force
// may be either, and tells nothing: over a small piece of floor it outshines all else.
double share_with_curl(const Airflow& field);

}  // namespace atmos
