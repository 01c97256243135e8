#include "gslts/detect/shifts.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "depth_change.hpp"
#include "images.hpp"
#include "rules.hpp"

namespace gslts::detect {
namespace {

/// A motion over the floor about a centre: metres along x and y, and the angle about z, rad.
using Motion = Eigen::Vector3d;

Eigen::Isometry3d transform_of(const Motion& motion, const Eigen::Vector3d& center) {
  const Eigen::Vector3d shift(motion.x(), motion.y(), 0);
  return Eigen::Translation3d(center + shift) *
         Eigen::AngleAxisd(motion.z(), Eigen::Vector3d::UnitZ()) * Eigen::Translation3d(-center);
}

/// A point on a surface, world, and its colour.
struct ColoredPoint {
  Eigen::Vector3d position;
  const float* color;
};

/// Points of a changed surface.
struct Samples {
  Side side;
  std::vector<ColoredPoint> points;
};

/// Frame and map as depth images that answer what is at a point of the world.
class Scene {
 public:
  Scene(const Views& views, const Masks& masks, const ObjectRule& rule)
      : views_(views),
        known_(masks.known.data()),
        rule_(rule),
        slope_(surface_slope(image_of(views.rendered_depth, views.camera))),
        camera_from_world_(views.camera.world_from_camera.inverse()) {}

  enum class Answer { kSame, kDifferent, kUnknown };

  /// A pixel that may show a point, and the depth of the point.
  struct Pixel {
    std::size_t index;
    double depth_m;
  };

  /// Finds the pixel at most `margin` away, px, from a point at which one image shows the point; it
  /// gets the colour there.
  ///
  /// It is unknown outside the image, behind another surface, and where there is no depth.
  Answer find(Side side, ColoredPoint& point, Pixel& pixel, int margin) const {
    const Camera& camera = views_.camera;
    const Eigen::Vector3d in_camera = camera_from_world_ * point.position;
    pixel.depth_m = in_camera.z();
    if (pixel.depth_m <= 0) return Answer::kUnknown;
    const double u = std::floor(camera.fx * in_camera.x() / pixel.depth_m + camera.cx);
    const double v = std::floor(camera.fy * in_camera.y() / pixel.depth_m + camera.cy);
    if (!(u >= margin && u < camera.width - margin && v >= margin && v < camera.height - margin)) {
      return Answer::kUnknown;
    }
    const std::size_t center = std::size_t(v) * std::size_t(camera.width) + std::size_t(u);
    pixel.index = center;
    const Answer answer = compare(side, pixel, point);
    if (answer != Answer::kDifferent) return answer;
    for (int y = -margin; y <= margin; ++y) {
      for (int x = -margin; x <= margin; ++x) {
        pixel.index = center + std::size_t(std::ptrdiff_t(y) * camera.width + x);
        if (compare(side, pixel, point) == Answer::kSame) return Answer::kSame;
      }
    }
    return Answer::kDifferent;
  }

  /// Compares a point with what one image shows in a pixel.
  Answer compare(Side side, const Pixel& pixel, ColoredPoint& point) const {
    const std::size_t k = pixel.index;
    const double z = pixel.depth_m;
    const float depth = depth_of(side)[k];
    if (!known_[k] || !has_depth(depth)) return Answer::kUnknown;
    const double tolerance_m =
        kShiftDepth_m + kShiftDepthPerM * z * z + rule_.step_px * double(slope_.ptr<float>()[k]);
    if (depth < z - tolerance_m) return Answer::kUnknown;
    const float* color = rgb_of(side) + 3 * k;
    if (depth > z + tolerance_m || color_difference(color, point.color) > rule_.min_flat_color) {
      return Answer::kDifferent;
    }
    point.color = color;
    return Answer::kSame;
  }

  /// Takes evenly spread points of a surface.
  Samples sample(const Surface& surface, const Array<std::int32_t>& labels) const {
    const Camera& camera = views_.camera;
    Pixels pixels;
    for (std::size_t k = 0; k < labels.size(); ++k) {
      if (labels[k] == surface.label && has_depth(depth_of(surface.side)[k])) pixels.push_back(k);
    }
    Samples samples{surface.side, {}};
    const std::size_t count = std::min(pixels.size(), kShiftSamples);
    for (std::size_t n = 0; n < count; ++n) {
      const std::size_t k = pixels[n * pixels.size() / count];
      const double u = double(k % std::size_t(camera.width)) + 0.5;
      const double v = double(k / std::size_t(camera.width)) + 0.5;
      samples.points.push_back(
          {unproject(camera, u, v, depth_of(surface.side)[k]), rgb_of(surface.side) + 3 * k});
    }
    return samples;
  }

 private:
  const float* depth_of(Side side) const {
    return side == Side::kBefore ? views_.rendered_depth : views_.observed_depth;
  }
  const float* rgb_of(Side side) const {
    return side == Side::kBefore ? views_.rendered_rgb : views_.observed_rgb;
  }

