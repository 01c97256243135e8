#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>

#include "gslts/map/array.hpp"
#include "gslts/map/camera.hpp"
#include "gslts/map/gaussian_map.hpp"
#include "gslts/map/pixel_mask.hpp"

namespace gslts::raster {

/// Options of rendering. The defaults are those of 3DGS (Kerbl et al. 2023) but for the near plane
/// and alpha_min, which is 1/255 there: half of it brings the image 5 dB nearer to the exact one
/// for 4 % of the time (benchmarks/results/rasterizer.md).
struct RenderOptions {
  std::array<double, 3> background{0.0, 0.0, 0.0};  ///< RGB behind the Gaussians.
  double near_m = 0.05;  ///< Near plane: Gaussians with centre depth z <= near_m are culled, m. > 0
  /// Far plane: Gaussians with centre depth z > far_m are culled, m. > near_m
  double far_m = std::numeric_limits<double>::infinity();
  /// Gaussians within so many standard deviations of depth of the camera are culled: the affine
  /// projection is invalid there, and turns a wall beside the camera into fog (the guard band of
  /// Kerbl et al. 2023, sec. 6). >= 0
  double near_sigmas = 3.0;
  int sh_degree = 3;  ///< Highest SH degree used, 0 to 3; the map's own degree caps it.
  /// Colours below 0 count as 0, as in 3DGS; if false they are kept, and `rgb` is linear in `sh`.
  bool clamp_colors = true;
  /// Variance added to each projected covariance, px^2 (3DGS: 0.3). >= 0
  double eps2d_px2 = 0.3;
  /// Scale opacity by sqrt(det(cov2d) / det(cov2d + eps2d I)), so that small or distant Gaussians
  /// keep their energy (Mip-Splatting, Yu et al. 2024, eq. 9).
  bool antialias = false;
  /// A Gaussian's depth changes across its footprint as that of its visible points (RaDe-GS, Zhang
  /// et al. 2024), so that slanted surfaces are exact; if false it is that of its centre, as in
  /// 3DGS. Where it would change by half within the footprint, it is that of the centre, too.
  bool surface_depth = true;
  /// Minimum alpha of a Gaussian that is blended at a pixel. In [1e-30, 0.99)
  double alpha_min = 1.0 / 512.0;
  /// Minimum transmittance of a pixel; it ends before the Gaussian that would leave less. In [0, 1)
  double transmittance_min = 1e-4;
  /// Degree of the polynomial that replaces exp: 3, with a relative error of alpha of up to 8e-5,
  /// far below that of alpha_min, or 5, to the precision of float. Double precision always takes
  /// the exact exp.
  int exp_degree = 3;
  int threads = 0;  ///< 0 means one a hardware thread. Results do not depend on it.
};

/// Rendered images, row-major. With w_i = alpha_i prod_{j<i} (1 - alpha_j) at a pixel:
template <typename T>
struct Images {
  int width = 0, height = 0, feature_dims = 0;
  Array<T> rgb;  ///< [H,W,3] sum w_i c_i + (1 - alpha) background
  /// [H,W] expected depth, sum w_i z_i / sum w_i, z in the camera frame, m; 0 where nothing was
  /// blended.
  Array<T> depth;
  Array<T> alpha;     ///< [H,W] sum w_i
  Array<T> features;  ///< [H,W,D] sum w_i f_i
};

/// Gradients of a scalar loss L with respect to `Images`; null means that L ignores that image.
template <typename T>
struct ImageGradients {
  const T* dL_drgb = nullptr;       ///< [H,W,3]
  const T* dL_ddepth = nullptr;     ///< [H,W]
  const T* dL_dalpha = nullptr;     ///< [H,W]
  const T* dL_dfeatures = nullptr;  ///< [H,W,D]
};

/// Read-only, non-owning view of the gradients of V Gaussians; shapes as in `Gradients`.
template <typename T>
struct GradientsView {
  std::size_t size = 0;  ///< V
  int sh_bases = 1;      ///< K
  int feature_dims = 0;  ///< D
  const std::uint32_t* rows = nullptr;
  const T* dL_dmeans = nullptr;
  const T* dL_dquats = nullptr;
  const T* dL_dlog_scales = nullptr;
  const T* dL_dlogit_opacities = nullptr;
  const T* dL_dsh = nullptr;
  const T* dL_dfeatures = nullptr;  ///< May be null when D is 0.
};

/// Gradients with respect to the stored parameters of the V Gaussians that the camera sees; all
/// others have gradient zero.
template <typename T>
struct Gradients {
  int sh_bases = 1;              ///< K
  int feature_dims = 0;          ///< D
  Array<std::uint32_t> rows;     ///< [V] rows of the map, ascending
  Array<T> dL_dmeans;            ///< [V,3]
  Array<T> dL_dquats;            ///< [V,4]
  Array<T> dL_dlog_scales;       ///< [V,3]
  Array<T> dL_dlogit_opacities;  ///< [V]
  Array<T> dL_dsh;               ///< [V,K,3]
  Array<T> dL_dfeatures;         ///< [V,D]
  /// Gradient with respect to xi = (rho, phi), translation (m) before rotation (rad), both in the
  /// camera frame, of world_from_camera(xi) = world_from_camera * exp(xi), at xi = 0.
  std::array<double, 6> dL_dtwist{};
  /// Filled on request, else empty; over the pixels at which the Gaussian was blended:
  Array<T> abs_dL_dmeans2d;           ///< [V,2] sum of |dL/dmean2d|, per px (AbsGS, Ye et al. 2024)
  Array<T> max_weights;               ///< [V] greatest blend weight w
  Array<std::uint32_t> pixel_counts;  ///< [V] number of pixels

