// The effects that are maps over the floor, floor_unevenness and airflow, as nodes of a lattice.
#pragma once

#include <string>
#include <vector>

#include "atmos_sim2real/fit.h"
#include "atmos_sim2real/floor_field.h"

namespace atmos {

bool over_the_floor(const Effect& effect);

// The rest is for such effects alone.
std::vector<std::string> components_of(
    const Effect& map);  // names of its parameters that hold a value per node
Lattice lattice_of(const Effect& map);
// The map laid out anew, all nodes 0.
void lay_out(Effect& map, const Lattice& lattice);
// Its nodes as free parameters of effect `index`, component by component, each a field of its own.
std::vector<FreeParameter> free_nodes(const Effect& map, std::size_t index, const Field& field);

}  // namespace atmos
