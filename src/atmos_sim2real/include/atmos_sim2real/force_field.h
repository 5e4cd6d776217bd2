// What a force field over the floor says of its cause.
#pragma once

#include "atmos_model/effects/airflow.h"

namespace atmos {

// Share of the field's square that no height of a floor explains: what is left when the nearest gradient is
// taken off. 0: all of it may be gravity; 1: all of it turns in circles.
double share_with_curl(const Airflow& field);

}  // namespace atmos