  /// @throws std::invalid_argument  if an array is not as long as its shape says.
  GradientsView<T> view() const;
};

/// A feature image lifted to the V Gaussians that the camera sees, with w_p the blend weight of a
/// Gaussian at pixel p. Summed over views, the quotient is the mean feature of a Gaussian.
template <typename T>
struct LiftedFeatures {
  Array<std::uint32_t> rows;   ///< [V] rows of the map, ascending
  Array<T> weighted_features;  ///< [V,D] sum_p w_p S_p
  Array<T> weights;            ///< [V] sum_p w_p
};

template <typename T>
struct RenderState;

/// Renders Gaussians and differentiates the rendering (3D Gaussian splatting, Kerbl et al. 2023).
///
/// An object holds the working memory of one rendering: `backward` differentiates the last
/// `forward`, and both reuse the memory of the previous call. If several threads call it, use an
/// object for each of them.
/// T = float is the fast kernel; T = double evaluates the same algorithm without approximations.
/// Results are bit-identical for any thread count.
template <typename T>
class Rasterizer {
 public:
  /// @throws std::invalid_argument  if GSLTS_SIMD names an instruction set that this machine lacks.
  Rasterizer();
  ~Rasterizer();
  Rasterizer(Rasterizer&&) noexcept;
  Rasterizer& operator=(Rasterizer&&) noexcept;

  /// Renders one view.
  /// @param mask  Pixels to render. Those not wanted come back as zero in every image and take no
  ///   part in the gradients; the work is proportional to the 4x4 blocks that the mask touches.
  /// @throws std::invalid_argument  for a bad camera, option or mask size, and for any number in
  ///   the Gaussians that is not finite (naming the array and the index of its first).
  /// @throws std::runtime_error  if more than about 2^32 Gaussians and tiles of one row of tiles
  /// meet.
  Images<T> forward(const GaussianView<T>& gaussians, const Camera& camera,
                    const RenderOptions& options = {}, const PixelMask& mask = {});

  /// Differentiates the last `forward`.
  /// @param gaussians  The same Gaussians, unchanged since.
  /// @param statistics  Also fill abs_dL_dmeans2d, max_weights and pixel_counts.
  /// @throws std::logic_error  if there was no forward.
  /// @throws std::invalid_argument  if the sizes differ from those of the forward, or a number in
  ///   the image gradients is not finite.
  Gradients<T> backward(const GaussianView<T>& gaussians, const ImageGradients<T>& image_gradients,
                        bool statistics = false);

  /// Lifts a feature image of the view of the last `forward`: the transpose of rendering features,
  /// without the map having any.
  /// @param gaussians  The same Gaussians, unchanged since.
  /// @param features  S [H,W,D]; pixels outside the mask are ignored.
  /// @throws std::logic_error  if there was no forward.
  /// @throws std::invalid_argument  if the sizes differ from those of the forward, dims is below 1,
  ///   or a wanted number is not finite.
  LiftedFeatures<T> lift(const GaussianView<T>& gaussians, const T* features, int dims);

 private:
  std::unique_ptr<RenderState<T>> state_;
};

}  // namespace gslts::raster