  const Views& views_;
  const std::uint8_t* known_;
  const ObjectRule& rule_;
  cv::Mat slope_;
  Eigen::Isometry3d camera_from_world_;
};

Side other(Side side) { return side == Side::kBefore ? Side::kAfter : Side::kBefore; }

/// Follows a point of one image to the edge of the object, by steps of a motion.
/// @param margin  Distance, px, within which the other image may show it.
/// @param visit  Called with each place of the object before a step.
/// @return  kSame if the other image shows it at each step and this one something else at the last.
template <typename Visit>
Scene::Answer follow(const Scene& scene, Side side, ColoredPoint point,
                     const Eigen::Isometry3d& step, int margin, const Visit& visit) {
  using Answer = Scene::Answer;
  for (int n = 0; n < kMaxShiftSteps; ++n) {
    visit(point.position);
    point.position = step * point.position;
    Scene::Pixel pixel;
    const Answer moved = scene.find(other(side), point, pixel, margin);
    if (moved != Answer::kSame) return moved;
    const Answer stayed = scene.compare(side, pixel, point);
    if (stayed == Answer::kDifferent) return Answer::kSame;
    if (stayed == Answer::kUnknown) return Answer::kUnknown;
  }
  return Answer::kUnknown;
}

/// Returns the share of every n-th point of a surface that a motion explains, less those it
/// contradicts.
double score_of(const Scene& scene, const Samples& samples, const Eigen::Isometry3d& motion,
                int margin = kShiftTolerance_px, std::size_t stride = 1) {
  const Eigen::Isometry3d step = samples.side == Side::kBefore ? motion : motion.inverse();
  int balance = 0, count = 0;
  for (std::size_t n = 0; n < samples.points.size(); n += stride, ++count) {
    const auto answer =
        follow(scene, samples.side, samples.points[n], step, margin, [](const Eigen::Vector3d&) {});
    balance += int(answer == Scene::Answer::kSame) - int(answer == Scene::Answer::kDifferent);
  }
  return count == 0 ? 0 : double(balance) / double(count);
}

/// Searches the motion that explains some surfaces best.
class MotionSearch {
 public:
  MotionSearch(const Scene& scene, const std::vector<Samples>& all,
               const std::vector<std::size_t>& rows)
      : scene_(scene), all_(all), rows_(rows) {
    std::size_t count = 0;
    for (const std::size_t row : rows) {
      for (const ColoredPoint& point : all[row].points) center_ += point.position, ++count;
    }
    center_ /= double(std::max<std::size_t>(count, 1));
  }

  struct Found {
    Eigen::Isometry3d motion;
    double score;
  };

  /// The refinement also counts what is explained to the pixel: the tolerance leaves room for many
  /// motions.
  Found best() const {
    std::vector<Scored> candidates = coarse();
    Eigen::Vector3d step(kShiftStep_m / 2, kShiftStep_m / 2, kShiftStep_rad / 2);
    for (int round = 0; round < kShiftRounds; ++round, step /= 2) {
      keep_best(candidates);
      const std::vector<Scored> kept = std::exchange(candidates, {});
      for (const Scored& found : kept) {
        for (const Eigen::Vector3d& corner : neighbours()) {
          const Motion motion = found.motion + corner.cwiseProduct(step);
          candidates.push_back({motion, (score(motion) + score(motion, 0)) / 2});
        }
      }
    }
    keep_best(candidates);
    const Motion& best = candidates[0].motion;
    return {transform_of(best, center_), score(best)};
  }

 private:
  struct Scored {
    Motion motion;
    double score;
  };

  double score(const Motion& motion, int margin = kShiftTolerance_px,
               std::size_t stride = 1) const {
    const Eigen::Isometry3d transform = transform_of(motion, center_);
    double sum = 0;
    for (const std::size_t row : rows_) {
      sum += score_of(scene_, all_[row], transform, margin, stride);
    }
    return sum / double(rows_.size());
  }

  std::vector<Scored> coarse() const {
    std::vector<Scored> candidates;
    const int steps = int(kMaxShift_m / kShiftStep_m), turns = int(kMaxShift_rad / kShiftStep_rad);
    for (int x = -steps; x <= steps; ++x) {
      for (int y = -steps; y <= steps; ++y) {
        if (x * x + y * y > steps * steps || (x == 0 && y == 0)) continue;
        for (int turn = -turns; turn <= turns; ++turn) {
          const Motion motion(x * kShiftStep_m, y * kShiftStep_m, turn * kShiftStep_rad);
          candidates.push_back({motion, score(motion, kShiftTolerance_px, kShiftStride)});
        }
      }
    }
    return candidates;
  }

  static std::vector<Eigen::Vector3d> neighbours() {
    std::vector<Eigen::Vector3d> all;
    for (int k = 0; k < 27; ++k) {
      all.emplace_back(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
    }
    return all;
  }

  static void keep_best(std::vector<Scored>& candidates) {
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const Scored& a, const Scored& b) { return a.score > b.score; });
    candidates.resize(std::min(candidates.size(), kShiftCandidates));
  }

