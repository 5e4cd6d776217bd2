#include "atmos_sim2real/floor_map.h"

namespace atmos {

bool over_the_floor(const Effect& effect) {
  return std::holds_alternative<FloorUnevenness>(effect) || std::holds_alternative<Airflow>(effect);
}

std::vector<std::string> components_of(const Effect& map) {
  if (std::holds_alternative<FloorUnevenness>(map)) return {"height_m"};
  return {"force_x_n", "force_y_n"};
}

Lattice lattice_of(const Effect& map) {
  if (const auto* floor = std::get_if<FloorUnevenness>(&map))
    return {floor->grid, floor->height_m.front().size(), floor->height_m.size()};
  const Airflow& wind = std::get<Airflow>(map);
  return {wind.grid, wind.force_x_n.front().size(), wind.force_x_n.size()};
}

void lay_out(Effect& map, const Lattice& lattice) {
  const GridRows zero(lattice.rows, std::vector<double>(lattice.columns, 0.0));
  if (auto* floor = std::get_if<FloorUnevenness>(&map)) {
    floor->grid = lattice.grid;
    floor->height_m = zero;
  } else {
    Airflow& wind = std::get<Airflow>(map);
    wind.grid = lattice.grid;
    wind.force_x_n = wind.force_y_n = zero;
  }
}

std::vector<FreeParameter> free_nodes(const Effect& map, std::size_t index, const Field& field) {
  const Lattice lattice = lattice_of(map);
  const auto joint = std::make_shared<const Eigen::MatrixXd>(precision(field, lattice));
  std::vector<FreeParameter> free;
  for (const std::string& component : components_of(map)) {
    for (std::size_t node = 0; node < lattice.nodes(); ++node)
      free.push_back({index, component, node, 0.0, field.deviation, 0.1 * field.deviation, true, joint});
  }
  return free;
}

}  // namespace atmos
