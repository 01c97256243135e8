#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "edit_scenes.hpp"
#include "gslts/edit/visibility.hpp"
#include "gslts/edit/votes.hpp"

namespace gslts::edit {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr std::size_t kPixels = 64 * 48;

/// Projects a point of the world in double, straight from the definition of the camera.
struct Projection {
  bool inside;
  int column, row;
  double depth_m;
};

Projection project(const Camera& camera, const Eigen::Vector3d& point) {
  const Eigen::Matrix3d rotation = camera.world_from_camera.linear();
  const Eigen::Vector3d p = rotation.transpose() * (point - camera.world_from_camera.translation());
  if (p.z() <= 0) return {false, 0, 0, p.z()};
  const double u = camera.fx * p.x() / p.z() + camera.cx;
  const double v = camera.fy * p.y() / p.z() + camera.cy;
  const bool inside = u >= 0 && v >= 0 && u < camera.width && v < camera.height;
  return {inside, int(std::floor(u)), int(std::floor(v)), p.z()};
}

/// Random centres, some behind cameras; and views of random masks and depths.
struct Scene {
  std::vector<Eigen::Vector3d> centres;
  std::vector<Camera> cameras;
  std::vector<std::vector<std::uint8_t>> masks;
  std::vector<std::vector<float>> depths;
};

Scene random_scene(unsigned seed, const Eigen::Vector3d& middle) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> side(-2, 2), unit(0, 1);
  Scene scene;
  for (int i = 0; i < 300; ++i) {
    scene.centres.push_back(middle + Eigen::Vector3d(side(random), side(random), side(random)));
  }
  for (int k = 0; k < 5; ++k) {
    const Eigen::Vector3d eye =
        middle + 3 * Eigen::Vector3d(side(random), side(random), 0.2 * side(random));
    scene.cameras.push_back(camera_at(eye, middle));
    scene.masks.emplace_back();
    scene.depths.emplace_back();
    for (std::size_t p = 0; p < kPixels; ++p) {
      scene.masks.back().push_back(unit(random) < 0.4 ? 255 : 0);
      const double kind = unit(random);
      const float missing = kind < 0.1 ? 0.0f : std::numeric_limits<float>::quiet_NaN();
      scene.depths.back().push_back(kind < 0.2 ? missing : float(8 * unit(random)));
    }
  }
  return scene;
}

class Votings : public ::testing::TestWithParam<unsigned> {};

TEST_P(Votings, EqualTheOracle) {
  const Eigen::Vector3d origin(100, -50, 2);
  const Scene scene = random_scene(GetParam(), origin);
  const GaussianMap map = map_of(scene.centres, origin);
  const VoteRule rule;
  for (const bool as_gs_lts : {false, true}) {
    std::vector<VotingView> views;
    for (std::size_t k = 0; k < scene.cameras.size(); ++k) {
      views.push_back(
          {scene.cameras[k], scene.masks[k].data(), as_gs_lts ? nullptr : scene.depths[k].data()});
    }
    const Votes result = count_votes(map.view(), views, rule);
    int hidden = 0;
    for (std::size_t i = 0; i < scene.centres.size(); ++i) {
      int votes = 0, seen_in = 0;
      for (std::size_t k = 0; k < views.size(); ++k) {
        const Projection seen = project(scene.cameras[k], scene.centres[i]);
        if (!seen.inside) continue;
        const std::size_t p = std::size_t(seen.row * 64 + seen.column);
        const double surface_m = double(scene.depths[k][p]);
        if (!as_gs_lts && surface_m > 0 &&
            seen.depth_m > surface_m + rule.behind_m + rule.behind_share * surface_m) {
          ++hidden;
          continue;
        }
        ++seen_in;
        votes += scene.masks[k][p] != 0;
      }
      EXPECT_EQ(result.votes[i], votes) << i;
      EXPECT_EQ(result.views[i], seen_in) << i;
    }
    EXPECT_EQ(hidden > 0, !as_gs_lts);
  }
}

TEST_P(Votings, VisibilityEqualsTheOracle) {
  const Scene scene = random_scene(GetParam(), {1, 2, 3});
  const GaussianMap map = map_of(scene.centres);
  const DepthTolerance rule{0.3, 0.05};
  std::vector<DepthView> views;
  for (std::size_t k = 0; k < scene.cameras.size(); ++k) {
    views.push_back({scene.cameras[k], scene.depths[k].data()});
  }
  const VisibilityCounts result = count_visibility(map.view(), views, rule);
  int all_on = 0;
  for (std::size_t i = 0; i < scene.centres.size(); ++i) {
    int on = 0, through = 0;
    for (std::size_t k = 0; k < views.size(); ++k) {
      const Projection seen = project(scene.cameras[k], scene.centres[i]);
      if (!seen.inside) continue;
      const double off_m =
          double(scene.depths[k][std::size_t(seen.row * 64 + seen.column)]) - seen.depth_m;
      const double margin_m = rule.margin_m + rule.margin_share * seen.depth_m;
      if (std::isnan(off_m) || off_m == -seen.depth_m) continue;
      on += std::abs(off_m) <= margin_m;
      through += off_m > margin_m;
    }
    EXPECT_EQ(result.on_surface[i], on) << i;
    EXPECT_EQ(result.seen_through[i], through) << i;
    all_on += on;
  }
  EXPECT_GT(all_on, 0);
}