  const Scene& scene_;
  const std::vector<Samples>& all_;
  const std::vector<std::size_t>& rows_;
  Eigen::Vector3d center_ = Eigen::Vector3d::Zero();
};

/// Searches shifts of some surfaces, one after the other.
class ShiftFinder {
 public:
  ShiftFinder(const Scene& scene, std::vector<Samples> all)
      : scene_(scene), all_(std::move(all)), taken_(all_.size()) {}

  /// Returns the shift that explains the most points of surfaces without one; none if none does.
  std::optional<Shift> next() {
    std::optional<Group> best;
    int tried = 0;
    for (std::size_t seed = 0; seed < all_.size() && tried < kShiftSeeds; ++seed) {
      if (taken_[seed]) continue;
      ++tried;
      Group group = grow_from(seed);
      if (group.found.score < kMinShiftScore) continue;
      if (!best || explained_points(group) > explained_points(*best)) best = std::move(group);
    }
    if (!best) return std::nullopt;
    for (const std::size_t row : best->rows) taken_[row] = true;
    Shift shift{best->rows, best->found.motion, best->found.score, {}, {}};
    for (const std::size_t row : best->rows) extend_boxes(all_[row], shift);
    take_parts(shift);
    return shift;
  }

 private:
  struct Group {
    std::vector<std::size_t> rows;
    MotionSearch::Found found;
  };

  /// Joins the surfaces that the motion of the first one explains, and searches theirs.
  Group grow_from(std::size_t seed) const {
    Group group{{seed}, {}};
    group.found = MotionSearch(scene_, all_, group.rows).best();
    for (int round = 0; round < kShiftJoins && group.found.score >= kMinShiftScore; ++round) {
      std::vector<std::size_t> rows;
      for (std::size_t row = 0; row < all_.size(); ++row) {
        const bool joins = !taken_[row] && score(row, group.found.motion) >= kMinJoinedScore;
        if (joins) rows.push_back(row);
      }
      if (rows.size() <= group.rows.size()) break;
      const MotionSearch::Found found = MotionSearch(scene_, all_, rows).best();
      if (found.score < kMinShiftScore) break;
      group = {std::move(rows), found};
    }
    return group;
  }

  double score(std::size_t row, const Eigen::Isometry3d& motion) const {
    return score_of(scene_, all_[row], motion);
  }

  double explained_points(const Group& group) const {
    double sum = 0;
    for (const std::size_t row : group.rows) {
      sum += score(row, group.found.motion) * double(all_[row].points.size());
    }
    return sum;
  }

  void extend_boxes(const Samples& samples, Shift& shift) const {
    const bool is_before = samples.side == Side::kBefore;
    const Eigen::Isometry3d step = is_before ? shift.motion : shift.motion.inverse();
    for (const ColoredPoint& point : samples.points) {
      std::vector<Eigen::Vector3d> path;
      const auto visit = [&](const Eigen::Vector3d& position) { path.push_back(position); };
      if (follow(scene_, samples.side, point, step, kShiftTolerance_px, visit) !=
          Scene::Answer::kSame)
        continue;
      for (const Eigen::Vector3d& position : path) {
        (is_before ? shift.before : shift.after).extend(position);
        (is_before ? shift.after : shift.before).extend(step * position);
      }
    }
  }

  /// Adds the surfaces that lie where the object is, and that its motion does not contradict.
  void take_parts(Shift& shift) {
    for (std::size_t row = 0; row < all_.size(); ++row) {
      if (taken_[row] || score(row, shift.motion) < 0) continue;
      const Eigen::AlignedBox3d& box = all_[row].side == Side::kBefore ? shift.before : shift.after;
      std::size_t inside = 0;
      for (const ColoredPoint& point : all_[row].points) {
        inside += box.exteriorDistance(point.position) <= kMaxShift_m;
      }
      if (double(inside) < kMinShiftedShare * double(all_[row].points.size())) continue;
      taken_[row] = true;
      shift.surfaces.push_back(row);
    }
  }

  const Scene& scene_;
  std::vector<Samples> all_;
  std::vector<bool> taken_;
};

}  // namespace

std::vector<Shift> find_shifts(const Views& views, const Masks& masks,
                               const std::vector<Surface>& surfaces,
                               const Array<std::int32_t>& labels, const ObjectRule& rule) {
  validate(views.camera, "find_shifts");
  validate(rule, "find_shifts");
  const Scene scene(views, masks, rule);
  std::vector<Samples> samples;
  for (const Surface& surface : surfaces) samples.push_back(scene.sample(surface, labels));
  ShiftFinder finder(scene, std::move(samples));
  std::vector<Shift> shifts;
  while (std::optional<Shift> shift = finder.next()) shifts.push_back(std::move(*shift));
  return shifts;
}

}  // namespace gslts::detect
