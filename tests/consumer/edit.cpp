// Checks that the Gaussian of a removed cup gets a vote and that of the wall behind it does not.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <gslts/edit/inherit_attributes.hpp>
#include <gslts/edit/nearest.hpp>
#include <gslts/edit/votes.hpp>
#include <gslts/map/camera.hpp>
#include <gslts/map/gaussian_map.hpp>
#include <iostream>
#include <vector>

int main() {
  const gslts::Camera camera = gslts::camera_from_fov(64, 48, 1.0);
  gslts::GaussianMap map = gslts::make_gaussian_map<float>(2, 1);
  for (auto* array : {&map.means, &map.quats, &map.log_scales, &map.logit_opacities, &map.sh}) {
    std::fill(array->begin(), array->end(), 0.0f);
  }
  map.means[2] = 1;  // The cup, on the axis of the camera,
  map.means[5] = 2;  // and the wall behind.
  const std::vector<std::uint8_t> mask(std::size_t(64) * 48, 1);
  const std::vector<float> rendered(mask.size(), 1.0f);
  const auto votes =
      gslts::edit::count_votes(map.view(), {{camera, mask.data(), rendered.data()}}, {});
  if (votes.votes[0] != 1 || votes.votes[1] != 0) {
    std::cerr << "votes: " << votes.votes[0] << " and " << votes.votes[1] << '\n';
    return 1;
  }
  const std::vector<float> point = {0, 0, 1.9f};
  const auto nearest = gslts::edit::nearest_gaussians(map.view(), point.data(), 1, 1);
  const auto created =
      gslts::edit::inherit_attributes(map.view(), point.data(), nearest.rows.data(), 1, 2);
  if (nearest.rows[0] == 1 && created.size() == 1 && created.ids[0] == 2) return 0;
  std::cerr << "the nearest is " << nearest.rows[0] << '\n';
  return 1;
}
