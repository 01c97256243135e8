#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "simd_target.cpp"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

#include "gslts/raster/rasterizer.hpp"

HWY_BEFORE_NAMESPACE();
namespace gslts::raster::HWY_NAMESPACE {

const char* simd_target() { return hwy::TargetName(HWY_TARGET); }

}  // namespace gslts::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gslts::raster {

HWY_EXPORT(simd_target);

const char* simd_target() { return HWY_DYNAMIC_DISPATCH(simd_target)(); }

}  // namespace gslts::raster
#endif
