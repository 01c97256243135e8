#pragma once

#include <cstddef>
#include <new>
#include <utility>
#include <vector>

namespace gslts {

/// Allocates uninitialised memory for an `Array`, aligned to cache lines. The kernel takes longer
/// to hand out a page than a render takes to fill it: released blocks of 64 KiB and more are kept,
/// up to 128 MiB of them, for later arrays, and blocks of 4 MiB and more are requested in huge
/// pages.
/// @throws std::bad_alloc
void* allocate_array(std::size_t bytes);
/// Releases memory of `allocate_array`.
void deallocate_array(void* pointer, std::size_t bytes) noexcept;

/// Allocator behind `Array`: `resize` leaves numbers uninitialised, because images and gradients of
/// many megabytes are written once and must not be zeroed first.
template <typename T>
struct UninitializedAllocator {
  using value_type = T;

  UninitializedAllocator() = default;
  template <typename U>
  UninitializedAllocator(const UninitializedAllocator<U>&) {}

  T* allocate(std::size_t n) { return static_cast<T*>(allocate_array(n * sizeof(T))); }
  void deallocate(T* pointer, std::size_t n) { deallocate_array(pointer, n * sizeof(T)); }

  template <typename U>
  void construct(U* pointer) {
    ::new (static_cast<void*>(pointer)) U;
  }
  template <typename U, typename... Args>
  void construct(U* pointer, Args&&... args) {
    ::new (static_cast<void*>(pointer)) U(std::forward<Args>(args)...);
  }

  friend bool operator==(const UninitializedAllocator&, const UninitializedAllocator&) {
    return true;
  }
  friend bool operator!=(const UninitializedAllocator&, const UninitializedAllocator&) {
    return false;
  }
};

/// A `std::vector` whose `Array<T>(n)` and `resize(n)` leave trivial elements uninitialised.
template <typename T>
using Array = std::vector<T, UninitializedAllocator<T>>;

}  // namespace gslts