INSTANTIATE_TEST_SUITE_P(Seeds, Votings, ::testing::Range(0u, 4u));

TEST(Votes, WallBehindACupGetsNoVotes) {
  // A cup at 1 m, a wall at 2 m behind it, and a speck of dust before both.
  const GaussianMap map = map_of({{1, 0, 0}, {2, 0, 0}, {0.5, 0, 0}});
  const Camera camera = camera_at({0, 0, 0}, {1, 0, 0});
  const std::vector<std::uint8_t> mask(kPixels, 1);
  const std::vector<float> rendered(kPixels, 1.0f);
  const Votes as_gs_lts = count_votes(map.view(), {{camera, mask.data(), nullptr}}, {});
  EXPECT_THAT(as_gs_lts.votes, ElementsAre(1, 1, 1));
  const Votes visible = count_votes(map.view(), {{camera, mask.data(), rendered.data()}}, {});
  EXPECT_THAT(visible.votes, ElementsAre(1, 0, 1));
  EXPECT_THAT(visible.views, ElementsAre(1, 0, 1));
  const std::vector<float> empty(kPixels, 0.0f);  // The map has no surface: nothing is hidden.
  EXPECT_THAT(count_votes(map.view(), {{camera, mask.data(), empty.data()}}, {}).votes,
              ElementsAre(1, 1, 1));
}

TEST(Votes, CentresOutsideTheImageGetNoVotes) {
  const GaussianMap map = map_of({{-1, 0, 0}, {1, 5, 0}, {0, 0, 0}});
  const Camera camera = camera_at({0, 0, 0}, {1, 0, 0});
  const std::vector<std::uint8_t> mask(kPixels, 1);
  EXPECT_THAT(count_votes(map.view(), {{camera, mask.data(), nullptr}}, {}).views,
              ElementsAre(0, 0, 0));
}

TEST(Votes, NoGaussiansAndNoViewsAreFine) {
  const Camera camera = camera_at({0, 0, 0}, {1, 0, 0});
  const std::vector<std::uint8_t> mask(kPixels, 1);
  EXPECT_TRUE(count_votes(map_of({}).view(), {{camera, mask.data(), nullptr}}, {}).votes.empty());
  EXPECT_THAT(count_votes(map_of({{1, 0, 0}}).view(), {}, {}).votes, ElementsAre(0));
  EXPECT_THAT(count_visibility(map_of({{1, 0, 0}}).view(), {}, {}).on_surface, ElementsAre(0));
}

TEST(VotesErrors, NameWhatIsWrong) {
  const GaussianMap map = map_of({{1, 0, 0}});
  const Camera camera = camera_at({0, 0, 0}, {1, 0, 0});
  const std::vector<std::uint8_t> mask(kPixels, 1);
  const std::vector<float> depth(kPixels, 1.0f);
  EXPECT_THAT(message_of([&] {
                count_votes(map.view(), {{camera, nullptr, nullptr}}, {});
              }),
              HasSubstr("count_votes: a view has no mask"));
  EXPECT_THAT(message_of([&] {
                count_votes(map.view(), {{camera, mask.data(), nullptr}}, VoteRule{-1, 0});
              }),
              HasSubstr("count_votes: behind_m must be finite and not negative, got -1"));
  EXPECT_THAT(message_of([&] {
                count_visibility(map.view(), {{camera, nullptr}}, {});
              }),
              HasSubstr("count_visibility: a view has no depth"));
  const double nan = std::nan("");
  EXPECT_THAT(message_of([&] {
                count_visibility(map.view(), {{camera, depth.data()}}, DepthTolerance{0, nan});
              }),
              HasSubstr("count_visibility: margin_share must be finite and not negative, got nan"));
  Camera bad = camera;
  bad.fx = 0;
  EXPECT_THAT(message_of([&] {
                count_votes(map.view(), {{bad, mask.data(), nullptr}}, {});
              }),
              HasSubstr("count_votes: "));
}

}  // namespace
}  // namespace gslts::edit
